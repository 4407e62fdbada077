//! The service as its clients see it: in process, and over real sockets.
//!
//! A device is needed; all tests share one. Volumes and pictures are small: the software device
//! of a machine without a GPU draws them, too.

// A session holds GPU buffers, whose types are deep.
#![recursion_limit = "256"]
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod datasets;
mod endurance;
mod environments;
mod exports;
mod links;
mod operations;
mod parts;
mod returning;
mod security;
mod sessions;
mod support;
mod tus;
mod tus_refusals;
mod uploads;
mod viewer_edits;
mod viewer_frames;

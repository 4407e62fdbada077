//! What travels: scene files, control messages, the frame header and REST types.
//!
//! One decoder serves the file on disk, the share link, the session and the benchmark. Every
//! error names the field it is about. The web client's types are generated from this crate
//! (see [`typescript`]); the OpenAPI document is generated from the REST types.

pub mod control;
pub mod field;
pub mod frame;
pub mod plan;
pub mod rest;
pub mod scene_file;
pub mod typescript;
mod validate;

pub use control::{ClientMessage, ServerMessage};
pub use field::FieldError;
pub use frame::{FrameFormat, FrameHeader};
pub use scene_file::SceneFile;

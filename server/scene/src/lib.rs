//! Checked scenes, volumes, snapshots, comparison and plan. No GPU, no async, no files.

pub mod builtin;
pub mod volume;

pub use volume::{Orientation, Volume, Voxels};

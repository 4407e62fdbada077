//! Checked scenes, volumes, snapshots, comparison and plan. No GPU, no async, no files.
//!
//! A [`Scene`] is immutable and complete; a [`Snapshot`] is a scene with an epoch. What changed
//! between two snapshots is derived ([`Changes::between`]), never announced; from it and from
//! what each cache was computed from follows the [`plan::Plan`].

pub mod bins;
pub mod builtin;
pub mod camera;
pub mod changes;
pub mod clip;
pub mod distance;
pub mod environment;
pub mod grid;
pub mod labels;
pub mod levels;
pub mod light;
pub mod macrocells;
pub mod majorants;
pub mod material;
pub mod part;
pub mod plan;
pub mod prepared;
pub mod probe;
pub mod records;
pub mod region;
pub mod rendering;
pub mod scattering;
pub mod scene;
pub mod spherical;
pub mod suns;
pub mod transfer_function;
pub mod volume;

pub use camera::Camera;
pub use changes::Changes;
pub use environment::{EnvironmentImage, EnvironmentImages};
pub use grid::Grid;
pub use light::Light;
pub use majorants::Majorants;
pub use prepared::PreparedVolume;
pub use records::Records;
pub use rendering::Rendering;
pub use scene::{Background, Integrator, Paths, Scene, Snapshot};
pub use transfer_function::TransferFunction;
pub use volume::{Orientation, Volume, Voxels};

//! What can go wrong on the GPU, in words a user can act on.

/// Failure of a GPU operation. The renderer stays usable unless the device was lost.
#[derive(Debug, Clone, thiserror::Error)]
pub enum RenderError {
    /// No usable Vulkan device.
    #[error("no Vulkan device found: {0}")]
    NoAdapter(String),
    /// The device exists but refused to open.
    #[error("the device `{name}` cannot be opened: {reason}")]
    Device {
        /// Adapter name.
        name: String,
        /// What the driver said.
        reason: String,
    },
    /// An allocation failed.
    #[error(
        "out of GPU memory for {what} ({bytes} bytes); close other sessions or use a smaller volume or picture"
    )]
    OutOfMemory {
        /// What was to be allocated.
        what: String,
        /// Its size.
        bytes: u64,
    },
    /// A size exceeds what the device allows.
    #[error("{what} exceeds this device's limit of {limit}")]
    TooLarge {
        /// What is too large, with its size.
        what: String,
        /// The limit, with its unit.
        limit: String,
    },
    /// The scene asks for what is not built yet, or for more than there is room for.
    #[error("{0}")]
    Refused(proto::FieldError),
    /// The driver reported an error; the picture may be wrong.
    #[error("GPU error: {0}")]
    Gpu(String),
    /// The device is gone.
    #[error("the GPU was lost: {0}")]
    DeviceLost(String),
}

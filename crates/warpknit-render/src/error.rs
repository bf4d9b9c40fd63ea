//! Why a graphics adapter draws nothing. The processor always draws.

/// Why the GPU draws nothing.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GpuError {
    /// No adapter, or none that is wanted.
    #[error(
        "no graphics adapter was found: install a Vulkan, Metal or DirectX 12 driver, or take --renderer cpu"
    )]
    NoAdapter,
    /// The library was built without the feature `gpu`.
    #[error(
        "this build draws on the processor alone: build it with the feature gpu, or take --renderer cpu"
    )]
    NotBuiltIn,
    /// An adapter that can't do what is asked of it.
    #[error(
        "the graphics adapter {adapter} can't draw yarns, it lacks {lacking}: take --renderer cpu"
    )]
    Lacking {
        /// Its name.
        adapter: String,
        /// What it has not.
        lacking: String,
    },
    /// The driver gave no device.
    #[error("the graphics adapter {adapter} gives no device ({reason}): take --renderer cpu")]
    NoDevice {
        /// Its name.
        adapter: String,
        /// What the driver says.
        reason: String,
    },
    /// The device's memory is full.
    #[error(
        "the graphics adapter {adapter} is out of memory: lower --size, --st or the densities, or take --renderer cpu"
    )]
    OutOfMemory {
        /// Its name.
        adapter: String,
    },
    /// The device stopped working.
    #[error(
        "the graphics adapter {adapter} was lost ({reason}): try again, or take --renderer cpu"
    )]
    Lost {
        /// Its name.
        adapter: String,
        /// What the driver says.
        reason: String,
    },
    /// The device refused a command, which is a fault of ours or of its driver.
    #[error("the graphics adapter {adapter} refused to draw ({reason}): take --renderer cpu")]
    Refused {
        /// Its name.
        adapter: String,
        /// The first line of what it says.
        reason: String,
    },
}

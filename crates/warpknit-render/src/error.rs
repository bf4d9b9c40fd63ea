//! Reasons why a graphics adapter draws nothing. The processor always draws.

/// Reasons why the GPU draws nothing.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GpuError {
    /// No adapter, or only a software one where a hardware one is wanted.
    #[error(
        "no graphics adapter was found: install a Vulkan, Metal or DirectX 12 driver, or take \
         --renderer cpu"
    )]
    NoAdapter,
    /// The library was built without the feature `gpu`.
    #[error(
        "this build draws on the processor alone: build it with the feature gpu, or take \
         --renderer cpu"
    )]
    NotBuiltIn,
    /// A body that would hide yarns.
    #[error("the graphics adapter can't draw a body: take --renderer cpu")]
    Body,
    /// The adapter lacks a capability.
    #[error(
        "the graphics adapter {adapter} can't draw yarns, it lacks {lacking}: take --renderer cpu"
    )]
    Lacking {
        /// Its name.
        adapter: String,
        /// The capability that it lacks.
        lacking: String,
    },
    /// The driver returned no device.
    #[error("the graphics adapter {adapter} gives no device ({reason}): take --renderer cpu")]
    NoDevice {
        /// Its name.
        adapter: String,
        /// The driver's message.
        reason: String,
    },
    /// The device's memory is full.
    #[error(
        "the graphics adapter {adapter} is out of memory: lower --size, --st or the densities, or \
         take --renderer cpu"
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
        /// The driver's message.
        reason: String,
    },
    /// The device refused a command. That is an error in this program or in its driver.
    #[error("the graphics adapter {adapter} refused to draw ({reason}): take --renderer cpu")]
    Refused {
        /// Its name.
        adapter: String,
        /// The device's message.
        reason: String,
    },
}

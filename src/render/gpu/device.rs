//! The graphics device: which adapter, with which limits, and what went wrong on it.
//!
//! In: whether a software adapter will do. Out: a [`Gpu`] ready to draw, or a [`GpuError`] that
//! says what to do. Nothing that the device refuses panics: errors that no call returns are kept,
//! and [`Gpu::fault`] hands over the first.

use std::sync::{Arc, Mutex, PoisonError};

use wgpu::{Backends, DeviceType, Instance, InstanceDescriptor, RequestAdapterOptions};

/// Why the GPU draws nothing.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GpuError {
    /// No adapter, or none that is wanted.
    #[error(
        "no graphics adapter was found: install a Vulkan, Metal or DirectX 12 driver, or take --renderer cpu"
    )]
    NoAdapter,
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

/// A graphics device and what it said of itself.
#[derive(Clone, Debug)]
pub struct Gpu {
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    name: String,
    fault: Arc<Mutex<Option<GpuError>>>,
}

/// Formats that every pass may count on, with what is asked of them.
const TARGETS: [(wgpu::TextureFormat, wgpu::TextureUsages); 3] = [
    (super::LIGHT, wgpu::TextureUsages::RENDER_ATTACHMENT),
    (super::MOMENTS, wgpu::TextureUsages::RENDER_ATTACHMENT),
    (super::DEPTH, wgpu::TextureUsages::RENDER_ATTACHMENT),
];

impl Gpu {
    /// The fastest adapter; one that computes on the processor only if `software` is wanted.
    ///
    /// # Errors
    /// No adapter, or one that refuses or lacks something.
    pub fn find(software: bool) -> Result<Self, GpuError> {
        let mut descriptor = InstanceDescriptor::new_without_display_handle();
        descriptor.backends = Backends::PRIMARY | Backends::GL;
        let instance = Instance::new(descriptor.with_env());
        let options = RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            ..RequestAdapterOptions::default()
        };
        let adapter = pollster::block_on(instance.request_adapter(&options))
            .map_err(|_none| GpuError::NoAdapter)?;
        if !software && adapter.get_info().device_type == DeviceType::Cpu {
            return Err(GpuError::NoAdapter);
        }
        Self::open(&adapter)
    }

    /// The device of an adapter, with all the limits that the adapter has: defaults would page
    /// large fabrics without need.
    fn open(adapter: &wgpu::Adapter) -> Result<Self, GpuError> {
        let name = adapter.get_info().name;
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("warpknit"),
            required_limits: adapter.limits(),
            ..wgpu::DeviceDescriptor::default()
        };
        let opened = pollster::block_on(adapter.request_device(&descriptor));
        let (device, queue) = opened.map_err(|error| GpuError::NoDevice {
            adapter: name.clone(),
            reason: first_line(&error.to_string()),
        })?;
        Self::on(adapter, device, queue)
    }

    /// Draws on a device that a window has opened.
    ///
    /// # Errors
    /// An adapter that lacks something.
    pub fn on(
        adapter: &wgpu::Adapter,
        device: wgpu::Device,
        queue: wgpu::Queue,
    ) -> Result<Self, GpuError> {
        let name = adapter.get_info().name;
        if let Some(lacking) = missing_capability(adapter, &device) {
            return Err(GpuError::Lacking { adapter: name, lacking });
        }
        let gpu = Self { device, queue, name, fault: Arc::default() };
        let (fault, adapter) = (Arc::clone(&gpu.fault), gpu.name.clone());
        gpu.device.on_uncaptured_error(Arc::new(move |error| {
            record_fault(&fault, from_wgpu_error(&adapter, &error))
        }));
        let (fault, adapter) = (Arc::clone(&gpu.fault), gpu.name.clone());
        gpu.device.set_device_lost_callback(move |_, reason| {
            record_fault(
                &fault,
                GpuError::Lost { adapter: adapter.clone(), reason: first_line(&reason) },
            );
        });
        Ok(gpu)
    }

    /// The adapter's name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// A buffer that holds `contents`, whose length is a multiple of four. wgpu's own helper panics
    /// where the device refuses; here [`Gpu::fault`] tells.
    pub(super) fn store(
        &self,
        label: &str,
        contents: &[u8],
        usage: wgpu::BufferUsages,
    ) -> wgpu::Buffer {
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: contents.len() as u64,
            usage: usage | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        self.queue.write_buffer(&buffer, 0, contents);
        buffer
    }

    /// Fails with the first thing that went wrong so far, if any did.
    pub(super) fn fault(&self) -> Result<(), GpuError> {
        match &*self.fault.lock().unwrap_or_else(PoisonError::into_inner) {
            Some(error) => Err(error.clone()),
            None => Ok(()),
        }
    }

    /// Waits until all that was submitted is done.
    pub(super) fn wait(&self) -> Result<(), GpuError> {
        let waited = self.device.poll(wgpu::PollType::wait_indefinitely());
        self.fault()?;
        match waited {
            Ok(_) => Ok(()),
            Err(error) => Err(GpuError::Lost {
                adapter: self.name.clone(),
                reason: first_line(&error.to_string()),
            }),
        }
    }
}

/// What an adapter would need and has not.
fn missing_capability(adapter: &wgpu::Adapter, device: &wgpu::Device) -> Option<String> {
    let downlevel = adapter.get_downlevel_capabilities().flags;
    if !downlevel.contains(wgpu::DownlevelFlags::VERTEX_STORAGE)
        || device.limits().max_storage_buffers_per_shader_stage < 5
    {
        return Some("storage buffers for vertices".to_owned());
    }
    let missing = |&&(format, usages): &&(wgpu::TextureFormat, wgpu::TextureUsages)| {
        !adapter.get_texture_format_features(format).allowed_usages.contains(usages)
    };
    TARGETS.iter().find(missing).map(|(format, _)| {
        format!("targets of {format:?}, which Vulkan, Metal and DirectX 12 drivers have")
    })
}

/// Keeps the first fault: what follows is its consequence.
fn record_fault(fault: &Mutex<Option<GpuError>>, error: GpuError) {
    fault.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
}

fn from_wgpu_error(adapter: &str, error: &wgpu::Error) -> GpuError {
    let adapter = adapter.to_owned();
    match error {
        wgpu::Error::OutOfMemory { .. } => GpuError::OutOfMemory { adapter },
        wgpu::Error::Validation { description, .. } | wgpu::Error::Internal { description, .. } => {
            GpuError::Refused {
                adapter,
                reason: description.split_whitespace().collect::<Vec<_>>().join(" "),
            }
        }
    }
}

fn first_line(text: &str) -> String {
    text.lines().next().unwrap_or_default().to_owned()
}

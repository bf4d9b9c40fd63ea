//! The graphics device: its adapter, its limits, and its errors.
//!
//! In: whether a software adapter will do. Out: a [`Gpu`] ready to draw, which all renderers of the
//! process share, or a [`GpuError`] that says what to do. Errors of the device do not panic: those
//! that no call returns are recorded, and [`Gpu::fault`] returns the first one.

use std::sync::{Arc, Mutex, PoisonError};

use crate::GpuError;
use wgpu::{Backends, DeviceType, Instance, InstanceDescriptor, RequestAdapterOptions};

/// A graphics device with its name and its first error.
#[derive(Clone, Debug)]
pub struct Gpu {
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    name: String,
    /// Whether the adapter computes on the processor.
    pub(super) is_software: bool,
    fault: Arc<Mutex<Option<GpuError>>>,
}

/// The device that all renderers of the process share. Opening one takes a second, and drivers of graphics
/// cards hung where eight and more were open at once.
static SHARED: Mutex<Option<Gpu>> = Mutex::new(None);
/// Held while a device is opened: drivers are silenced for the whole process meanwhile.
static OPENING: Mutex<()> = Mutex::new(());

/// Formats that the passes render to, and the usages they need.
const TARGETS: [(wgpu::TextureFormat, wgpu::TextureUsages); 3] = [
    (super::LIGHT, wgpu::TextureUsages::RENDER_ATTACHMENT),
    (super::MOMENTS, wgpu::TextureUsages::RENDER_ATTACHMENT),
    (super::DEPTH, wgpu::TextureUsages::RENDER_ATTACHMENT),
];

impl Gpu {
    /// The process' device on the fastest adapter. One that computes on the CPU is accepted only if
    /// `software` is set. An error of the device ends all renderers that draw with it. The next call
    /// opens a new one.
    ///
    /// # Errors
    /// No adapter, or one that refuses a device or lacks a capability.
    pub fn find(software: bool) -> Result<Self, GpuError> {
        let mut shared = SHARED.lock().unwrap_or_else(PoisonError::into_inner);
        let gpu = match shared.take().filter(|gpu| gpu.fault().is_ok()) {
            Some(gpu) => gpu,
            None => Self::alone(software)?,
        };
        let gpu = shared.insert(gpu);
        if gpu.is_software && !software { Err(GpuError::NoAdapter) } else { Ok(gpu.clone()) }
    }

    /// A device of its own on the fastest adapter.
    pub(super) fn alone(software: bool) -> Result<Self, GpuError> {
        let _one = OPENING.lock().unwrap_or_else(PoisonError::into_inner);
        #[cfg(unix)]
        let _silent = super::silence::SilentStderr::begin();
        let mut descriptor = InstanceDescriptor::new_without_display_handle();
        descriptor.backends = Backends::PRIMARY | Backends::GL;
        let instance = Instance::new(descriptor.with_env());
        let options = RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            ..RequestAdapterOptions::default()
        };
        let adapter = pollster::block_on(instance.request_adapter(&options))
            .map_err(|_none| GpuError::NoAdapter)?;
        // A software adapter is slower than ray tracing on the CPU.
        if !software && adapter.get_info().device_type == DeviceType::Cpu {
            return Err(GpuError::NoAdapter);
        }
        Self::open(&adapter)
    }

    /// Opens a device with all limits of its adapter. With wgpu's defaults, large fabrics would
    /// need more pages.
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

    /// Uses a device that a window has opened.
    ///
    /// # Errors
    /// An adapter that lacks a capability.
    pub fn on(
        adapter: &wgpu::Adapter,
        device: wgpu::Device,
        queue: wgpu::Queue,
    ) -> Result<Self, GpuError> {
        let name = adapter.get_info().name;
        if let Some(lacking) = missing_capability(adapter, &device) {
            return Err(GpuError::Lacking { adapter: name, lacking });
        }
        let is_software = adapter.get_info().device_type == DeviceType::Cpu;
        let gpu = Self { device, queue, name, is_software, fault: Arc::default() };
        // Both callbacks outlive this function, so each owns its handles.
        let (fault, adapter) = (Arc::clone(&gpu.fault), gpu.name.clone());
        gpu.device.on_uncaptured_error(Arc::new(move |error| {
            record_fault(&fault, from_wgpu_error(&adapter, &error));
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

    /// A buffer with these contents, whose length must be a multiple of four. wgpu's helper
    /// `create_buffer_init` panics if the device refuses; here [`Gpu::fault`] reports it.
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

    /// Fails with the first error so far, if there was one.
    pub(super) fn fault(&self) -> Result<(), GpuError> {
        match &*self.fault.lock().unwrap_or_else(PoisonError::into_inner) {
            Some(error) => Err(error.clone()),
            None => Ok(()),
        }
    }

    /// Waits until all submitted work is done.
    pub(super) fn wait(&self) -> Result<(), GpuError> {
        // Recorded errors come first, because they explain why waiting failed.
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

/// A capability that drawing needs and the adapter lacks.
fn missing_capability(adapter: &wgpu::Adapter, device: &wgpu::Device) -> Option<String> {
    // Vertices are expanded from storage buffers in the vertex shader.
    let downlevel = adapter.get_downlevel_capabilities().flags;
    if !downlevel.contains(wgpu::DownlevelFlags::VERTEX_STORAGE)
        || device.limits().max_storage_buffers_per_shader_stage < 6
    {
        return Some("storage buffers for vertices".to_owned());
    }
    let (format, _) = TARGETS.iter().find(|(format, usages)| {
        !adapter.get_texture_format_features(*format).allowed_usages.contains(*usages)
    })?;
    Some(format!("targets of {format:?}, which Vulkan, Metal and DirectX 12 drivers have"))
}

/// Keeps the first error, because later ones are its consequences.
fn record_fault(fault: &Mutex<Option<GpuError>>, error: GpuError) {
    fault.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
}

/// Converts an error that no call returned.
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

/// The first line of a driver's message.
fn first_line(text: &str) -> String {
    text.lines().next().unwrap_or_default().to_owned()
}

#[cfg(test)]
mod tests {
    use super::super::parity::{adapter, adapter_to_break};
    use super::*;

    #[test]
    fn renderers_share_a_device_that_works() {
        let test = "renderers_share_a_device_that_works";
        let (Some(gpu), Some(broken)) = (adapter(test), adapter_to_break(test)) else { return };
        record_fault(&broken.fault, GpuError::NoAdapter);
        let is_same = |one: &Gpu, other: &Gpu| Arc::ptr_eq(&one.fault, &other.fault);
        assert!(is_same(&gpu, &Gpu::find(true).unwrap()) && !is_same(&gpu, &broken));
        *SHARED.lock().unwrap() = Some(broken.clone());
        let next = Gpu::find(true).unwrap();
        assert!(!is_same(&next, &broken) && next.fault().is_ok());
    }
}

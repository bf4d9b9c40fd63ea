//! `warpknit view`: a garment or a swatch in a window, knitted again whenever a setting changes.
//!
//! In: the arguments of `drape`, or the size of a swatch. Out: a window until it is closed.
//! [`cloth_source`] is the source of cloth, [`worker`] knits on a thread of its own, [`canvas`]
//! renders, [`orbit`] is the camera, [`panel`] has the settings, and [`window`] joins them.

mod canvas;
mod cloth_source;
mod orbit;
mod panel;
mod window;
mod worker;

use std::sync::Arc;
use std::sync::mpsc::channel;

use anyhow::{Result, anyhow, bail};
use eframe::egui::ViewportBuilder;
use eframe::egui_wgpu::{WgpuConfiguration, WgpuSetup, WgpuSetupCreateNew};
use eframe::{NativeOptions, wgpu};
use warpknit::render::RendererChoice;

use super::args::Live;
use super::terminal::Terminal;
use cloth_source::ClothSource;
use warpknit::pipeline::{Listener as _, Task};
use window::Window;

/// The window's name.
const TITLE: &str = "warpknit";
/// Its size at first, points.
const SIZE: [f32; 2] = [1280.0, 800.0];

/// Opens the window, and returns when it is closed.
pub(crate) fn view(arguments: Live) -> Result<()> {
    let shared = &arguments.shared;
    if let Some((path, _)) = shared.outputs.first() {
        bail!(
            "{}: view writes no files but pictures, by its button or --screenshot; \
             drape and swatch do",
            path.display()
        );
    }
    if shared.drawing.turntable.is_some() {
        bail!(
            "--turntable writes pictures, and view shows cloth that you turn yourself: \
             drape and swatch take it"
        );
    }
    if RendererChoice::from(shared.drawing.renderer) == RendererChoice::Cpu {
        bail!(
            "--renderer cpu can't follow a drag: view draws on the graphics adapter, \
             be it one of software"
        );
    }
    if shared.eye.is_some() && shared.eye == shared.look_at {
        bail!("--eye and --look-at are the same point: there is no direction to look in");
    }
    let terminal = Terminal::begin_command(&shared.running)?;
    terminal.begin(Task::Read, 0.0);
    let source = Arc::new(ClothSource::from_arguments(&arguments)?);
    terminal.clear();
    let (failures, failed) = channel();
    let arguments = Arc::new(arguments);
    let open = |context: &eframe::CreationContext<'_>| match Window::new(
        context, arguments, source, failures,
    ) {
        Ok(window) => Ok(Box::new(window) as Box<dyn eframe::App>),
        Err(error) => Err(error.into()),
    };
    eframe::run_native(TITLE, native_options(), Box::new(open)).map_err(in_words)?;
    match failed.try_recv() {
        Ok(error) => Err(error),
        Err(_none) => Ok(()),
    }
}

/// Options of a window on the fastest adapter, with all the limits that the adapter has. The
/// default limits are those of a web page, and too low for the buffers of yarns.
fn native_options() -> NativeOptions {
    let mut setup = WgpuSetupCreateNew::without_display_handle();
    setup.power_preference = wgpu::PowerPreference::HighPerformance;
    setup.device_descriptor = Arc::new(|adapter| wgpu::DeviceDescriptor {
        label: Some(TITLE),
        required_limits: adapter.limits(),
        ..wgpu::DeviceDescriptor::default()
    });
    NativeOptions {
        viewport: ViewportBuilder::default()
            .with_title(TITLE)
            .with_app_id(TITLE)
            .with_inner_size(SIZE),
        wgpu_options: WgpuConfiguration {
            wgpu_setup: WgpuSetup::CreateNew(setup),
            ..WgpuConfiguration::default()
        },
        ..NativeOptions::default()
    }
}

/// An error of the window library with a remedy.
fn in_words(error: eframe::Error) -> anyhow::Error {
    match error {
        eframe::Error::Wgpu(reason) => {
            let reason = reason.to_string();
            let reason = reason.trim_end_matches(": {}");
            anyhow!(
                "no graphics adapter can draw into a window ({reason}): install a Vulkan, Metal or \
                 DirectX 12 driver; drape and swatch draw without one"
            )
        }
        eframe::Error::AppCreation(error) => anyhow!("{error:#}"),
        other => {
            // The message begins with a place in the window library's source, which says nothing to
            // a user.
            let reason = other.to_string();
            let reason = reason.rsplit(": ").next().unwrap_or_default();
            anyhow!(
                "no window can be opened here ({reason}): check that there is a display; \
                 drape and swatch draw without one"
            )
        }
    }
}

//! The window: joins panel, camera, knitting thread and renderer, frame by frame.
//!
//! In: the user's input. Out: the picture, and saved pictures. An error is shown in the panel and
//! the window stays open, except that a `--screenshot` that can't be made closes it.

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::Sender;
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail};
use eframe::egui::{
    self, CentralPanel, Color32, ColorImage, Frame, Key, Panel, PointerButton, Rect, Response,
    ScrollArea, Sense, Ui, ViewportCommand, pos2,
};
use image::RgbaImage;
use warpknit::export::png;
use warpknit::render::View;

use super::super::args::Live;
use super::super::values::MOST_PIXELS;
use super::canvas::{FrameRenderer, FrameRequest};
use super::cloth_source::{ClothSource, KnittedScene, Recipe};
use super::orbit::Orbit;
use super::panel::{self, Action, ClothSummary, PanelSettings, VIEWS};
use super::worker::Worker;

/// Time after the last change after which the picture counts as still and a full frame is drawn. It
/// grows with the time of a full frame, which would delay the next drag.
const STILL_AFTER: RangeInclusive<Duration> =
    Duration::from_millis(150)..=Duration::from_millis(800);
/// Logarithm of the magnification for each point of the wheel's travel.
const WHEEL: f64 = 1.0 / 250.0;
/// Width of the panel, points.
const PANEL_WIDTH: f32 = 330.0;

/// The framing that the camera keeps until the user drags it. It is applied again to each new cloth
/// and each size of the window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Framing {
    /// As the command line asks.
    Start,
    /// One of the six views.
    Side(View),
    /// Everything in sight, from the present direction.
    All,
}

/// The window's state.
pub(super) struct Window {
    source: Arc<ClothSource>,
    arguments: Arc<Live>,
    settings: PanelSettings,
    worker: Worker,
    renderer: FrameRenderer,
    orbit: Orbit,
    framing: Option<Framing>,
    aspect: f64,
    /// The last recipe that was ordered.
    ordered: Recipe,
    cloth: Option<KnittedScene>,
    /// Segments of a stitch in the scene on the device.
    uploaded_st: u32,
    upload_time: Duration,
    /// The last error, for the panel.
    error: Option<String>,
    saved: Option<String>,
    last: Option<FrameRequest>,
    changed: Instant,
    /// Takes the error if the window is only opened for a screenshot and fails.
    failures: Sender<anyhow::Error>,
    screenshot: Option<PathBuf>,
}

impl Window {
    pub(super) fn new(
        context: &eframe::CreationContext<'_>,
        arguments: Arc<Live>,
        source: Arc<ClothSource>,
        failures: Sender<anyhow::Error>,
    ) -> Result<Self> {
        let Some(state) = &context.wgpu_render_state else {
            bail!("the window has no graphics device")
        };
        let renderer = FrameRenderer::open(state)
            .context("a window needs a graphics adapter, drape and swatch do not")?;
        let waker = context.egui_ctx.clone();
        // egui draws only on input, so the worker has to wake it when cloth is ready.
        let worker = Worker::start(Arc::clone(&source), move || waker.request_repaint())?;
        let settings = PanelSettings::from_arguments(&arguments.shared, &source);
        worker.order(settings.recipe);
        Ok(Self {
            orbit: start(&arguments, &[], 1.0),
            framing: Some(Framing::Start),
            aspect: 1.0,
            ordered: settings.recipe,
            cloth: None,
            uploaded_st: 0,
            upload_time: Duration::ZERO,
            error: None,
            saved: None,
            last: None,
            changed: Instant::now(),
            screenshot: arguments.screenshot.clone(),
            failures,
            source,
            arguments,
            settings,
            worker,
            renderer,
        })
    }

    /// Orders or uploads the cloth again after a change of settings.
    fn follow_settings(&mut self) {
        if self.settings.recipe != self.ordered {
            self.ordered = self.settings.recipe;
            self.worker.order(self.ordered);
            self.changed = Instant::now();
        }
        if self.settings.rendering.st != self.uploaded_st {
            self.upload();
        }
    }

    /// Takes new cloth from the thread and uploads it.
    fn take_cloth(&mut self) {
        match self.worker.take() {
            None => {}
            Some(Ok(cloth)) => {
                self.cloth = Some(cloth);
                self.error = None;
                self.upload();
                self.frame_again();
            }
            Some(Err(error)) => self.error = Some(format!("{error:#}")),
        }
    }

    /// Uploads the present cloth to the device.
    fn upload(&mut self) {
        let Some(cloth) = &self.cloth else { return };
        self.uploaded_st = self.settings.rendering.st;
        let start = Instant::now();
        let result = self.renderer.upload(&cloth.scene, self.uploaded_st);
        self.upload_time = start.elapsed();
        self.note(result);
    }

    /// Keeps an error for the panel.
    fn note<T>(&mut self, result: Result<T, impl Into<anyhow::Error>>) {
        if let Err(error) = result {
            self.error = Some(format!("{:#}", error.into()));
        }
    }

    /// Applies the framing again, unless the user has moved the camera since.
    fn frame_again(&mut self) {
        let points = self.cloth.as_ref().map_or(&[][..], |cloth| &cloth.scene.positions);
        let fov = self.arguments.shared.fov.to_radians();
        self.orbit = match self.framing {
            _ if points.is_empty() => return,
            None => return,
            Some(Framing::Start) => start(&self.arguments, points, self.aspect),
            Some(Framing::Side(view)) => Orbit::framing(view, points, fov, 1.0, self.aspect),
            Some(Framing::All) => self.orbit.framed(points, self.aspect),
        };
    }

    /// Does what a button or a key asks for.
    fn act(&mut self, action: Action) {
        let framing = match action {
            Action::SavePicture => return self.save_picture(),
            Action::ViewFrom(view) => Framing::Side(view),
            Action::FrameAll => Framing::All,
            Action::ResetCamera => Framing::Start,
        };
        self.framing = Some(framing);
        self.frame_again();
    }

    /// Saves the picture in the window, with the height of `--size` and the window's aspect ratio.
    fn save_picture(&mut self) {
        match self.try_save() {
            Ok(name) => self.saved = Some(format!("saved {}", name.display())),
            Err(error) => self.error = Some(format!("{error:#}")),
        }
    }

    fn try_save(&mut self) -> Result<PathBuf> {
        let shared = &self.arguments.shared;
        let height = shared.size.1;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "`as` saturates, and the size is held to a limit"
        )]
        let width = ((f64::from(height) * self.aspect).round() as u32).clamp(1, MOST_PIXELS);
        let options = self.settings.rendering.options_to_save([width, height], shared.drawing.spp);
        let picture = self
            .renderer
            .picture(&self.orbit.camera(), &options)?
            .context("there is no picture to save yet")?;
        let name = free_name()?;
        write(&name, &picture)?;
        Ok(name)
    }

    /// Moves the camera by the input of pointer and keys over the picture.
    fn steer(&mut self, ui: &Ui, response: &Response) {
        let (moved, height) = (response.drag_delta(), response.rect.height());
        let before = self.orbit;
        if response.dragged_by(PointerButton::Primary) {
            self.orbit.turn(moved.x, moved.y);
        } else if response.dragged_by(PointerButton::Secondary)
            || response.dragged_by(PointerButton::Middle)
        {
            self.orbit.shift(moved.x, moved.y, height);
        }
        if response.hovered() {
            let (wheel, pinch) =
                ui.input(|input| (input.smooth_scroll_delta().y, input.zoom_delta()));
            // Exponential: equal travel magnifies by an equal factor, and back again exactly.
            self.orbit.magnify((f64::from(wheel) * WHEEL).exp() * f64::from(pinch));
        }
        // From now on the camera belongs to the user.
        if self.orbit != before {
            self.framing = None;
        }
        if !ui.ctx().egui_wants_keyboard_input() {
            let keys = [Key::Num1, Key::Num2, Key::Num3, Key::Num4, Key::Num5, Key::Num6];
            let pressed = keys
                .into_iter()
                .zip(VIEWS)
                .find(|(key, _)| ui.input(|input| input.key_pressed(*key)));
            if let Some((_, (_, view))) = pressed {
                self.act(Action::ViewFrom(view));
            }
            if ui.input(|input| input.key_pressed(Key::F)) {
                self.act(Action::FrameAll);
            }
        }
    }

    /// Shows the picture in the room that the panel leaves.
    fn show_picture(&mut self, ui: &mut Ui) {
        let (rect, response) = ui.allocate_exact_size(ui.available_size(), Sense::click_and_drag());
        let scale = ui.ctx().pixels_per_point();
        let most = self.renderer.largest_side().saturating_sub(2);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "`as` saturates, and a window has few pixels"
        )]
        let size = [rect.width(), rect.height()]
            .map(|side| ((side * scale).round() as u32).clamp(1, most));
        let aspect = f64::from(size[0]) / f64::from(size[1]);
        // Framing depends on the aspect ratio, so it is applied again.
        if aspect != self.aspect {
            self.aspect = aspect;
            self.frame_again();
        }
        self.steer(ui, &response);
        if self.cloth.is_some() {
            self.draw(ui, size);
        }
        if let Some(texture) = self.renderer.texture() {
            ui.painter().image(
                texture,
                rect,
                Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0)),
                Color32::WHITE,
            );
        }
    }

    /// Draws a frame if anything changed, on a slow device first as a draft.
    fn draw(&mut self, ui: &Ui, size: [u32; 2]) {
        let shot =
            FrameRequest { camera: self.orbit.camera(), rendering: self.settings.rendering, size };
        let now = Instant::now();
        if self.last != Some(shot) || ui.input(|input| input.pointer.any_down()) {
            self.changed = now;
        }
        self.last = Some(shot);
        let still_after = (self.renderer.full / 4).clamp(*STILL_AFTER.start(), *STILL_AFTER.end());
        // A screenshot waits for the full frame, so it needs no drafts.
        let moves = self.screenshot.is_none() && now.duration_since(self.changed) < still_after;
        let drawn = self.renderer.draw(shot, moves);
        if matches!(drawn, Ok(true)) {
            // The panel was laid out before this frame: another pass shows this frame's time.
            ui.ctx().request_repaint();
        }
        self.note(drawn);
        if self.renderer.is_draft() {
            ui.ctx().request_repaint_after(still_after);
        }
    }

    fn summary(&self) -> ClothSummary {
        let mut lines = vec![("adapter", self.renderer.adapter())];
        let mut notes: Vec<String> = self.saved.clone().into_iter().collect();
        if let Some(cloth) = &self.cloth {
            let timings = cloth.timings;
            lines.push(("stitches", thousands(cloth.totals.losses.stitches)));
            lines.push(("yarns", thousands(cloth.totals.yarns)));
            lines.push(("knit", ms(timings.knit)));
            lines.push(("locate and map", ms(timings.locate + timings.map)));
            lines.push(("upload", duration_ms(self.upload_time)));
            let draft = if self.renderer.draft.is_zero() {
                String::new()
            } else {
                format!(", draft {}", duration_ms(self.renderer.draft))
            };
            lines.push(("frame", duration_ms(self.renderer.full) + &draft));
            if cloth.enlargement > 1.0 {
                notes.push(format!("The cloth is drawn {:.1} times enlarged.", cloth.enlargement));
            }
            notes.extend(cloth.warnings.iter().map(|warning| format!("warning: {warning}")));
        }
        let radius = self.cloth.as_ref().map_or(0.0, |cloth| cloth.radius);
        ClothSummary {
            lines,
            notes,
            error: self.error.clone(),
            is_knitting: self.worker.is_busy(),
            radius,
        }
    }

    /// For `--screenshot`: takes a picture of the window once the cloth is drawn in full, or closes
    /// the window after an error.
    fn take_screenshot(&mut self, context: &egui::Context) {
        let Some(target) = self.screenshot.clone() else { return };
        if let Some(error) = self.error.take() {
            // The other end lives as long as the window.
            let _sent = self.failures.send(anyhow::anyhow!(error));
            self.screenshot = None;
            context.send_viewport_cmd(ViewportCommand::Close);
        } else if self.cloth.is_some() && !self.worker.is_busy() && !self.renderer.is_draft() {
            self.screenshot = None;
            let (failures, waker) = (self.failures.clone(), context.clone());
            context.request_screenshot(move |image| {
                if let Err(error) = write(&target, &picture_of(&image)) {
                    let _sent = failures.send(error);
                }
                waker.send_viewport_cmd(ViewportCommand::Close);
            });
        }
    }
}

impl eframe::App for Window {
    fn ui(&mut self, ui: &mut Ui, _frame: &mut eframe::Frame) {
        self.take_cloth();
        let summary = self.summary();
        let action = Panel::right("settings")
            .exact_size(PANEL_WIDTH)
            .show(ui, |ui| {
                let scrolled = ScrollArea::vertical().auto_shrink(false);
                scrolled
                    .show(ui, |ui| panel::show(ui, &mut self.settings, &self.source, &summary))
                    .inner
            })
            .inner;
        if let Some(action) = action {
            self.act(action);
        }
        self.follow_settings();
        CentralPanel::default().frame(Frame::NONE).show(ui, |ui| self.show_picture(ui));
        self.take_screenshot(ui.ctx());
    }
}

/// The camera that the command line asks for.
fn start(arguments: &Live, points: &[glam::Vec3], aspect: f64) -> Orbit {
    let shared = &arguments.shared;
    let fov = shared.fov.to_radians();
    match (shared.eye, shared.look_at) {
        (Some(eye), Some(target)) => Orbit::at(eye, target, fov, shared.zoom),
        _ => Orbit::framing(shared.view.into(), points, fov, shared.zoom, aspect),
    }
}

/// The first of `view-001.png`, `view-002.png` … that doesn't exist.
fn free_name() -> Result<PathBuf> {
    let mut names = (1..1000).map(|number| PathBuf::from(format!("view-{number:03}.png")));
    names
        .find(|name| !name.exists())
        .context("view-001.png to view-999.png are there already: move some")
}

/// Writes a picture; the file appears when it is complete.
fn write(target: &Path, picture: &RgbaImage) -> Result<()> {
    Ok(png::write(target, picture)?.publish()?)
}

/// A screenshot of egui as an opaque picture.
fn picture_of(image: &ColorImage) -> RgbaImage {
    let pixels =
        image.pixels.iter().flat_map(|pixel| [pixel.r(), pixel.g(), pixel.b(), 255]).collect();
    let [width, height] = image.size.map(warpknit::ids::index32);
    RgbaImage::from_raw(width, height, pixels).expect("four bytes a pixel")
}

/// Milliseconds as text.
fn ms(ms: f64) -> String {
    format!("{ms:.0} ms")
}

/// A duration as text.
fn duration_ms(duration: Duration) -> String {
    ms(1000.0 * duration.as_secs_f64())
}

/// A number with a space between groups of three digits.
fn thousands(number: usize) -> String {
    let digits = number.to_string();
    let groups: Vec<_> = digits.as_bytes().rchunks(3).rev().map(String::from_utf8_lossy).collect();
    groups.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_set_in_threes() {
        assert_eq!(
            [0, 12, 999, 12_948, 1_000_000].map(thousands),
            ["0", "12", "999", "12 948", "1 000 000"]
        );
    }
}

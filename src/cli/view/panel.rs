//! The panel beside the picture: all settings, and a summary of the cloth.
//!
//! In: [`PanelSettings`], which it changes, and the [`ClothSummary`] to show. Out: an [`Action`]
//! where a button was pressed.

use eframe::egui::{
    Button, CollapsingHeader, Color32, ComboBox, Grid, RichText, Slider, SliderClamping, TextStyle,
    Ui, vec2,
};
use glam::Vec3;
use warpknit::render::scene::Shape;
use warpknit::render::{self, Background, Light, View};

use super::super::args::Shared;
use super::cloth_source::{ClothSource, Recipe};

/// The views with their names, in the order of the keys 1 to 6.
pub(super) const VIEWS: [(&str, View); 6] = [
    ("Front", View::Front),
    ("Back", View::Back),
    ("Left", View::Left),
    ("Right", View::Right),
    ("Top", View::Top),
    ("Corner", View::Iso),
];

/// Lines that the longest description of a built-in fabric takes.
const ABOUT_LINES: f32 = 3.0;

/// The largest radius of the slider, mm at one wale a cm: 0.3 of the wale spacing, at which the
/// legs of a loop fill it.
const WIDEST: f64 = 3.0;

/// All settings.
pub(super) struct PanelSettings {
    pub(super) recipe: Recipe,
    pub(super) rendering: RenderSettings,
    /// Whether wales and courses change together.
    keeps_loops: bool,
}

/// Settings of drawing. A change of them needs no new cloth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RenderSettings {
    /// Segments of a stitch (St).
    pub(super) st: u32,
    /// Edges of a tube's section (Sr).
    sr: u32,
    lod: bool,
    /// Direction of the sun to the right of the camera, degrees.
    sun_azimuth: f32,
    /// Direction of the sun above the camera, degrees.
    sun_height: f32,
    /// Strength of the sun, as a factor of the default.
    sun: f32,
    /// Strength of the sky, as a factor of the default.
    sky: f32,
    background: [u8; 3],
    /// Whether saved pictures have a transparent background.
    cut_out: bool,
}

/// What a button or a key asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Action {
    SavePicture,
    ViewFrom(View),
    FrameAll,
    ResetCamera,
}

/// The summary of the cloth and the messages that the panel shows.
pub(super) struct ClothSummary {
    /// Names and values.
    pub(super) lines: Vec<(&'static str, String)>,
    pub(super) notes: Vec<String>,
    pub(super) error: Option<String>,
    pub(super) is_knitting: bool,
    /// The drawn radius, mm.
    pub(super) radius: f64,
}

impl PanelSettings {
    /// The settings that the command line asks for.
    pub(super) fn from_arguments(shared: &Shared, source: &ClothSource) -> Self {
        let recipe = Recipe { radius: shared.radius, ..source.recipe(0) };
        Self {
            recipe,
            rendering: RenderSettings::from_arguments(shared),
            keeps_loops: shared.wales_per_cm.is_none() || shared.courses_per_cm.is_none(),
        }
    }
}

impl RenderSettings {
    fn from_arguments(shared: &Shared) -> Self {
        let defaults = render::RenderOptions::default();
        let sun = shared.sun.map_or(defaults.light.sun_direction, |sun| sun.as_vec3()).normalize();
        let background = shared.background.unwrap_or_default();
        Self {
            st: shared.st.unwrap_or(defaults.st),
            sr: shared.sr.unwrap_or(defaults.sr),
            lod: shared.drawing.lod.is_on(),
            sun_azimuth: sun.x.atan2(sun.z).to_degrees(),
            sun_height: sun.y.asin().to_degrees(),
            sun: 1.0,
            sky: 1.0,
            background: if let Background::Color(color) = background { color } else { [255; 3] },
            cut_out: background == Background::Transparent,
        }
    }

    /// The renderer's options for a picture of so many pixels and samples a pixel. The window's
    /// background is always opaque.
    pub(super) fn options(&self, [width, height]: [u32; 2], samples: u32) -> render::RenderOptions {
        render::RenderOptions {
            width,
            height,
            samples,
            spp: samples,
            st: self.st,
            sr: self.sr,
            lod: self.lod,
            light: self.light(),
            background: Background::Color(self.background),
            ..render::RenderOptions::default()
        }
    }

    /// The renderer's options for a picture that is saved.
    pub(super) fn options_to_save(&self, size: [u32; 2], spp: u32) -> render::RenderOptions {
        let options = self.options(size, 4);
        let background = if self.cut_out { Background::Transparent } else { options.background };
        render::RenderOptions { background, spp, ..options }
    }

    /// The light in camera space: azimuth and height are spherical coordinates.
    fn light(&self) -> Light {
        let usual = Light::default();
        let (azimuth, height) = (self.sun_azimuth.to_radians(), self.sun_height.to_radians());
        let level = height.cos();
        Light {
            sun_direction: Vec3::new(azimuth.sin() * level, height.sin(), azimuth.cos() * level),
            sun: usual.sun * self.sun,
            sky_above: usual.sky_above * self.sky,
            sky_below: usual.sky_below * self.sky,
            ..usual
        }
    }
}

/// Shows the panel. Returns the action of a pressed button.
pub(super) fn show(
    ui: &mut Ui,
    settings: &mut PanelSettings,
    source: &ClothSource,
    summary: &ClothSummary,
) -> Option<Action> {
    ui.spacing_mut().slider_width = 130.0;
    ui.add_space(6.0);
    fabric(ui, settings, source);
    ui.separator();
    yarns(ui, settings, summary.radius);
    ui.separator();
    CollapsingHeader::new("Light and background")
        .default_open(true)
        .show(ui, |ui| light(ui, &mut settings.rendering));
    ui.separator();
    let action = camera(ui);
    ui.separator();
    show_summary(ui, summary);
    action
}

/// The choice of the fabric and its densities.
fn fabric(ui: &mut Ui, settings: &mut PanelSettings, source: &ClothSource) {
    let recipe = &mut settings.recipe;
    let before = recipe.fabric;
    ui.horizontal(|ui| {
        ui.label("Fabric");
        ComboBox::from_id_salt("fabric")
            .selected_text(&*source.choices[before].label)
            .width(200.0)
            .truncate()
            .height(400.0)
            .show_ui(ui, |ui| {
                for (at, choice) in source.choices.iter().enumerate() {
                    ui.selectable_value(&mut recipe.fabric, at, &*choice.label)
                        .on_hover_text(&choice.fabric.about);
                }
            });
    });
    if recipe.fabric != before {
        // Another fabric has its own densities, and a radius chosen for the last one would seldom
        // suit it.
        *recipe = Recipe { shape: recipe.shape, ..source.recipe(recipe.fabric) };
    }
    let about =
        Some(source.choices[recipe.fabric].fabric.about.as_str()).filter(|about| !about.is_empty());
    // The description takes the same room for all fabrics, so that the sliders below don't move.
    ui.allocate_ui(vec2(ui.available_width(), 0.0), |ui| {
        ui.set_min_height(ABOUT_LINES * ui.text_style_height(&TextStyle::Body));
        ui.label(RichText::new(about.unwrap_or("a fabric of your own")).weak());
    });
    // Changing one density changes the other in proportion, unless the box is cleared.
    let aspect = recipe.courses_per_cm / recipe.wales_per_cm;
    if density(ui, "wales per cm", &mut recipe.wales_per_cm) && settings.keeps_loops {
        recipe.courses_per_cm = recipe.wales_per_cm * aspect;
    }
    if density(ui, "courses per cm", &mut recipe.courses_per_cm) && settings.keeps_loops {
        recipe.wales_per_cm = recipe.courses_per_cm / aspect;
    }
    ui.checkbox(&mut settings.keeps_loops, "loops keep their shape")
        .on_hover_text("wales and courses change together");
}

/// A slider for a density. Returns whether it was changed.
fn density(ui: &mut Ui, label: &str, value: &mut f64) -> bool {
    let slider = Slider::new(value, 0.2..=40.0)
        .logarithmic(true)
        .max_decimals(2)
        .clamping(SliderClamping::Edits);
    ui.add(slider.text(label)).changed()
}

/// The settings of the yarns: shape, radius, segments.
fn yarns(ui: &mut Ui, settings: &mut PanelSettings, radius: f64) {
    let PanelSettings { recipe, rendering, .. } = settings;
    ui.horizontal(|ui| {
        ui.label("Yarns as");
        ui.selectable_value(&mut recipe.shape, Shape::Tube, "tubes");
        ui.selectable_value(&mut recipe.shape, Shape::Ribbon, "ribbons");
    });
    // `None` is the radius from the yarn's count; clearing the box starts from the drawn radius.
    let mut own = recipe.radius.is_none();
    ui.checkbox(&mut own, "radius from the yarn's count");
    if own {
        recipe.radius = None;
    }
    let mut chosen = recipe.radius.unwrap_or(radius);
    let slider = Slider::new(&mut chosen, 0.005..=(WIDEST / recipe.wales_per_cm).max(0.01));
    let slider =
        slider.logarithmic(true).max_decimals(3).clamping(SliderClamping::Edits).suffix(" mm");
    ui.add_enabled(!own, slider.text("radius"));
    if !own {
        recipe.radius = Some(chosen);
    }
    ui.add(
        Slider::new(&mut rendering.st, 1..=40)
            .clamping(SliderClamping::Edits)
            .text("pieces a stitch (St)"),
    );
    // A ribbon has no section.
    ui.add_enabled_ui(recipe.shape == Shape::Tube, |ui| {
        ui.add(
            Slider::new(&mut rendering.sr, 3..=24)
                .clamping(SliderClamping::Edits)
                .text("edges of a tube (Sr)"),
        );
    });
    ui.checkbox(&mut rendering.lod, "far yarns are coarser");
}

/// The settings of light and background.
fn light(ui: &mut Ui, rendering: &mut RenderSettings) {
    let degrees = |value, range| Slider::new(value, range).max_decimals(0).suffix("°");
    ui.add(degrees(&mut rendering.sun_azimuth, -180.0..=180.0).text("sun, left to right"));
    ui.add(degrees(&mut rendering.sun_height, -90.0..=90.0).text("sun, height"));
    ui.add(Slider::new(&mut rendering.sun, 0.0..=3.0).max_decimals(2).text("sun, strength"));
    ui.add(Slider::new(&mut rendering.sky, 0.0..=3.0).max_decimals(2).text("sky, strength"));
    ui.horizontal(|ui| {
        ui.color_edit_button_srgb(&mut rendering.background);
        ui.label("background");
        ui.checkbox(&mut rendering.cut_out, "none in files")
            .on_hover_text("saved pictures are transparent where no yarn is");
    });
}

/// The buttons of the camera and for saving.
fn camera(ui: &mut Ui) -> Option<Action> {
    let mut action = None;
    ui.horizontal(|ui| {
        for (at, (name, view)) in VIEWS.into_iter().enumerate() {
            if ui.button(name).on_hover_text(format!("key {}", at + 1)).clicked() {
                action = Some(Action::ViewFrom(view));
            }
        }
    });
    ui.horizontal(|ui| {
        for (name, hint, own) in [
            ("Frame all", "key F: the same direction, everything in sight", Action::FrameAll),
            ("Reset camera", "as when the window was opened", Action::ResetCamera),
        ] {
            if ui.button(name).on_hover_text(hint).clicked() {
                action = Some(own);
            }
        }
        if ui
            .add(Button::new(RichText::new("Save picture").strong()))
            .on_hover_text("view-001.png and so on, in this folder")
            .clicked()
        {
            action = Some(Action::SavePicture);
        }
    });
    ui.label(RichText::new("Left drag turns, right drag moves, the wheel zooms.").weak());
    action
}

/// The summary of the cloth, and messages.
fn show_summary(ui: &mut Ui, summary: &ClothSummary) {
    if let Some(error) = &summary.error {
        ui.label(RichText::new(error).color(Color32::from_rgb(220, 60, 50)));
    }
    Grid::new("facts").num_columns(2).show(ui, |ui| {
        for (name, value) in &summary.lines {
            ui.label(RichText::new(*name).weak());
            ui.label(value);
            ui.end_row();
        }
    });
    if summary.is_knitting {
        ui.horizontal(|ui| {
            ui.spinner();
            ui.label("knitting");
        });
    }
    for note in &summary.notes {
        ui.label(RichText::new(note).weak());
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser as _;

    use super::*;
    use crate::cli::args::{Arguments, Command};

    #[test]
    fn the_first_look_is_that_of_a_picture() {
        let arguments =
            Arguments::parse_from(["warpknit", "view", "--st", "7", "--background", "#102030"]);
        let Command::View(live) = arguments.command else { panic!("it was asked to view") };
        let (options, usual) = (
            RenderSettings::from_arguments(&live.shared).options([8, 6], 4),
            render::RenderOptions::default(),
        );
        assert!(options.light.sun_direction.angle_between(usual.light.sun_direction) < 1e-3);
        assert_eq!(
            (options.light.sun, options.light.sky_below),
            (usual.light.sun, usual.light.sky_below)
        );
        assert_eq!(
            (options.st, options.sr, options.background),
            (7, usual.sr, Background::Color([16, 32, 48]))
        );
    }
}

//! The panel beside the picture: everything that can be chosen, and what is known of the cloth.
//!
//! In: [`Settings`], which it changes. Out: what was asked for besides, as an [`Action`].

use eframe::egui::{
    Button, CollapsingHeader, Color32, ComboBox, Grid, RichText, Slider, SliderClamping, TextStyle,
    Ui, vec2,
};
use glam::Vec3;
use warpknit::render::{self, Background, Light, View};
use warpknit::scene::Shape;

use super::super::args::Shared;
use super::stock::{Recipe, Stock};

/// Sides by name, in the order of the keys 1 to 6.
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

/// The radius at which the slider ends, mm at one wale a cm: .3 of the wale spacing, where the legs
/// of a loop fill it.
const WIDEST: f64 = 3.0;

/// All that can be chosen.
pub(super) struct Settings {
    pub(super) recipe: Recipe,
    pub(super) look: Look,
    /// Whether wales and courses change together.
    keeps_loops: bool,
}

/// How cloth is drawn; a change of it knits nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Look {
    /// Pieces a stitch.
    pub(super) st: u32,
    sr: u32,
    lod: bool,
    /// Where the sun stands beside the camera, to the right, degrees.
    sun_azimuth: f32,
    /// And above it, degrees.
    sun_height: f32,
    /// Over the usual strength.
    sun: f32,
    sky: f32,
    background: [u8; 3],
    /// Whether saved pictures are without the background.
    cut_out: bool,
}

/// What was asked for besides other settings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Action {
    SavePicture,
    Look(View),
    FrameAll,
    ResetCamera,
}

/// What the panel tells.
pub(super) struct Facts {
    /// Name and number.
    pub(super) lines: Vec<(&'static str, String)>,
    pub(super) notes: Vec<String>,
    pub(super) trouble: Option<String>,
    pub(super) is_knitting: bool,
    /// The drawn radius, mm.
    pub(super) radius: f64,
}

impl Settings {
    /// What the command line asked for.
    pub(super) fn of(shared: &Shared, stock: &Stock) -> Self {
        let recipe = Recipe { radius: shared.radius, ..stock.recipe(0) };
        Self {
            recipe,
            look: Look::of(shared),
            keeps_loops: shared.wales_per_cm.is_none() || shared.courses_per_cm.is_none(),
        }
    }
}

impl Look {
    fn of(shared: &Shared) -> Self {
        let defaults = render::RenderOptions::default();
        let sun = defaults.light.sun_direction.normalize();
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

    /// For a picture of so many pixels and samples a pixel. In the window there is always a colour
    /// behind the yarns.
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

    /// The same for a file.
    pub(super) fn options_to_save(&self, size: [u32; 2], spp: u32) -> render::RenderOptions {
        let options = self.options(size, 4);
        let background = if self.cut_out { Background::Transparent } else { options.background };
        render::RenderOptions { background, spp, ..options }
    }

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

/// Shows the panel.
pub(super) fn show(
    ui: &mut Ui,
    settings: &mut Settings,
    stock: &Stock,
    facts: &Facts,
) -> Option<Action> {
    ui.spacing_mut().slider_width = 130.0;
    ui.add_space(6.0);
    fabric(ui, settings, stock);
    ui.separator();
    yarns(ui, settings, facts.radius);
    ui.separator();
    CollapsingHeader::new("Light and background")
        .default_open(true)
        .show(ui, |ui| light(ui, &mut settings.look));
    ui.separator();
    let action = camera(ui);
    ui.separator();
    tell(ui, facts);
    action
}

fn fabric(ui: &mut Ui, settings: &mut Settings, stock: &Stock) {
    let recipe = &mut settings.recipe;
    let before = recipe.fabric;
    ui.horizontal(|ui| {
        ui.label("Fabric");
        ComboBox::from_id_salt("fabric")
            .selected_text(&*stock.choices[before].label)
            .width(200.0)
            .truncate()
            .height(400.0)
            .show_ui(ui, |ui| {
                for (at, choice) in stock.choices.iter().enumerate() {
                    ui.selectable_value(&mut recipe.fabric, at, &*choice.label)
                        .on_hover_text(&choice.fabric.about);
                }
            });
    });
    if recipe.fabric != before {
        // Another fabric has densities of its own; a radius that was chosen for the last one would
        // seldom suit it.
        *recipe = Recipe { shape: recipe.shape, ..stock.recipe(recipe.fabric) };
    }
    let about =
        Some(stock.choices[recipe.fabric].fabric.about.as_str()).filter(|about| !about.is_empty());
    // As much room for all fabrics, so that sliders stay where they are.
    ui.allocate_ui(vec2(ui.available_width(), 0.0), |ui| {
        ui.set_min_height(ABOUT_LINES * ui.text_style_height(&TextStyle::Body));
        ui.label(RichText::new(about.unwrap_or("a fabric of your own")).weak());
    });
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

/// Whether it was changed.
fn density(ui: &mut Ui, label: &str, value: &mut f64) -> bool {
    let slider = Slider::new(value, 0.2..=40.0)
        .logarithmic(true)
        .max_decimals(2)
        .clamping(SliderClamping::Edits);
    ui.add(slider.text(label)).changed()
}

fn yarns(ui: &mut Ui, settings: &mut Settings, radius: f64) {
    let Settings { recipe, look, .. } = settings;
    ui.horizontal(|ui| {
        ui.label("Yarns as");
        ui.selectable_value(&mut recipe.shape, Shape::Tube, "tubes");
        ui.selectable_value(&mut recipe.shape, Shape::Ribbon, "ribbons");
    });
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
        Slider::new(&mut look.st, 1..=40)
            .clamping(SliderClamping::Edits)
            .text("pieces a stitch (St)"),
    );
    ui.add_enabled_ui(recipe.shape == Shape::Tube, |ui| {
        ui.add(
            Slider::new(&mut look.sr, 3..=24)
                .clamping(SliderClamping::Edits)
                .text("edges of a tube (Sr)"),
        );
    });
    ui.checkbox(&mut look.lod, "far yarns are coarser");
}

fn light(ui: &mut Ui, look: &mut Look) {
    let degrees = |value, range| Slider::new(value, range).max_decimals(0).suffix("°");
    ui.add(degrees(&mut look.sun_azimuth, -180.0..=180.0).text("sun, left to right"));
    ui.add(degrees(&mut look.sun_height, -90.0..=90.0).text("sun, height"));
    ui.add(Slider::new(&mut look.sun, 0.0..=3.0).max_decimals(2).text("sun, strength"));
    ui.add(Slider::new(&mut look.sky, 0.0..=3.0).max_decimals(2).text("sky, strength"));
    ui.horizontal(|ui| {
        ui.color_edit_button_srgb(&mut look.background);
        ui.label("background");
        ui.checkbox(&mut look.cut_out, "none in files")
            .on_hover_text("saved pictures are transparent where no yarn is");
    });
}

fn camera(ui: &mut Ui) -> Option<Action> {
    let mut action = None;
    ui.horizontal(|ui| {
        for (at, (name, view)) in VIEWS.into_iter().enumerate() {
            if ui.button(name).on_hover_text(format!("key {}", at + 1)).clicked() {
                action = Some(Action::Look(view));
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

fn tell(ui: &mut Ui, facts: &Facts) {
    if let Some(trouble) = &facts.trouble {
        ui.label(RichText::new(trouble).color(Color32::from_rgb(220, 60, 50)));
    }
    Grid::new("facts").num_columns(2).show(ui, |ui| {
        for (name, value) in &facts.lines {
            ui.label(RichText::new(*name).weak());
            ui.label(value);
            ui.end_row();
        }
    });
    if facts.is_knitting {
        ui.horizontal(|ui| {
            ui.spinner();
            ui.label("knitting");
        });
    }
    for note in &facts.notes {
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
        let (options, usual) =
            (Look::of(&live.shared).options([8, 6], 4), render::RenderOptions::default());
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

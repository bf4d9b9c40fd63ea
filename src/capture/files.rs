//! The files of a capture, and the layout that a person may have changed.
//!
//! In: [`Captured`] and an [`OutputFolder`]. Out: the [`FILES`] in it, among them the mean cell as
//! a picture along its vectors, nine cells with the segments drawn over them, the texture that
//! tiles,
//! `layout.toml` with the cell and its segments, `layout.svg` with the segments' numbers, and
//! `report.json`. [`GivenLayout::parse`] reads `layout.toml` back.
//!
//! Not promised: a check that a given layout suits the photo; its fit and its warnings tell that.

use std::fs;
use std::path::Path;

use glam::DVec2;
use image::RgbaImage;
use serde::{Deserialize, Serialize};

use super::segment::Segment;
use super::{Captured, CylinderShape, Hypothesis, Twist, sheet};
use crate::chart::svg;
use crate::drape::{self, Cloth, Options, picture, spun, swatch_panel};
use crate::export::spun::SpunWriter;
use crate::export::usda::UsdaWriter;
use crate::export::{ExportError, Output, OutputFolder, Sink, png};
use crate::fabric::Fabric;
use crate::ids::index32;
use crate::plane::{narrow, whole};
use crate::render::{self, Camera, View};
use crate::yarn::fibres::FIBRE_RADIUS;
use crate::yarn::tube::Section;

/// The files of a capture's folder.
pub const FILES: [&str; 10] = [
    "cell.png",
    "texture.png",
    "grid3x3.png",
    "layout.svg",
    "layout.toml",
    "depth.png",
    "fabric.toml",
    "fibres.usda",
    "preview.png",
    "report.json",
];
/// Segments of a given layout, at most.
const MOST_SEGMENTS: usize = 64;
/// The longest segment, in lengths of the cell's longer vector.
const MOST_CELLS: f64 = 10.0;
/// Largest absolute value of lengths and places, pixels.
const MOST_LENGTH: f64 = 16_384.0;
/// Largest absolute value of lightness, in units of the photo's contrast.
const MOST_LIGHT: f64 = 1000.0;

/// Cells of the preview each way.
const PREVIEW_CELLS: f64 = 5.0;
/// Pixels of the preview each way.
const PREVIEW_SIDE: u32 = 640;
/// Field of view of the preview's camera.
const PREVIEW_VIEW: f64 = 0.3;

/// A cell and its segments as a person gives them, pixels of the photo.
#[derive(Clone, Debug, PartialEq)]
pub struct GivenLayout {
    /// Both vectors.
    pub cell: [DVec2; 2],
    /// Lightness of the ground.
    pub ground: f64,
    /// One copy of each, relative to a cell's corner.
    pub segments: Vec<Segment>,
}

/// Why a layout file can't be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {what}")]
pub struct GivenLayoutError {
    /// The line of the file, from 1.
    pub line: usize,
    /// What is wrong there, in one line.
    pub what: String,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct LayoutFile {
    cell: toml::Spanned<CellTable>,
    #[serde(default)]
    segments: Vec<toml::Spanned<SegmentTable>>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CellTable {
    a: [f64; 2],
    b: [f64; 2],
    ground: f64,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SegmentTable {
    center: [f64; 2],
    angle_deg: f64,
    width: f64,
    length: f64,
    top: f64,
    round: f64,
    sag: f64,
    #[serde(default)]
    tilt: f64,
    #[serde(default)]
    bow: f64,
    #[serde(default)]
    sway: f64,
}

impl GivenLayout {
    /// Reads a layout.
    ///
    /// ```
    /// use warpknit::capture::GivenLayout;
    /// let text = "[cell]\na = [20, 0]\nb = [0, 10]\nground = -1\n[[segments]]\n\
    ///     center = [5, 5]\nangle_deg = 90\nwidth = 4\nlength = 9\n\
    ///     top = 1\nround = 0.5\nsag = 0.2\n";
    /// assert_eq!(GivenLayout::parse(text)?.segments.len(), 1);
    /// assert_eq!(GivenLayout::parse("[cell]\na = 3\n").unwrap_err().line, 2);
    /// # Ok::<(), warpknit::capture::GivenLayoutError>(())
    /// ```
    ///
    /// # Errors
    /// [`GivenLayoutError`], with its line.
    pub fn parse(text: &str) -> Result<Self, GivenLayoutError> {
        let file: LayoutFile = toml::from_str(text).map_err(|error| GivenLayoutError {
            line: error.span().map_or(1, |span| line_at(text, span.start)),
            what: error.message().split_whitespace().collect::<Vec<_>>().join(" "),
        })?;
        if file.segments.len() > MOST_SEGMENTS {
            let what = format!(
                "{} segments are too many: at most {MOST_SEGMENTS} lie in a cell",
                file.segments.len()
            );
            let first_too_many = file.segments[MOST_SEGMENTS].span().start;
            return Err(GivenLayoutError { line: line_at(text, first_too_many), what });
        }
        let &CellTable { a, b, ground } = file.cell.get_ref();
        file.cell.get_ref().check().map_err(|what| GivenLayoutError {
            line: line_at(text, file.cell.span().start),
            what: what.to_owned(),
        })?;
        let longer = DVec2::from(a).length().max(DVec2::from(b).length());
        let mut segments = Vec::with_capacity(file.segments.len());
        for table in &file.segments {
            table.get_ref().check(longer).map_err(|what| GivenLayoutError {
                line: line_at(text, table.span().start),
                what: what.to_owned(),
            })?;
            segments.push(table.get_ref().segment());
        }
        Ok(Self { cell: [a.into(), b.into()], ground, segments })
    }
}

/// The line of a byte of a text, from 1.
fn line_at(text: &str, byte: usize) -> usize {
    1 + text[..byte.min(text.len())].matches('\n').count()
}

/// Whether a number is no lightness that a layout may have, NaN included.
fn is_no_light(light: f64) -> bool {
    light.is_nan() || light.abs() > MOST_LIGHT
}

impl CellTable {
    /// What is wrong with the cell, if anything is.
    fn check(&self) -> Result<(), &'static str> {
        if ![self.a, self.b].concat().iter().all(|number| number.abs() <= MOST_LENGTH) {
            return Err("the cell's numbers are no pixels of a photo");
        }
        if is_no_light(self.ground) {
            return Err("ground is to be a share of the picture's contrast, -1000 to 1000 and \
                        mostly about -1");
        }
        Ok(())
    }
}

impl SegmentTable {
    /// What is wrong with a segment in a cell whose longer vector has that length, if anything is.
    /// The comparisons are such that NaN fails each of them.
    fn check(&self, longer: f64) -> Result<(), &'static str> {
        let mut places = self.center.iter().chain([&self.angle_deg]);
        if !places.all(|number| number.abs() <= MOST_LENGTH) {
            return Err("a segment lies nowhere near the cell");
        }
        let most_size = MOST_CELLS * longer;
        if ![self.width, self.length].iter().all(|size| *size > 0.0 && *size <= most_size) {
            return Err(
                "a segment's width and length are to be over 0 pixels, and under ten cells",
            );
        }
        let mut shares = [self.top, self.round, self.sag].into_iter();
        if !shares.all(|light| (0.0..=MOST_LIGHT).contains(&light)) || is_no_light(self.tilt) {
            return Err(
                "top, round and sag are shares of the picture's contrast, 0 to a few, and \
                        tilt may be under 0",
            );
        }
        if ![self.bow, self.sway].iter().all(|offset| offset.abs() <= self.length) {
            return Err(
                "bow and sway are pixels, and a segment bends less far aside than it is long",
            );
        }
        Ok(())
    }

    fn new(segment: &Segment) -> Self {
        let Segment { centre, angle, width, length, top, round, sag, tilt, bow, sway } = *segment;
        let degrees = angle.to_degrees().rem_euclid(360.0);
        // The conversion rounds. One of the neighbouring numbers usually reads back as exactly this
        // angle, so that a layout which is given back stays as it was.
        let angle_deg = [degrees, degrees.next_up(), degrees.next_down()]
            .into_iter()
            .find(|degrees| degrees.to_radians() == angle)
            .unwrap_or(degrees);
        Self {
            center: centre.to_array(),
            angle_deg,
            width,
            length,
            top,
            round,
            sag,
            tilt,
            bow,
            sway,
        }
    }

    fn segment(&self) -> Segment {
        let Self { center, angle_deg, width, length, top, round, sag, tilt, bow, sway } = *self;
        Segment {
            centre: center.into(),
            angle: angle_deg.to_radians(),
            width,
            length,
            top,
            round,
            sag,
            tilt,
            bow,
            sway,
        }
    }
}

/// A visible part of a segment, and its fibres.
#[derive(Serialize)]
struct VisibleTable {
    /// The segment's number in layout.toml and in layout.svg, from 1.
    segment_number: usize,
    #[serde(flatten)]
    segment: SegmentTable,
    /// S is positive, Z negative.
    twist_deg: f64,
    twist_is_guess: bool,
    /// Pixels of the photo.
    fibre_px: f64,
    fibres: usize,
    spread_deg: f64,
}

impl VisibleTable {
    fn new(number: usize, segment: &Segment, twist: &Twist) -> Self {
        let Twist {
            degrees: twist_deg,
            fibre_px,
            is_guess: twist_is_guess,
            fibres,
            spread: spread_deg,
        } = *twist;
        Self {
            segment_number: number + 1,
            segment: SegmentTable::new(segment),
            twist_deg,
            twist_is_guess,
            fibre_px,
            fibres,
            spread_deg,
        }
    }
}

/// The content of `report.json`.
#[derive(Serialize)]
struct CaptureReport<'a> {
    warpknit: &'a str,
    /// Pixels of the photo.
    lattice: [[f64; 2]; 2],
    confidence: f64,
    pixels_per_mm: f64,
    /// Correlation of the light with the heights of the cylinders.
    correlation: f64,
    /// Pixels of the view that was worked on, per pixel of the photo.
    scale: f64,
    hypothesis: &'a str,
    unexplained: f64,
    unexplained_by_seen: f64,
    overlap: f64,
    blank: f64,
    /// The visible parts.
    segments: Vec<VisibleTable>,
    /// Height of white in depth.png; black is 0.
    depth_mm: f64,
    /// The same segments as curved cylinders.
    yarns: Vec<YarnReport>,
    warnings: Vec<String>,
}

/// A curved cylinder with the parameters' names of Irawan and Marschner 2012.
#[derive(Serialize)]
struct YarnReport {
    width_mm: f64,
    length_mm: f64,
    semi_axis_mm: f64,
    umax_deg: f64,
    kappa_per_mm: f64,
    theta_deg: f64,
    center_mm: [f64; 3],
}

impl From<&CylinderShape> for YarnReport {
    fn from(shape: &CylinderShape) -> Self {
        Self {
            width_mm: shape.width,
            length_mm: shape.length,
            semi_axis_mm: shape.semi_axis,
            umax_deg: shape.steepest.to_degrees(),
            kappa_per_mm: shape.curvature,
            theta_deg: shape.rotation.to_degrees().rem_euclid(180.0),
            center_mm: shape.centre.to_array(),
        }
    }
}

/// Writes all files of a capture.
///
/// # Errors
/// [`ExportError`], with the file that could not be written.
pub fn save(captured: &Captured, folder: &OutputFolder) -> Result<(), ExportError> {
    let Captured { layout, scale, cell, depth, texture, .. } = captured;
    let pictures = [
        ("cell.png", &sheet::grey(&cell.plane)),
        ("grid3x3.png", &sheet::grid(cell, &layout.scaled(*scale))),
        ("texture.png", texture),
        ("depth.png", &sheet::grey(&depth.cell.plane)),
        ("preview.png", &preview(&captured.fabric)),
    ];
    for (name, picture) in pictures {
        png::write(&folder.file(name), picture)?.publish()?;
    }
    write_fibres(&captured.fabric, &folder.file("fibres.usda"))?;
    let drawing = svg::text(&sheet::drawing(cell, &layout.segments, *scale));
    let report =
        serde_json::to_string_pretty(&report(captured)).expect("numbers and names are JSON") + "\n";
    let texts = [
        ("layout.svg", drawing),
        ("layout.toml", layout_text(captured)),
        ("fabric.toml", fabric_text(captured)),
        ("report.json", report),
    ];
    for (name, text) in texts {
        fs::write(folder.file(name), text).map_err(|source| {
            let path = folder.target().join(name);
            ExportError::Io { path, source }
        })?;
    }
    Ok(())
}

/// The content of `report.json`.
fn report(captured: &Captured) -> CaptureReport<'static> {
    let Captured { unit, layout, twists, depth, .. } = captured;
    let hypothesis = match layout.hypothesis {
        Hypothesis::Woven => "woven",
        Hypothesis::Cover => "cover",
        Hypothesis::Given => "given",
    };
    let visible = layout.sources.iter().zip(layout.visible.iter().zip(twists));
    CaptureReport {
        warpknit: env!("CARGO_PKG_VERSION"),
        lattice: [unit.lattice.a.to_array(), unit.lattice.b.to_array()],
        confidence: unit.confidence,
        pixels_per_mm: captured.pixel.recip(),
        correlation: captured.correlation(),
        scale: captured.scale,
        hypothesis,
        unexplained: layout.error,
        unexplained_by_seen: layout.visible_error,
        overlap: layout.overlap,
        blank: layout.blank,
        segments: visible
            .map(|(source, (segment, twist))| VisibleTable::new(*source, segment, twist))
            .collect(),
        depth_mm: depth.cell.plane.values.iter().copied().fold(0.0, f32::max).into(),
        yarns: captured.shapes.iter().map(YarnReport::from).collect(),
        warnings: captured.warnings(),
    }
}

/// The text of `layout.toml`. Its numbers read back as the same.
fn layout_text(captured: &Captured) -> String {
    let Captured { unit, layout, .. } = captured;
    let cell = CellTable {
        a: unit.lattice.a.to_array(),
        b: unit.lattice.b.to_array(),
        ground: layout.ground,
    };
    let cell = toml::Spanned::new(0..0, cell);
    let segments = layout
        .segments
        .iter()
        .map(|segment| toml::Spanned::new(0..0, SegmentTable::new(segment)))
        .collect();
    let tables = toml::to_string(&LayoutFile { cell, segments }).expect("numbers are TOML");
    format!(
        "# The yarns of a cloth's cell, by warpknit capture. Pixels of the photo, y down; top, \
         round, sag, tilt and ground are lightness, 1 about the photo's contrast.\n\
         # Segments go on below others, and the grid shows what is seen of them. Change, add or \
         delete some and give this file to capture with --layout.\n{tables}"
    )
}

/// The text of `fabric.toml`, as `drape` takes it.
fn fabric_text(captured: &Captured) -> String {
    let Captured { fabric, pixel, .. } = captured;
    format!(
        "# A cloth's yarns as warpknit capture found them, at {:.2} pixels of the photo a mm. A \
         wale and a course are the sides of its cell; paths are x and y in cells, z in mm.\n\
         {fabric}",
        pixel.recip()
    )
}

/// Writes all fibres of one cell, as thick as those of Wu et al. 2017.
fn write_fibres(fabric: &Fabric, path: &Path) -> Result<(), ExportError> {
    let bundles = spun::bundles(fabric, fabric.radius(), FIBRE_RADIUS);
    let radius = bundles.iter().map(|bundle| bundle.fibre).fold(0.0, f64::max);
    let section = Section { st: 1, sr: 4, radius, flatten: 1.0, caps: false, texture_per_mm: 1.0 };
    let panel = swatch_panel(fabric, 1, 1);
    let writer = UsdaWriter::create(path, &spun::fabric(fabric, &bundles), &section)?;
    let mut sink = Box::new(SpunWriter::new(Box::new(writer), bundles, None));
    drape::run(
        &Cloth::swatch(&panel, fabric, 1, 1),
        &Options::default(),
        &mut |_, _| {},
        &mut |blocks| sink.take(blocks),
    )?;
    sink.finish()?.into_iter().try_for_each(Output::publish)
}

/// A rendering of some cells of the cloth.
fn preview(fabric: &Fabric) -> RgbaImage {
    let longer = fabric.wale_spacing().max(fabric.course_spacing());
    // As many cells as fill a square. Very flat cells could otherwise become thousands.
    let [wales, courses] = [fabric.wale_spacing(), fabric.course_spacing()].map(|spacing| {
        index32(whole(narrow((PREVIEW_CELLS * longer / spacing).round())).min(4 * MOST_SEGMENTS))
    });
    let scene = picture::swatch(fabric, wales, courses);
    let options =
        render::Options { width: PREVIEW_SIDE, height: PREVIEW_SIDE, ..render::Options::default() };
    let camera = Camera::view(View::Front, &scene.positions, PREVIEW_VIEW, 1.0, 1.0);
    render::render(&scene, &camera, &options, &|_| ()).expect("pictures of that size can be drawn")
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const WHOLE: &str = "[cell]\na = [20, 0]\nb = [0, 10]\nground = -1\n[[segments]]\n\
        center = [5, 5]\nangle_deg = 90\nwidth = 4\nlength = 9\ntop = 1\nround = 0.5\nsag = 0.2\n";

    #[test]
    fn what_is_wrong_is_told_with_its_line() {
        for (from, to, line, part) in [
            ("width = 4", "width = 0", 5, "over 0 pixels"),
            ("length = 9", "length = 900", 5, "ten cells"),
            ("center = [5, 5]", "center = [5, nan]", 5, "nowhere near"),
            ("top = 1", "top = 1e9", 5, "0 to a few"),
            ("sag = 0.2", "sag = -30", 5, "0 to a few"),
            ("sag = 0.2", "sag = 0.2\ntilt = nan", 5, "tilt may be"),
            ("sag = 0.2", "sag = inf", 5, "0 to a few"),
            ("sag = 0.2", "sag = 0.2\nbow = 1e300", 5, "bow and sway"),
            ("sag = 0.2", "sag = 0.2\nsway = nan", 5, "bow and sway"),
            ("a = [20, 0]", "a = [inf, 0]", 1, "no pixels"),
            ("sag", "sga", 12, "sga"),
            ("[cell]", "[cel]", 1, "cel"),
        ] {
            let error = GivenLayout::parse(&WHOLE.replace(from, to)).unwrap_err();
            assert!(
                error.line == line && error.what.contains(part) && !error.what.contains('\n'),
                "{to}: {error}"
            );
        }
        let many = WHOLE.to_owned() + &WHOLE[WHOLE.find("[[").unwrap()..].repeat(MOST_SEGMENTS);
        assert!(GivenLayout::parse(&many).unwrap_err().what.starts_with("65 segments"));
    }

    proptest! {
        #[test]
        fn garbage_is_an_error_in_one_line(at in 0..WHOLE.len(), garbage in "[\\x00-\\x7f]{0,8}") {
            let mut text = WHOLE.to_owned();
            text.replace_range(at..(at + garbage.len()).min(text.len()), &garbage);
            if let Err(error) = GivenLayout::parse(&text) {
                let lines = 1 + text.matches('\n').count();
                prop_assert!(!error.to_string().contains(['\n', '\r']) && error.line <= lines);
            }
        }
    }
}

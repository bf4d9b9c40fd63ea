//! The folder that a capture fills, and the layout that a person may have changed.
//!
//! In: [`Captured`] and an [`OutputFolder`]. Out: [`FILES`] in it: the mean cell as a picture
//! (along its vectors), the grid of nine with the segments drawn, the texture that tiles,
//! `layout.toml` with the cell and its segments, `layout.svg` that shows which is which, and
//! `report.json`. What [`GivenLayout::parse`] reads is what `layout.toml` holds.

use std::fs;
use std::path::Path;

use glam::DVec2;
use image::RgbaImage;
use serde::{Deserialize, Serialize};

use super::layout::Layout;
use super::segment::Segment;
use super::{Captured, Hypothesis, Shape, Twist, sheet};
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

/// All files of such a folder.
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
/// Segments of a cell, at most.
const MOST_SEGMENTS: usize = 64;
/// The longest segment, in lengths of the cell's longer vector.
const MOST_CELLS: f64 = 10.0;
/// What lengths and places may be, pixels.
const MOST_LENGTH: f64 = 16_384.0;
/// What lightness may be, of the photo's contrast.
const MOST_LIGHT: f64 = 1000.0;

/// Cells each way of the preview, its pixels, and how wide its camera sees.
const PREVIEW_CELLS: f64 = 5.0;
const PREVIEW_SIDE: u32 = 640;
const PREVIEW_VIEW: f64 = 0.3;

/// A cell and its segments as a person wants them, pixels of the photo.
#[derive(Clone, Debug, PartialEq)]
pub struct GivenLayout {
    /// Both vectors.
    pub cell: [DVec2; 2],
    /// How light the ground is.
    pub ground: f64,
    /// One of each copy, relative to a cell's corner.
    pub segments: Vec<Segment>,
}

/// What is wrong with a layout file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {what}")]
pub struct LayoutError {
    /// From 1.
    pub line: usize,
    /// One line.
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
    /// let text = "[cell]\na = [20, 0]\nb = [0, 10]\nground = -1\n[[segments]]\ncenter = [5, 5]\nangle_deg = 90\nwidth = 4\nlength = 9\ntop = 1\nround = 0.5\nsag = 0.2\n";
    /// assert_eq!(GivenLayout::parse(text)?.segments.len(), 1);
    /// assert_eq!(GivenLayout::parse("[cell]\na = 3\n").unwrap_err().line, 2);
    /// # Ok::<(), warpknit::capture::LayoutError>(())
    /// ```
    ///
    /// # Errors
    /// [`LayoutError`], with its line.
    pub fn parse(text: &str) -> Result<Self, LayoutError> {
        let line_of = |at: usize| 1 + text[..at.min(text.len())].matches('\n').count();
        let file: LayoutFile = toml::from_str(text).map_err(|error| LayoutError {
            line: error.span().map_or(1, |span| line_of(span.start)),
            what: error.message().split_whitespace().collect::<Vec<_>>().join(" "),
        })?;
        if file.segments.len() > MOST_SEGMENTS {
            let what = format!(
                "{} segments are too many: at most {MOST_SEGMENTS} lie in a cell",
                file.segments.len()
            );
            return Err(LayoutError {
                line: line_of(file.segments[MOST_SEGMENTS].span().start),
                what,
            });
        }
        let &CellTable { a, b, ground } = file.cell.get_ref();
        let wrong = |what: &str| {
            Err(LayoutError { line: line_of(file.cell.span().start), what: what.to_owned() })
        };
        if ![a, b].concat().iter().all(|number| number.abs() <= MOST_LENGTH) {
            return wrong("the cell's numbers are no pixels of a photo");
        }
        if ground.is_nan() || ground.abs() > MOST_LIGHT {
            return wrong(
                "ground is to be a share of the picture's contrast, -1000 to 1000 and mostly about -1",
            );
        }
        let longer = DVec2::from(a).length().max(DVec2::from(b).length());
        let segments = file.segments.iter().map(|table| {
            let wrong = |what: &str| Err(LayoutError { line: line_of(table.span().start), what: what.to_owned() });
            let own = table.get_ref();
            if !own.center.iter().chain([&own.angle_deg]).all(|number| number.abs() <= MOST_LENGTH) {
                return wrong("a segment lies nowhere near the cell");
            }
            if ![own.width, own.length].iter().all(|size| *size > 0.0 && *size <= MOST_CELLS * longer) {
                return wrong("a segment's width and length are to be over 0 pixels, and under ten cells");
            }
            let is_share = |light: &f64| (0.0..=MOST_LIGHT).contains(light);
            if ![own.top, own.round, own.sag].iter().all(is_share) || own.tilt.is_nan() || own.tilt.abs() > MOST_LIGHT {
                return wrong("top, round and sag are shares of the picture's contrast, 0 to a few, and tilt may be under 0");
            }
            if ![own.bow, own.sway].iter().all(|aside| aside.abs() <= own.length) {
                return wrong("bow and sway are pixels, and a segment bends less far aside than it is long");
            }
            Ok(own.segment())
        });
        Ok(Self {
            cell: [a.into(), b.into()],
            ground,
            segments: segments.collect::<Result<_, _>>()?,
        })
    }
}

impl SegmentTable {
    fn of(segment: &Segment) -> Self {
        let Segment { centre, angle, width, length, top, round, sag, tilt, bow, sway } = *segment;
        let degrees = angle.to_degrees().rem_euclid(360.0);
        // Of neighbouring numbers the one that is read as this angle again, where one is: a layout
        // that is given back stays as it was.
        let read_again = |degrees: &f64| degrees.to_radians() == angle;
        let angle_deg = [degrees, degrees.next_up(), degrees.next_down()]
            .into_iter()
            .find(read_again)
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

/// A segment as far as it is seen, and its fibres.
#[derive(Serialize)]
struct SeenTable {
    /// As of its table in layout.toml and in layout.svg, from 1.
    segment_number: usize,
    #[serde(flatten)]
    segment: SegmentTable,
    /// S over 0, Z under 0.
    twist_deg: f64,
    twist_is_guess: bool,
    /// Pixels of the photo.
    fibre_px: f64,
    fibres: usize,
    spread_deg: f64,
}

impl SeenTable {
    fn of(number: usize, segment: &Segment, twist: &Twist) -> Self {
        let Twist {
            degrees: twist_deg,
            fibre_px,
            is_guess: twist_is_guess,
            fibres,
            spread: spread_deg,
        } = *twist;
        Self {
            segment_number: number + 1,
            segment: SegmentTable::of(segment),
            twist_deg,
            twist_is_guess,
            fibre_px,
            fibres,
            spread_deg,
        }
    }
}

/// What `report.json` holds.
#[derive(Serialize)]
struct Report<'a> {
    warpknit: &'a str,
    /// Pixels of the photo.
    lattice: [[f64; 2]; 2],
    confidence: f64,
    pixels_per_mm: f64,
    /// Of the light with the heights of the cylinders.
    correlation: f64,
    /// Pixels worked on for each of the photo's.
    scale: f64,
    hypothesis: &'a str,
    unexplained: f64,
    unexplained_by_seen: f64,
    overlap: f64,
    blank: f64,
    /// As far as they are seen.
    segments: Vec<SeenTable>,
    /// What white in depth.png is; black is 0.
    depth_mm: f64,
    /// The same segments as curved cylinders.
    yarns: Vec<YarnReport>,
    warnings: Vec<String>,
}

/// A curved cylinder, as Irawan and Marschner name its numbers.
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

impl From<&Shape> for YarnReport {
    fn from(shape: &Shape) -> Self {
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

/// Writes all files.
///
/// # Errors
/// What the disk says.
pub fn save(captured: &Captured, folder: &OutputFolder) -> Result<(), ExportError> {
    let Captured { unit, layout, twists, scale, cell, depth, texture, .. } = captured;
    let picture =
        |name: &str, picture: &RgbaImage| png::write(&folder.file(name), picture)?.publish();
    picture("cell.png", &sheet::grey(&cell.plane))?;
    picture("grid3x3.png", &sheet::grid(cell, &layout.scaled(*scale)))?;
    picture("texture.png", texture)?;
    picture("depth.png", &sheet::grey(&depth.cell.plane))?;
    picture("preview.png", &preview(&captured.fabric))?;
    fibres(&captured.fabric, &folder.file("fibres.usda"))?;
    let io = |name: &str| {
        let path = folder.target().join(name);
        move |source| ExportError::Io { path, source }
    };
    let drawing = svg::text(&sheet::drawing(cell, &layout.segments, *scale));
    fs::write(folder.file("layout.svg"), drawing).map_err(io("layout.svg"))?;
    fs::write(folder.file("layout.toml"), layout_text(captured)).map_err(io("layout.toml"))?;
    fs::write(folder.file("fabric.toml"), fabric_text(captured)).map_err(io("fabric.toml"))?;
    let Layout { hypothesis, error, seen_error, overlap, blank, .. } = layout;
    let hypothesis = match hypothesis {
        Hypothesis::Woven => "woven",
        Hypothesis::Cover => "cover",
        Hypothesis::Given => "given",
    };
    let seen = layout.numbers.iter().zip(layout.seen.iter().zip(twists));
    let report = Report {
        warpknit: env!("CARGO_PKG_VERSION"),
        lattice: [unit.lattice.a.to_array(), unit.lattice.b.to_array()],
        confidence: unit.confidence,
        pixels_per_mm: captured.pixel.recip(),
        correlation: captured.correlation(),
        scale: *scale,
        hypothesis,
        unexplained: *error,
        unexplained_by_seen: *seen_error,
        overlap: *overlap,
        blank: *blank,
        segments: seen
            .map(|(number, (segment, twist))| SeenTable::of(*number, segment, twist))
            .collect(),
        depth_mm: depth.cell.plane.values.iter().copied().fold(0.0, f32::max).into(),
        yarns: captured.shapes.iter().map(YarnReport::from).collect(),
        warnings: captured.warnings(),
    };
    let text = serde_json::to_string_pretty(&report).expect("numbers and names are JSON") + "\n";
    fs::write(folder.file("report.json"), text).map_err(io("report.json"))
}

/// `layout.toml`, of numbers that read back as the same.
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
        .map(|segment| toml::Spanned::new(0..0, SegmentTable::of(segment)))
        .collect();
    let tables = toml::to_string(&LayoutFile { cell, segments }).expect("numbers are TOML");
    format!(
        "# The yarns of a cloth's cell, by warpknit capture. Pixels of the photo, y down; top, round, sag, tilt and ground are lightness, 1 about the photo's contrast.\n\
         # Segments go on below others, and the grid shows what is seen of them. Change, add or delete some and give this file to capture with --layout.\n{tables}"
    )
}

/// `fabric.toml`, as `drape` takes it.
fn fabric_text(captured: &Captured) -> String {
    let Captured { fabric, pixel, .. } = captured;
    format!(
        "# A cloth's yarns as warpknit capture found them, at {:.2} pixels of the photo a mm. A wale and a course are the sides of its cell; paths are x and y in cells, z in mm.\n{fabric}",
        pixel.recip()
    )
}

/// All fibres of one cell, as thick as the paper's.
fn fibres(fabric: &Fabric, path: &Path) -> Result<(), ExportError> {
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

/// The cloth as it will look, some cells of it.
fn preview(fabric: &Fabric) -> RgbaImage {
    let longer = fabric.wale_spacing().max(fabric.course_spacing());
    let cells = |spacing: f64| {
        index32(whole(narrow((PREVIEW_CELLS * longer / spacing).round())).min(4 * MOST_SEGMENTS))
    };
    let scene =
        picture::swatch(fabric, cells(fabric.wale_spacing()), cells(fabric.course_spacing()));
    let options = render::RenderOptions {
        width: PREVIEW_SIDE,
        height: PREVIEW_SIDE,
        ..render::RenderOptions::default()
    };
    let camera = Camera::view(View::Front, &scene.positions, PREVIEW_VIEW, 1.0, 1.0);
    render::render(&scene, &camera, &options, &|_| ()).expect("pictures of that size can be drawn")
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const WHOLE: &str = "[cell]\na = [20, 0]\nb = [0, 10]\nground = -1\n[[segments]]\ncenter = [5, 5]\nangle_deg = 90\nwidth = 4\nlength = 9\ntop = 1\nround = 0.5\nsag = 0.2\n";

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
                prop_assert!(!error.to_string().contains(['\n', '\r']) && error.line <= 1 + text.matches('\n').count());
            }
        }
    }
}

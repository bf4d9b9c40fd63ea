//! A capture as pictures, texts and numbers, in memory: whoever wants files writes them.
//!
//! In: [`Captured`]. Out: the mean cell as a picture along its vectors, nine cells with the
//! segments drawn over them, the drawing of the segments' numbers, `fabric.toml` and `report.json`.

use image::RgbaImage;
use serde::Serialize;
use warpknit_chart::Drawing;

use super::layout_file::SegmentTable;
use super::segment::Segment;
use super::{Captured, CylinderShape, Hypothesis, Twist, sheet};

impl Captured {
    /// The mean cell along its vectors, from black to white.
    #[must_use]
    pub fn cell_picture(&self) -> RgbaImage {
        sheet::grey(&self.cell.plane)
    }

    /// Nine cells with the visible segments drawn over them.
    #[must_use]
    pub fn grid_picture(&self) -> RgbaImage {
        sheet::grid(&self.cell, &self.layout.scaled(self.scale))
    }

    /// Heights over the cell, from black (0) to white (the highest).
    #[must_use]
    pub fn depth_picture(&self) -> RgbaImage {
        sheet::grey(&self.depth.cell.plane)
    }

    /// Some cells as the photo has them, joined so that they tile.
    #[must_use]
    pub fn texture(&self) -> &RgbaImage {
        &self.texture
    }

    /// All segments with their numbers, as `layout.svg` shows them.
    #[must_use]
    pub fn drawing(&self) -> Drawing {
        sheet::drawing(&self.cell, &self.layout.segments, self.scale)
    }

    /// The text of `report.json`.
    ///
    /// # Panics
    /// Never: numbers and names are JSON.
    #[must_use]
    pub fn report_text(&self) -> String {
        serde_json::to_string_pretty(&report(self)).expect("numbers and names are JSON") + "\n"
    }

    /// The text of `fabric.toml`, as `drape` takes it.
    #[must_use]
    pub fn fabric_text(&self) -> String {
        let Self { fabric, pixel, .. } = self;
        format!(
            "# A cloth's yarns as warpknit capture found them, at {:.2} pixels of the photo a mm. A \
         wale and a course are the sides of its cell; paths are x and y in cells, z in mm.\n\
         {fabric}",
            pixel.recip()
        )
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

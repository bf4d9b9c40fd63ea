//! The facts that `warpknit inspect` prints about a garment, as JSON for scripts.
//!
//! In: a garment. Out: JSON text. The fields of [`GarmentFacts`] are its keys, in this order; scripts rely on
//! them. Lengths are mm and stretches ratios of draped to flat length, as 5th, 50th and 95th
//! percentile.

use glam::DVec3;
use serde::Serialize;
use warpknit::garment::stretch::{Percentiles, isometry};
use warpknit::garment::{Garment, Panel};
use warpknit::locate::overlap::overlaps;
use warpknit::report::PanelReport;

/// A garment as read.
#[derive(Serialize)]
struct GarmentFacts<'a> {
    warpknit: &'static str,
    garment: &'a str,
    triangles: usize,
    unit: &'static str,
    unit_guessed: bool,
    flat_unit_mm: f64,
    flipped: usize,
    degenerate: usize,
    untextured: usize,
    lost_percent: f64,
    /// Corners of the drape's bounding box.
    draped_from: [f64; 3],
    draped_to: [f64; 3],
    smallest_stretch: Percentiles,
    largest_stretch: Percentiles,
    area_ratio: Percentiles,
    /// Pairs of panels that lie over each other in the flat file, and how much.
    overlaps: Vec<OverlapFacts>,
    panels: Vec<PanelFacts>,
    notes: Vec<String>,
    warnings: &'a [String],
}

/// Panels over each other, or one over itself.
#[derive(Serialize)]
struct OverlapFacts {
    panels: Vec<usize>,
    mm2: f64,
}

/// A panel: what a report has of it, and its size and defects.
#[derive(Serialize)]
struct PanelFacts {
    #[serde(flatten)]
    report: PanelReport,
    triangles: usize,
    width_mm: f64,
    height_mm: f64,
    smallest_stretch: Percentiles,
    largest_stretch: Percentiles,
    flipped: usize,
    non_manifold_edges: usize,
}

impl PanelFacts {
    fn new(report: PanelReport, panel: &Panel) -> Self {
        let (size, own) = (panel.size(), isometry(std::slice::from_ref(panel)));
        Self {
            report,
            triangles: panel.triangles.len(),
            width_mm: size.x,
            height_mm: size.y,
            smallest_stretch: own.smallest,
            largest_stretch: own.largest,
            flipped: panel.flipped.len(),
            non_manifold_edges: panel.non_manifold_edges(),
        }
    }
}

/// The facts of a garment as JSON, ending in a newline.
pub(super) fn facts(name: &str, garment: &Garment) -> serde_json::Result<String> {
    let summary = &garment.summary;
    let points = garment.panels.iter().flat_map(|panel| &panel.draped);
    let [low, high] = points
        .fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], p| [low.min(*p), high.max(*p)]);
    let whole = isometry(&garment.panels);
    let found = overlaps(garment);
    let between = found.between.iter().map(|(pair, mm2)| (pair.to_vec(), *mm2));
    let within = found.within.iter().map(|(panel, mm2)| (vec![*panel], *mm2));
    let reports = PanelReport::of_all(garment).into_iter().zip(&garment.panels);
    let facts = GarmentFacts {
        warpknit: env!("CARGO_PKG_VERSION"),
        garment: name,
        triangles: summary.triangles,
        unit: summary.unit,
        unit_guessed: summary.unit_guessed,
        flat_unit_mm: summary.uv_scale_mm,
        flipped: summary.flipped,
        degenerate: summary.degenerate,
        untextured: summary.untextured,
        lost_percent: summary.lost_percent(),
        draped_from: (low + summary.origin).to_array(),
        draped_to: (high + summary.origin).to_array(),
        smallest_stretch: whole.smallest,
        largest_stretch: whole.largest,
        area_ratio: whole.area,
        overlaps: between.chain(within).map(|(panels, mm2)| OverlapFacts { panels, mm2 }).collect(),
        panels: reports.map(|(report, panel)| PanelFacts::new(report, panel)).collect(),
        notes: summary.all_notes(),
        warnings: &summary.warnings,
    };
    Ok(serde_json::to_string_pretty(&facts)? + "\n")
}

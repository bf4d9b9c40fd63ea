//! The run's report: the `.json` that scripts read. Keys and their order are those of the
//! specification's cli page.

use serde::Serialize;

use crate::knit::clearance::Clearance;

/// Everything about a run.
#[derive(Clone, Debug, Serialize)]
#[expect(
    missing_docs,
    reason = "the keys are the specification's, and their units stand in their names or beside them"
)]
pub struct Report {
    /// The program's version.
    pub warpknit: &'static str,
    pub fabric: String,
    pub garment: GarmentReport,
    pub wales_per_cm: f64,
    pub courses_per_cm: f64,
    /// Which part, from 1, and of how many, where the counts are a part's; null for the whole.
    pub tile: Option<[u32; 2]>,
    pub yarns: usize,
    pub stitches: usize,
    pub data_points: usize,
    pub points_off_panel: usize,
    pub stitches_clipped: usize,
    pub surface: SurfaceReport,
    pub timings_ms: Timings,
    pub clearance: ClearanceReport,
    /// Time to make all data points on the flat fabric.
    pub plane_ms: f64,
    /// That and location and mapping (the source paper's Table 2).
    pub curved_ms: f64,
    pub threads: usize,
    pub peak_memory_mb: f64,
    /// What drew the picture; empty where none was asked for.
    pub renderer: String,
    pub cloth: ClothReport,
    /// The frames of a drape sequence; there is no such key without one.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub frames: Vec<FrameReport>,
}

/// A frame of a drape sequence.
#[derive(Clone, Debug, Serialize)]
#[expect(missing_docs, reason = "see Report")]
pub struct FrameReport {
    pub file: String,
    /// Why it was left out; null for one that is there.
    pub skipped: Option<String>,
    /// What it took without its pictures; the first one's time is that of reading, knitting and
    /// location too.
    pub ms: f64,
    /// 5th, 50th, 95th percentile.
    pub stretch_warp: [f64; 3],
    pub stretch_weft: [f64; 3],
}

/// The garment as read.
#[derive(Clone, Debug, Serialize)]
#[expect(missing_docs, reason = "see Report")]
pub struct GarmentReport {
    pub panels: usize,
    pub triangles: usize,
    pub unit: &'static str,
    /// mm that one flat unit stands for.
    pub uv_scale_mm: f64,
    pub warnings: Vec<String>,
}

/// The yarns' surface.
#[derive(Clone, Debug, Serialize)]
#[expect(missing_docs, reason = "see Report")]
pub struct SurfaceReport {
    pub shape: &'static str,
    pub st: u32,
    pub sr: u32,
    pub radius_mm: f64,
    pub triangles_per_stitch: u32,
    pub triangles: usize,
    pub vertices: usize,
}

/// Wall time of each stage, ms.
#[derive(Clone, Copy, Debug, Default, Serialize)]
#[expect(missing_docs, reason = "see Report")]
pub struct Timings {
    pub read: f64,
    pub knit: f64,
    pub locate: f64,
    pub map: f64,
    pub surface: f64,
    pub render: f64,
    pub write: f64,
    pub total: f64,
}

/// How near the laid-out yarns come to each other.
#[derive(Clone, Copy, Debug, Serialize)]
#[expect(missing_docs, reason = "see Report")]
pub struct ClearanceReport {
    pub min_over_2r: f64,
    pub pairs_below_1: usize,
    /// Sweeps of the yarns' relaxation; null where the repeat is too large for it.
    pub sweeps: Option<usize>,
    /// The same on the body; null for a swatch, for a part, and for a garment of too many stitches.
    pub draped: Option<DrapedClearance>,
}

/// How near yarns come to each other on the body, panel by panel.
#[derive(Clone, Copy, Debug, Serialize)]
#[expect(missing_docs, reason = "see Report")]
pub struct DrapedClearance {
    pub min_over_2r: f64,
    /// Pairs of path segments nearer than twice touching.
    pub pairs: usize,
    pub pairs_below_1: usize,
    /// Part of `pairs`.
    pub share_below_0_95: f64,
}

impl From<Clearance> for DrapedClearance {
    fn from(clearance: Clearance) -> Self {
        let Clearance { min_over_2r, pairs, pairs_below_1, pairs_below_95 } = clearance;
        #[expect(clippy::cast_precision_loss, reason = "a share of three digits")]
        let share_below_0_95 = pairs_below_95 as f64 / pairs.max(1) as f64;
        Self { min_over_2r, pairs, pairs_below_1, share_below_0_95 }
    }
}

/// The real cloth, at its own yarn counts.
#[derive(Clone, Debug, Serialize)]
#[expect(missing_docs, reason = "see Report")]
pub struct ClothReport {
    pub mass_g_m2: f64,
    pub yarn_length_m: f64,
    /// A bar each, front first; null for wefts.
    pub run_in_mm_per_rack: Vec<Option<f64>>,
    pub thickness_mm: f64,
    /// Share of the flat area that yarns hide.
    pub cover_factor: f64,
    /// Share of the volume that no fibre fills; null where yarns are drawn thinner than they are.
    pub porosity: Option<f64>,
    /// 5th, 50th, 95th percentile.
    pub stretch_warp: [f64; 3],
    pub stretch_weft: [f64; 3],
}

impl Report {
    /// The report as JSON text, ending in a newline.
    ///
    /// # Panics
    /// Never: it holds finite numbers and text alone.
    #[must_use]
    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).expect("a report holds numbers and text alone") + "\n"
    }
}

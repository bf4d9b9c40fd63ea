//! The report of a run: the `.json` that scripts read.
//!
//! In: numbers and names of a run. Out: JSON text. The fields of [`Report`] are its keys, in this
//! order. Scripts rely on them, so a key is never renamed or removed. Units are mm, ms and MB,
//! unless a key's name or comment says otherwise.

use serde::Serialize;

use crate::drape::clearance::BodyClearance;
use crate::fabric::Machine;
use crate::garment::Garment;
use crate::garment::stretch::stretch;
use crate::knit::links::Links;
use crate::map::relaxed::StrainCounts;

/// The report of a run.
#[derive(Clone, Debug, Serialize)]
#[expect(
    missing_docs,
    reason = "a key says what it holds, and its unit is in its name or beside it"
)]
pub struct Report {
    /// The program's version.
    pub warpknit: &'static str,
    pub fabric: String,
    pub garment: GarmentReport,
    /// One for each panel of the garment, in the order of its `panel` column in a `.csv`.
    pub panels: Vec<PanelReport>,
    pub wales_per_cm: f64,
    pub courses_per_cm: f64,
    /// Number of the part, from 1, and number of parts, if the counts are those of a part. Null for
    /// the whole.
    pub tile: Option<[u32; 2]>,
    pub yarns: usize,
    pub stitches: usize,
    pub data_points: usize,
    pub points_off_panel: usize,
    pub stitches_clipped: usize,
    pub surface: SurfaceReport,
    pub timings_ms: Timings,
    pub clearance: ClearanceReport,
    /// How the loops of a repeat interlock.
    pub links: LinksReport,
    /// Where the garment strains the cloth too far. Null where the mapping knows no strain.
    pub strain: Option<StrainReport>,
    /// Time to compute all data points on the flat fabric.
    pub plane_ms: f64,
    /// The same plus location and mapping, as in Table 2 of Liu, Kyosev and Jiang, Yarn-level
    /// modelling and geometric simulation of warp-knitted clothing elements, 2022.
    pub curved_ms: f64,
    pub threads: usize,
    pub peak_memory_mb: f64,
    /// The renderer of the picture. Empty without a picture.
    pub renderer: String,
    /// The cloth of a garment's picture, which is not always that of the files. Without a picture of
    /// a garment there is no such key, and not for a sequence.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub picture: Option<PictureReport>,
    pub cloth: ClothReport,
    /// The cloth on its machine. Without a shrinkage in the fabric there is no such key.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub machine: Option<MachineReport>,
    /// How a swatch is pulled. Without a pull there is no such key.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stretched: Option<StretchedReport>,
    /// The frames of a drape sequence. Without a sequence there is no such key.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub frames: Vec<FrameReport>,
}

/// The cloth of a picture.
#[derive(Clone, Debug, Serialize)]
#[expect(missing_docs, reason = "see Report")]
pub struct PictureReport {
    pub wales_per_cm: f64,
    pub courses_per_cm: f64,
    /// Planned stitches, of what is in view.
    pub stitches: u64,
    /// Null without a loupe.
    pub loupe: Option<LoupeReport>,
}

/// The loupe of a picture.
#[derive(Clone, Copy, Debug, Serialize)]
#[expect(missing_docs, reason = "see Report")]
pub struct LoupeReport {
    /// Where it looks, as shares of the picture's width and height from its top left corner.
    pub at: [f64; 2],
    pub times: f64,
}

/// A frame of a drape sequence.
#[derive(Clone, Debug, Serialize)]
#[expect(missing_docs, reason = "see Report")]
pub struct FrameReport {
    pub file: String,
    /// Reason why the frame was left out. Null for a frame that was drawn.
    pub skipped: Option<String>,
    /// Time of the frame without its pictures. The first frame's time includes reading, knitting
    /// and location.
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
    /// Length of one flat unit, mm.
    pub uv_scale_mm: f64,
    /// What may be wrong.
    pub warnings: Vec<String>,
    /// What a person may want to know.
    pub notes: Vec<String>,
    /// Draped area that takes no stitches.
    pub lost_cm2: f64,
    /// The same as a share of the draped area.
    pub lost_percent: f64,
}

/// A panel: what it takes to find the flat coordinates of a `.csv` in the garment's file, and how
/// the panel is stretched.
#[derive(Clone, Debug, Serialize)]
#[expect(missing_docs, reason = "see Report")]
pub struct PanelReport {
    /// Its name in the garment's file, where panels have different ones.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Length of one flat unit, mm.
    pub scale_mm: f64,
    /// Whether it lies face down in the pattern.
    pub mirrored: bool,
    /// The other panels of its piece of the pattern, where that lies folded over itself.
    pub folds: Vec<usize>,
    /// Flat area that is knitted.
    pub area_cm2: f64,
    /// 5th, 50th, 95th percentile.
    pub stretch_warp: [f64; 3],
    pub stretch_weft: [f64; 3],
}

impl PanelReport {
    /// The reports of all panels of a garment.
    #[must_use]
    pub fn of_all(garment: &Garment) -> Vec<Self> {
        let summaries = garment.summary.panels.iter().map(Some).chain(std::iter::repeat(None));
        let panels = garment.panels.iter().zip(summaries);
        panels
            .map(|(panel, summary)| {
                let (stretch_warp, stretch_weft) = stretch(std::slice::from_ref(panel));
                Self {
                    name: summary.and_then(|own| own.name.clone()),
                    scale_mm: summary.map_or(garment.summary.uv_scale_mm, |own| own.scale_mm),
                    mirrored: panel.mirrored,
                    folds: summary.map_or_else(Vec::new, |own| own.folds.clone()),
                    area_cm2: panel.area() / 100.0,
                    stretch_warp,
                    stretch_weft,
                }
            })
            .collect()
    }
}

/// The surface of the yarns.
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
    /// Relaxing one repeat of the fabric.
    pub relax: f64,
    pub knit: f64,
    pub locate: f64,
    /// Solving the repeat for the strains of the garment.
    pub strain: f64,
    pub map: f64,
    /// Moving yarns apart on the body.
    pub sweep: f64,
    pub surface: f64,
    pub render: f64,
    pub write: f64,
    pub total: f64,
    /// Measuring the clearance on the body.
    pub clearance: f64,
}

/// Clearance of the yarns on the flat fabric.
#[derive(Clone, Copy, Debug, Serialize)]
#[expect(missing_docs, reason = "see Report")]
pub struct ClearanceReport {
    pub min_over_2r: f64,
    pub pairs_below_1: usize,
    /// Sweeps of the relaxation. Null where the repeat is too large to be relaxed.
    pub sweeps: Option<usize>,
    /// Clearance on the body. Null for a swatch, for a part and for a sequence.
    pub draped: Option<DrapedClearance>,
}

/// The loops of a repeat, and the old loops of their needles through which they are drawn.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct LinksReport {
    /// Pairs of a new loop and an old one. 0 where the repeat is too large to be relaxed.
    pub checked: usize,
    /// Pairs of which the new loop is not drawn through the old one.
    pub wrong: usize,
    /// Loops that no loop of the next course is drawn through.
    pub held: usize,
}

/// Shares of the data points where the garment strains the cloth too far.
#[derive(Clone, Debug, Serialize)]
pub struct StrainReport {
    /// The strain is larger than any that was solved.
    pub outside: f64,
    /// Loops can't follow: yarn would have to stretch by over 1 %.
    pub locked: f64,
    /// Bars, from 1, whose yarns may stretch: elastane, and inlays with slack. Without any there is
    /// no such key.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub elastic_bars: Vec<usize>,
}

impl StrainReport {
    /// The shares of some points, with the elastic bars from 0. Nothing where there were no points.
    #[must_use]
    pub fn new(counts: StrainCounts, elastic_bars: &[usize]) -> Option<Self> {
        #[expect(clippy::cast_precision_loss, reason = "a share of three digits")]
        let share = |count: usize| count as f64 / counts.points as f64;
        let elastic_bars = elastic_bars.iter().map(|bar| bar + 1).collect();
        let report =
            Self { outside: share(counts.outside), locked: share(counts.locked), elastic_bars };
        (counts.points > 0).then_some(report)
    }
}

impl From<Links> for LinksReport {
    fn from(links: Links) -> Self {
        Self { checked: links.checked, wrong: links.wrong, held: links.held }
    }
}

/// Clearance of the yarns on the body, measured panel by panel. Only neighbours of the flat cloth
/// count, and not cloth that lies on cloth.
#[derive(Clone, Copy, Debug, Serialize)]
#[expect(missing_docs, reason = "see Report")]
pub struct DrapedClearance {
    /// 1.02 at most.
    pub min_over_2r: f64,
    /// Pairs of path segments whose distance is below 1.02 of that of touching.
    pub pairs: u64,
    pub pairs_below_1: u64,
    /// Share of the yarn length that is nearer to another yarn than 0.95 of touching.
    pub share_below_0_95: f64,
    /// Share of the yarn length that is nearer than 0.98 of touching in the flat cloth already. It
    /// is left out of `share_below_0_95`.
    pub share_near_flat: f64,
}

impl From<BodyClearance> for DrapedClearance {
    fn from(clearance: BodyClearance) -> Self {
        Self {
            min_over_2r: clearance.min_over_2r,
            pairs: clearance.pairs,
            pairs_below_1: clearance.pairs_below_1,
            share_below_0_95: clearance.share_below_95(),
            share_near_flat: clearance.share_near_flat(),
        }
    }
}

/// The real cloth, at the yarn counts of its fabric.
#[derive(Clone, Debug, Serialize)]
#[expect(missing_docs, reason = "see Report")]
pub struct ClothReport {
    pub mass_g_m2: f64,
    pub yarn_length_m: f64,
    /// One for each bar, from the front. Null for wefts.
    pub run_in_mm_per_rack: Vec<Option<f64>>,
    /// The same of the relaxed yarn. Null for bars without a draft. Without any draft there is no
    /// such key.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub relaxed_run_in_mm_per_rack: Vec<Option<f64>>,
    /// One for each bar or feeder; those that make no loops have null.
    pub loop_width_mm: Vec<Option<f64>>,
    pub thickness_mm: f64,
    /// Share of the flat area that yarns cover.
    pub cover_factor: f64,
    /// Share of the volume without fibres. Null where yarns are drawn thinner than they are.
    pub porosity: Option<f64>,
    /// 5th, 50th, 95th percentile.
    pub stretch_warp: [f64; 3],
    pub stretch_weft: [f64; 3],
}

/// A pulled swatch. Densities, counts and clearance are those of the pulled cloth, and the numbers
/// in `cloth` those of flat cloth.
#[derive(Clone, Debug, Serialize)]
#[expect(missing_docs, reason = "see Report")]
pub struct StretchedReport {
    /// Ratios of pulled to flat length.
    pub courses: f64,
    pub wales: f64,
    /// Whether yarn would have to stretch.
    pub locked: bool,
    /// The lengths along the wales that the cloth takes by itself, over the pull. Empty unless they
    /// were asked for.
    pub free: Vec<FreeWidthReport>,
}

/// What a pulled cloth takes by itself along its wales.
#[derive(Clone, Copy, Debug, Serialize)]
#[expect(missing_docs, reason = "see Report")]
pub struct FreeWidthReport {
    pub courses: f64,
    /// With half the bending that is assumed, with it, and with twice as much.
    pub wales: [f64; 3],
}

/// The cloth on its machine, before finishing. Its run-in is that of the finished cloth.
#[derive(Clone, Copy, Debug, Serialize)]
#[expect(missing_docs, reason = "see Report")]
pub struct MachineReport {
    pub wales_per_cm: f64,
    /// Needles an inch.
    pub gauge: f64,
    pub courses_per_cm: f64,
    /// Share of the machine's width that finishing takes. 0 if it isn't given.
    pub width_shrink: f64,
    /// The same of the length.
    pub length_shrink: f64,
}

impl From<Machine> for MachineReport {
    fn from(machine: Machine) -> Self {
        let Machine { wales_per_cm, gauge, courses_per_cm, width_shrink, length_shrink } = machine;
        Self { wales_per_cm, gauge, courses_per_cm, width_shrink, length_shrink }
    }
}

impl Report {
    /// The report as JSON text, ending in a newline.
    ///
    /// # Panics
    /// Never: a report has only numbers and text.
    #[must_use]
    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).expect("a report has only numbers and text") + "\n"
    }
}

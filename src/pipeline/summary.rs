//! The end of a run: its totals and its report.
//!
//! In: a [`Job`] and the results of its stages. Out: report files, and [`Done`] for the caller.

use super::clock::Clock;
use super::job::Job;
use super::messages::Messages;
use super::numbers::RealCloth;
use super::settings::Wanted;
use super::setup::Setup;
use super::stretch::{FreeWidth, Stretched};
use crate::drape::Totals;
use crate::drape::clearance::BodyClearance;
use crate::export::{ExportError, Format, Output};
use crate::garment::stretch::stretch;
use crate::knit::strain::Strain;
use crate::report::{
    ClearanceReport, ClothReport, FrameReport, FreeWidthReport, GarmentReport, PanelReport,
    PictureReport, Report, StrainReport, StretchedReport, SurfaceReport,
};
use crate::system::peak_memory_mb;
use crate::tile::Tile;

/// A cloth that a run laid.
#[derive(Debug)]
pub struct Laid {
    /// Totals of the laid yarns.
    pub totals: Totals,
    /// Planned stitches of the whole cloth, if only what is in view was laid.
    pub whole: Option<u64>,
    /// Whether none was laid, because pictures show cloth in which no stitch is seen.
    pub is_averaged: bool,
    /// Names of the files that were made of it, in one line.
    pub files: String,
}

/// A finished run.
#[derive(Debug)]
pub struct Done {
    /// What was laid: one cloth, or that of the pictures and then that of the other files.
    pub parts: Vec<Laid>,
    /// Number of drawn frames and of all frames. `None` without a sequence.
    pub frames: Option<(usize, usize)>,
    /// Measurements of the real cloth. `None` for a garment without a report.
    pub real: Option<RealCloth>,
    /// How a swatch was pulled, if it was.
    pub stretched: Option<Stretched>,
}

/// The results of a run's stages, for its report.
pub(super) struct RunSummary<'a> {
    pub(super) setup: &'a Setup,
    pub(super) totals: &'a Totals,
    /// Clearance on the body, if it was measured.
    pub(super) draped: Option<BodyClearance>,
    pub(super) messages: Messages,
    /// Name of the renderer. Empty without a picture.
    pub(super) drawn_by: String,
    /// The cloth of a garment's picture.
    pub(super) picture: Option<PictureReport>,
    /// The frames of a drape sequence. Empty without one.
    pub(super) frames: Vec<FrameReport>,
}

impl RunSummary<'_> {
    /// Writes the reports among the files. Returns them with the measurements of the real cloth,
    /// which a swatch always has and a garment only with a report. The run's time ends here.
    pub(super) fn files(
        &self,
        job: &Job<'_>,
        wanted: &[Wanted],
        clock: &Clock<'_>,
    ) -> Result<(Vec<Output>, Option<RealCloth>), ExportError> {
        let Setup { section, near, .. } = self.setup;
        let mut reports = wanted
            .iter()
            .filter(|(_, format)| *format == Format::Json)
            .map(|(path, _)| path)
            .peekable();
        if !job.is_swatch && reports.peek().is_none() {
            return Ok((Vec::new(), None));
        }
        let real = RealCloth::of_job(job, section.radius, *near);
        let text = self.report(job, &real, clock).to_json();
        let files = reports
            .map(|path| Output::create_whole(path, text.as_bytes()))
            .collect::<Result<_, _>>()?;
        Ok((files, Some(real)))
    }

    /// The report of the run.
    fn report(&self, job: &Job<'_>, real: &RealCloth, clock: &Clock<'_>) -> Report {
        let Self { setup: Setup { section, near, links, .. }, totals, draped, .. } = self;
        let garment = job.cloth.garment();
        let timings_ms = clock.timings();
        let (vertices, triangles) = section.size_of(totals.pieces, totals.strands);
        Report {
            warpknit: env!("CARGO_PKG_VERSION"),
            fabric: job.fabric.name.clone(),
            garment: GarmentReport {
                panels: garment.panels.len(),
                triangles: garment.summary.triangles,
                unit: garment.summary.unit,
                uv_scale_mm: garment.summary.uv_scale_mm,
                warnings: self.messages.warnings.clone(),
                notes: self.messages.notes.clone(),
                lost_cm2: garment.summary.loss.total() / 100.0,
                lost_percent: garment.summary.lost_percent(),
            },
            panels: PanelReport::of_all(garment),
            wales_per_cm: job.shown.wales_per_cm,
            courses_per_cm: job.shown.courses_per_cm,
            tile: job.tile().map(Tile::numbers),
            yarns: totals.yarns,
            stitches: totals.losses.stitches,
            data_points: totals.data_points,
            points_off_panel: totals.losses.off_panel,
            stitches_clipped: totals.losses.clipped,
            surface: SurfaceReport {
                shape: "tube",
                st: section.st,
                sr: section.sr,
                radius_mm: section.radius,
                triangles_per_stitch: section.triangles_per_stitch(),
                triangles,
                vertices,
            },
            timings_ms,
            clearance: ClearanceReport {
                min_over_2r: near.min_over_2r,
                pairs_below_1: near.pairs_below_1,
                sweeps: job.cloth.pattern().relaxation().map(|relaxation| relaxation.sweeps),
                draped: (*draped).map(Into::into),
            },
            links: (*links).into(),
            strain: (job.cloth.strain())
                .filter(|table| !table.is_flat_only())
                .and_then(|table| StrainReport::new(totals.strain, table.elastic_bars())),
            plane_ms: timings_ms.knit,
            curved_ms: timings_ms.knit + timings_ms.locate + timings_ms.map,
            threads: rayon::current_num_threads(),
            peak_memory_mb: peak_memory_mb(),
            renderer: self.drawn_by.clone(),
            picture: self.picture.clone(),
            cloth: cloth_report(job, real),
            machine: real.fabric.machine().map(Into::into),
            stretched: job.stretched.as_ref().map(Into::into),
            frames: self.frames.clone(),
        }
    }
}

impl From<&Stretched> for StretchedReport {
    fn from(stretched: &Stretched) -> Self {
        let free = stretched.free.iter();
        let free = free.map(|&FreeWidth { courses, wales }| FreeWidthReport { courses, wales });
        let Strain { courses, wales, .. } = stretched.strain;
        Self { courses, wales, locked: stretched.is_locked, free: free.collect() }
    }
}

/// Measurements of the real cloth: the fabric at its own densities on the garment's flat area.
fn cloth_report(job: &Job<'_>, real: &RealCloth) -> ClothReport {
    let garment = job.cloth.garment();
    let numbers = &real.numbers;
    let (stretch_warp, stretch_weft) = stretch(&garment.panels);
    let any_draft = real.fabric.yarns().any(|yarn| yarn.draft.is_some());
    // `yarn_length` is in m/m² and the area in mm².
    ClothReport {
        mass_g_m2: numbers.mass,
        yarn_length_m: numbers.yarn_length * job.area * 1e-6,
        run_in_mm_per_rack: numbers.run_in.clone(),
        relaxed_run_in_mm_per_rack: if any_draft {
            numbers.relaxed_run_in.clone()
        } else {
            Vec::new()
        },
        loop_width_mm: numbers.loop_width.clone(),
        thickness_mm: numbers.thickness,
        cover_factor: numbers.cover,
        porosity: numbers.porosity,
        stretch_warp,
        stretch_weft,
    }
}

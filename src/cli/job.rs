//! A run of `drape` or `swatch`: what it makes, what is known at its end, and its report.

use std::path::Path;

use warpknit::drape::{self, Cloth, Totals};
use warpknit::fabric::Fabric;
use warpknit::garment::stretch::stretch;
use warpknit::knit::clearance::Clearance;
use warpknit::report::{ClearanceReport, ClothReport, GarmentReport, Report, SurfaceReport};
use warpknit::tile::Tile;
use warpknit::yarn::tube::Section;

use super::args::Shared;
use super::clock::Clock;
use super::numbers::RealCloth;
use super::system::peak_memory_mb;

/// One run: what is knitted, onto what, and how it is shown.
pub(super) struct Job<'a> {
    pub(super) shared: &'a Shared,
    /// The fabric as named, whose numbers are reported.
    pub(super) fabric: &'a Fabric,
    /// The fabric at the densities at which it is drawn.
    pub(super) shown: &'a Fabric,
    /// How much larger that is, if it is; said in the report too.
    pub(super) enlarged: Option<String>,
    pub(super) cloth: &'a Cloth<'a>,
    /// The part that files hold, if it isn't the whole.
    pub(super) part: Option<(Tile, Cloth<'a>)>,
    pub(super) options: drape::Options,
    /// Flat area that is knitted, mm².
    pub(super) area: f64,
    /// Files that were read, and must not be overwritten.
    pub(super) inputs: Vec<&'a Path>,
    /// What an output is called if none is named.
    pub(super) stem: &'a Path,
    /// Whether the fabric's numbers are printed.
    pub(super) tells_numbers: bool,
}

impl Job<'_> {
    /// The part that is made, if it isn't the whole.
    pub(super) fn tile(&self) -> Option<Tile> {
        self.part.as_ref().map(|(tile, _)| *tile)
    }

    /// The yarns that files hold.
    pub(super) fn filed(&self) -> &Cloth<'_> {
        self.part.as_ref().map_or(self.cloth, |(_, part)| part)
    }
}

/// What is known after the run.
pub(super) struct Facts<'a> {
    pub(super) section: &'a Section,
    pub(super) totals: &'a Totals,
    pub(super) near: Clearance,
    /// The same on the body, where it was measured.
    pub(super) draped: Option<Clearance>,
    pub(super) warnings: Vec<String>,
    /// What drew the picture; empty where there is none.
    pub(super) drawn_by: String,
}

impl Facts<'_> {
    /// The report of a run, whose time ends here.
    pub(super) fn report(&self, job: &Job<'_>, real: &RealCloth, clock: &Clock) -> Report {
        let Self { section, totals, near, draped, .. } = *self;
        let garment = job.cloth.garment();
        let timings_ms = clock.timings();
        let (vertices, triangles) = section.size_of(totals.pieces, totals.strands);
        Report {
            warpknit: env!("CARGO_PKG_VERSION"),
            fabric: job.fabric.name.clone(),
            garment: GarmentReport {
                panels: garment.panels.len(),
                triangles: garment.facts.triangles,
                unit: garment.facts.unit,
                uv_scale_mm: garment.facts.uv_scale_mm,
                warnings: self.warnings.clone(),
            },
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
                sweeps: job.cloth.pattern().settled().map(|settled| settled.sweeps),
                draped: draped.map(Into::into),
            },
            plane_ms: timings_ms.knit,
            curved_ms: timings_ms.knit + timings_ms.locate + timings_ms.map,
            threads: rayon::current_num_threads(),
            peak_memory_mb: peak_memory_mb(),
            renderer: self.drawn_by.clone(),
            cloth: cloth_report(job, real),
        }
    }
}

/// The real cloth: the fabric at its own densities over the garment's flat area.
fn cloth_report(job: &Job<'_>, real: &RealCloth) -> ClothReport {
    let garment = job.cloth.garment();
    let numbers = &real.numbers;
    let (stretch_warp, stretch_weft) = stretch(garment);
    ClothReport {
        mass_g_m2: numbers.mass,
        yarn_length_m: numbers.yarn_length * job.area * 1e-6,
        run_in_mm_per_rack: numbers.run_in.clone(),
        thickness_mm: numbers.thickness,
        cover_factor: numbers.cover,
        porosity: numbers.porosity,
        stretch_warp,
        stretch_weft,
    }
}

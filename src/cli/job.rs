//! A run of `drape` or `swatch`: what it makes, what is known at its end, and its report.

use std::path::Path;
use std::sync::Arc;

use anyhow::{Result, bail};
use warpknit::drape::{self, Cloth, Totals, fibres};
use warpknit::export::{Format, Output, TextureSet};
use warpknit::fabric::Fabric;
use warpknit::garment::stretch::stretch;
use warpknit::ids::index32;
use warpknit::knit::clearance::{self, Clearance};
use warpknit::render::fibres::NEAR;
use warpknit::render::scene::Scene;
use warpknit::report::{
    ClearanceReport, ClothReport, FrameReport, GarmentReport, Report, SurfaceReport,
};
use warpknit::tile::Tile;
use warpknit::yarn::fibres::Bundle;
use warpknit::yarn::tube::Section;

use super::args::Shared;
use super::clock::Clock;
use super::numbers::RealCloth;
use super::pictures::{self, Textures};
use super::system::peak_memory_mb;
use super::targets::text_file;
use super::values::{ShapeArg, SwitchArg};
use super::writers::{Wanted, section, textures_in_files};

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

/// What a run's files make and draw with.
pub(super) struct Setup {
    pub(super) section: Section,
    pub(super) textures: Textures,
    /// The same as files hold them.
    pub(super) textures_in_files: Arc<TextureSet>,
    /// What yarns are spun of, where their fibres are to be seen.
    pub(super) fibres: Option<Fibres>,
    /// How yarns are laid, with surfaces where a file holds them.
    pub(super) options: drape::Options,
    /// How near yarns come to each other on the flat fabric.
    pub(super) near: Clearance,
}

/// What of a run is made of fibres.
pub(super) struct Fibres {
    /// One a bar.
    pub(super) bundles: Vec<Bundle>,
    /// Pixels across a yarn from which on a picture shows them.
    pub(super) near: f64,
    /// How the tubes of fibres in files are made; none where files hold yarns.
    pub(super) filed: Option<Section>,
}

/// The most points of fibres in files: as curves, of which a .usda takes some 20 GB, and as tubes,
/// of which a .glb holds no more than 4 GB.
const MOST_CURVE_POINTS: f64 = 2e8;
const MOST_TUBE_POINTS: f64 = 1.5e7;
/// Edges of a fibre's section in files, where nobody asks for others.
const FIBRE_SR: u32 = 4;

impl Job<'_> {
    /// Refuses files of more fibres than they or the memory can hold, before the work.
    fn check_fibres(&self, bundles: &[Bundle], wanted: &[Wanted]) -> Result<()> {
        let pattern = self.cloth.pattern();
        let steps = |bar: usize| {
            if pattern.runs_across(bar) {
                self.shown.threading_repeat()
            } else {
                self.shown.repeat()
            }
        };
        // A span has two points of each fibre at the least.
        let samples = |(bar, bundle): (usize, &Bundle)| {
            let spans =
                f64::from(index32(pattern.points_per_repeat(bar))) / f64::from(index32(steps(bar)));
            let side = self.shown.wale_spacing().max(self.shown.course_spacing());
            f64::from(bundle.count) * (bundle.points_per_mm() * side).max(2.0 * spans)
        };
        let a_stitch = bundles.iter().enumerate().map(samples).sum::<f64>()
            / f64::from(index32(bundles.len()));
        #[expect(clippy::cast_precision_loss, reason = "an estimate")]
        let points = a_stitch * self.filed().stitches() as f64;
        let most = |format: Format| {
            if format.holds_tubes() { MOST_TUBE_POINTS } else { MOST_CURVE_POINTS }
        };
        let streams = |format: &Format| !matches!(format, Format::Png | Format::Json);
        match wanted.iter().find(|(_, format)| streams(format) && points > most(*format)) {
            Some((path, format)) => bail!(
                "{}: the fibres of {} stitches take about {points:.1e} points, and it holds {:.1e} at most: raise --fibre-radius, or write a swatch",
                path.display(),
                self.filed().stitches(),
                most(*format)
            ),
            None => Ok(()),
        }
    }

    /// What is asked for of fibres; unasked, captured cloth shows them from near.
    fn fibres(&self, wanted: &[Wanted], section: &Section) -> Result<Option<Fibres>> {
        let asked = self.shared.fibres.map(SwitchArg::is_on);
        let is_ribbon = matches!(self.shared.drawing.shape, ShapeArg::Ribbon);
        if is_ribbon && asked == Some(true) {
            bail!("--shape ribbon has no fibres: leave out one of --shape and --fibres");
        }
        if is_ribbon || !asked.unwrap_or(self.shown.is_laid()) {
            return Ok(None);
        }
        let bundles = fibres::bundles(self.shown, section.radius, self.shared.fibre_radius);
        if asked.is_none() {
            return Ok(Some(Fibres { bundles, near: NEAR, filed: None }));
        }
        if let Some((path, _)) =
            wanted.iter().find(|(_, format)| matches!(format, Format::Csv | Format::Npz))
        {
            bail!(
                "{}: data points are of yarns and not of fibres: leave out --fibres, or write .usda, .bcc, .curves.txt or .glb",
                path.display()
            );
        }
        self.check_fibres(&bundles, wanted)?;
        let section = Section { sr: self.shared.sr.unwrap_or(FIBRE_SR), ..*section };
        Ok(Some(Fibres { bundles, near: 0.0, filed: Some(section) }))
    }

    /// What the run needs before its first yarn; `wanted` are its files.
    pub(super) fn setup(&self, wanted: &[Wanted]) -> Result<Setup> {
        let section = section(self)?;
        let near = clearance::measure(self.shown, self.cloth.pattern(), section.radius);
        let wants_surface = wanted.iter().any(|(_, format)| format.holds_tubes());
        let options = drape::Options { surface: wants_surface.then_some(section), ..self.options };
        let textures = Textures::of(self.shared, self.shown)?;
        let textures_in_files = textures_in_files(wanted, self, section.radius, &textures);
        let fibres = self.fibres(wanted, &section)?;
        Ok(Setup { section, textures, textures_in_files, fibres, options, near })
    }

    /// What is to be said of the garment and of how the fabric is drawn, before any yarn is laid.
    pub(super) fn first_warnings(&self, setup: &Setup) -> Vec<String> {
        let mut warnings = self.cloth.garment().facts.warnings.clone();
        warnings.extend(clearance::warnings(
            self.shown,
            self.cloth.pattern(),
            &setup.near,
            setup.section.radius,
        ));
        if let ShapeArg::Ribbon = self.shared.drawing.shape {
            warnings.extend(setup.textures.misfit(self.shown));
        }
        warnings
    }

    /// The scene that its yarns are drawn in.
    pub(super) fn scene(&self, setup: &Setup) -> Scene {
        pictures::scene(
            self.shared.drawing.shape.into(),
            self.shown,
            setup.section.radius,
            &setup.textures,
        )
    }

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
    pub(super) setup: &'a Setup,
    pub(super) totals: &'a Totals,
    /// The same on the body, where it was measured.
    pub(super) draped: Option<Clearance>,
    pub(super) warnings: Vec<String>,
    /// What drew the picture; empty where there is none.
    pub(super) drawn_by: String,
    /// Of a drape sequence.
    pub(super) frames: Vec<FrameReport>,
}

impl Facts<'_> {
    /// The reports among the files, of a run whose time ends here, and the numbers of the real
    /// cloth where they or the person at the terminal are told them.
    pub(super) fn files(
        &self,
        job: &Job<'_>,
        wanted: &[Wanted],
        clock: &Clock,
    ) -> Result<(Vec<Output>, Option<RealCloth>)> {
        let Setup { section, near, .. } = self.setup;
        let mut reports = wanted
            .iter()
            .filter(|(_, format)| *format == Format::Json)
            .map(|(path, _)| path)
            .peekable();
        if !job.tells_numbers && reports.peek().is_none() {
            return Ok((Vec::new(), None));
        }
        // What is shown with its own yarns is the real cloth, and need not be knitted again.
        let shown = (job.fabric == job.shown
            && job.fabric.enlargement == 1.0
            && section.radius == job.fabric.radius())
        .then(|| (job.cloth.pattern(), *near));
        let real = RealCloth::of(job.fabric, shown);
        let text = self.report(job, &real, clock).to_json();
        let files = reports.map(|path| text_file(path, &text)).collect::<Result<_, _>>()?;
        Ok((files, Some(real)))
    }

    fn report(&self, job: &Job<'_>, real: &RealCloth, clock: &Clock) -> Report {
        let Self { setup: Setup { section, near, .. }, totals, draped, .. } = self;
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
                draped: (*draped).map(Into::into),
            },
            plane_ms: timings_ms.knit,
            curved_ms: timings_ms.knit + timings_ms.locate + timings_ms.map,
            threads: rayon::current_num_threads(),
            peak_memory_mb: peak_memory_mb(),
            renderer: self.drawn_by.clone(),
            cloth: cloth_report(job, real),
            frames: self.frames.clone(),
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

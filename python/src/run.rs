//! `warpknit.drape` and `warpknit.swatch`.
//!
//! In: a garment and a fabric, or a fabric and a size. Out: `Yarns`. Densities, limits and the cache
//! of strained repeats are those of the command.
//!
//! Strained repeats that were solved are kept, also where nobody waited for the end of the work.

use std::path::PathBuf;
use std::sync::Arc;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use warpknit::drape::{Cloth, DrapeOptions, swatch_panel};
use warpknit::garment::Panel;
use warpknit::knit::run_in;
use warpknit::map::Mapping;
use warpknit::pipeline::{
    self, Densities, Enlarge, Placement, RunError, Settings, Source, StrainCache, cache_folder,
};
use warpknit::{fabric, garment};

use crate::error;
use crate::fabric::{given, warn};
use crate::garment::Garment;
use crate::laid::{LaidArrays, lay};
use crate::names;
use crate::work::{Fault, Watch, awaited};
use crate::yarns::{Origin, Yarns, whole};

/// Memory of a stitch in the arrays, GB: some nine points of 88 bytes. While a panel's yarns are moved
/// apart, a stitch of it takes more.
const STITCH_GB: f64 = 800e-9;
const SWEPT_STITCH_GB: f64 = 3000e-9;
/// The largest swatch each way.
const MOST_SWATCH: u32 = 1000;

/// Knits a fabric onto a garment, and returns its yarns.
///
/// fabric: a Fabric, or the name of a built-in one.
/// wales_per_cm, courses_per_cm: densities of the cloth. One alone scales the other. Without both
///     the cloth is enlarged, yarns and all, until about 12 000 stitches remain, as in the files of
///     the command.
/// mapping: "relaxed" keeps the lengths of yarns; "smooth" takes depths along smooth normals;
///     "frame" is the affine map of the source paper.
/// enlarge: so many times as large as true; 1 is true gauge.
/// edge: "clip" cuts yarns at the panels' edges; "drop" leaves out stitches that cross them.
/// sweeps: whether yarns that cut each other on the body are moved apart, with "relaxed". By default
///     up to a million stitches.
/// progress: called as progress(stage, share), at most 20 times a second. Stages are "strain", the solving of
///     strained repeats, then "yarns"; shares go from 0 to 1. An exception in it ends the work.
///
/// Raises GarmentError or FabricError; MemoryError where the arrays don't fit. Warns as the command does.
#[pyfunction]
#[pyo3(signature = (garment, fabric, wales_per_cm=None, mapping="relaxed", *, courses_per_cm=None,
                    enlarge=None, edge="clip", sweeps=None, progress=None))]
#[expect(clippy::too_many_arguments, reason = "keywords of Python")]
pub(crate) fn drape(
    py: Python<'_>,
    garment: &Bound<'_, PyAny>,
    fabric: &Bound<'_, PyAny>,
    wales_per_cm: Option<f64>,
    mapping: &str,
    courses_per_cm: Option<f64>,
    enlarge: Option<f64>,
    edge: &str,
    sweeps: Option<bool>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Yarns> {
    let Ok(garment) = garment.cast::<Garment>() else {
        return Err(error::of_type("garment", garment, "a Garment: Garment.load reads files"));
    };
    let garment = garment.get();
    let placement =
        Placement { mapping: names::mapping(mapping)?, sweeps, edge: names::edge(edge)? };
    let densities = Densities { wales_per_cm, courses_per_cm };
    if densities.are_chosen() && enlarge.is_some() {
        return Err(PyValueError::new_err(
            "give either densities or enlarge: both say how large the stitches are",
        ));
    }
    if let Some(times) = enlarge.filter(|times| !(*times > 0.0 && times.is_finite())) {
        return Err(PyValueError::new_err(format!(
            "enlarge is {times}, but must be a number above 0, such as 1 for true gauge"
        )));
    }
    let settings = Settings {
        densities,
        enlarge: Some(enlarge.map_or(Enlarge::Auto, Enlarge::Times)),
        placement,
        cache: cache_folder(),
        ..Settings::default()
    };
    let named = densities.of_fabric(given(fabric)?);
    let named = named.map_err(|error| error::of_fabric(&error, None))?;
    let inputs = (Arc::clone(&garment.garment), named.clone(), settings.clone());
    let (draped, shown, laid, warnings) = awaited(py, progress, move |watch| {
        let (garment, named, settings) = &inputs;
        laid(garment, named, settings, watch)
    })?;
    for warning in warnings {
        warn(py, &warning)?;
    }
    let source = source(&named, garment.inputs.clone());
    Yarns::new(py, Origin::Garment(draped), (named, shown), settings, source, laid)
}

/// What a drape makes: the garment with its panels turned, the fabric as it is drawn, the yarns, and
/// warnings.
type Drape = (Arc<garment::Garment>, fabric::Fabric, LaidArrays, Vec<String>);

/// Lays a fabric of chosen densities on a garment.
fn laid(
    garment: &Arc<garment::Garment>,
    fabric: &fabric::Fabric,
    settings: &Settings,
    watch: &Watch,
) -> Result<Drape, Fault> {
    pipeline::check_placement(settings.placement)?;
    let mut garment = Arc::clone(garment);
    let whole = Arc::clone(&garment);
    if !fabric.panels.is_empty() {
        pipeline::turn_panels(Arc::make_mut(&mut garment), fabric);
    }
    let area = garment.panels.iter().map(Panel::area).sum();
    let shown = match settings.enlarge {
        Some(enlarge) if !settings.densities.are_chosen() => enlarge.of_fabric(fabric, area)?,
        _ => fabric.clone(),
    };
    let radius = pipeline::drawn_radius(&shown, None)?;
    let cloth = Cloth::cover(&garment, &shown)
        .map_err(|source| RunError::Layout { fabric: fabric.name.clone(), source })?;
    let options = DrapeOptions::from(settings.placement);
    run_in::check(&shown, cloth.pattern()).map_err(RunError::from)?;
    check_size(&cloth, &options)?;
    watch.check_wanted()?;
    let wants_strain = options.mapping == Mapping::Relaxed;
    let cache = StrainCache::open(settings.cache.as_deref().filter(|_| wants_strain), &cloth);
    watch.check_wanted()?;
    let laid = lay(&cloth, &options, watch);
    cache.keep(&cloth);
    let (laid, totals) = laid?;
    pipeline::check_laid(&totals)?;
    let of_drape = [
        pipeline::loss_warning(&totals),
        pipeline::lengths_note(&cloth, &options),
        pipeline::locked_warning(&laid.strain, &garment),
    ];
    let mut warnings = pipeline::cloth_warnings(&cloth, &shown, radius);
    warnings.extend(of_drape.into_iter().flatten());
    drop(cloth);
    // Files are made from the garment as it was read: a run turns the panels itself.
    Ok((whole, shown, laid, warnings))
}

/// Knits a flat piece of fabric, wales yarns a bar and courses courses, up to 1000 each.
///
/// Its `report` has the numbers of the cloth: run-in, g/m², thickness and others.
///
/// Raises FabricError. Warns as the command does.
#[pyfunction]
#[pyo3(signature = (fabric, wales=14, courses=16))]
pub(crate) fn swatch(
    py: Python<'_>,
    fabric: &Bound<'_, PyAny>,
    wales: i64,
    courses: i64,
) -> PyResult<Yarns> {
    let sides = 1..=MOST_SWATCH;
    let (wales, courses) = (whole("wales", wales, &sides)?, whole("courses", courses, &sides)?);
    let fabric = given(fabric)?;
    let own = fabric.clone();
    let (laid, warnings) = awaited(py, None, move |watch| {
        let panel = swatch_panel(&own, wales, courses);
        let cloth = Cloth::swatch(&panel, &own, wales, courses);
        run_in::check(&own, cloth.pattern()).map_err(RunError::from)?;
        // A swatch is its own drape, so no strain has to be looked up.
        let options = DrapeOptions { mapping: Mapping::Smooth, ..DrapeOptions::default() };
        check_size(&cloth, &options)?;
        let warnings = pipeline::cloth_warnings(&cloth, &own, own.radius());
        Ok((lay(&cloth, &options, watch)?.0, warnings))
    })?;
    for warning in warnings {
        warn(py, &warning)?;
    }
    let source = source(&fabric, Vec::new());
    let fabrics = (fabric.clone(), fabric);
    Yarns::new(py, Origin::Swatch([wales, courses]), fabrics, Settings::default(), source, laid)
}

/// The origin of a run's cloth, for messages.
fn source(fabric: &fabric::Fabric, inputs: Vec<PathBuf>) -> Source {
    Source { fabric: fabric.name.clone(), inputs, stem: PathBuf::from("yarns") }
}

/// Refuses cloth whose arrays don't fit.
fn check_size(cloth: &Cloth<'_>, options: &DrapeOptions) -> Result<(), RunError> {
    let stitches = cloth.stitches();
    pipeline::check_stitches(stitches)?;
    #[expect(clippy::cast_precision_loss, reason = "an estimate of two digits")]
    let [all, swept] = [stitches, cloth.swept_together(options)].map(|count| count as f64);
    let needed = all * STITCH_GB + swept * SWEPT_STITCH_GB;
    let remedy =
        "lower wales_per_cm, raise enlarge, or use the command, which writes block by block";
    pipeline::check_memory("an array of yarns", stitches, needed, remedy)
}

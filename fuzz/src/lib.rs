//! What the fuzz targets share: files in memory for readers that take paths, checks of garments, and
//! fabric knitted onto small ones.

use std::convert::Infallible;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use tempfile::TempDir;
use warpknit::drape::{self, Cloth, LayoutError, Totals};
use warpknit::fabric::Fabric;
use warpknit::garment::stretch::{isometry, stretch};
use warpknit::garment::{Garment, Panel};
use warpknit::locate::covered::count_covered;
use warpknit::locate::overlap::overlaps;
use warpknit::map::Mapping;
use warpknit::yarn::tube::Section;

/// The most stitches that are knitted for one input: a few milliseconds.
pub const MOST_STITCHES: u64 = 1_000;

static TRICOT: LazyLock<Fabric> = LazyLock::new(|| Fabric::named("tricot").expect("a built-in fabric"));

/// A folder in memory that is removed when the fuzzer ends, and written to anew for each input.
pub struct Desk(TempDir);

impl Desk {
    /// A folder in `/dev/shm` where there is one.
    pub fn new() -> Self {
        let memory = Path::new("/dev/shm");
        let folder = if memory.is_dir() { tempfile::tempdir_in(memory) } else { tempfile::tempdir() };
        Self(folder.expect("a temporary folder can be made"))
    }

    /// A file of these bytes.
    pub fn file(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.path().join(name);
        std::fs::write(&path, bytes).expect("a temporary file can be written");
        path
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        self.0.path()
    }
}

impl Default for Desk {
    fn default() -> Self {
        Self::new()
    }
}

/// Splits an input into its parts.
pub fn parts<'a>(data: &'a [u8], mark: &[u8]) -> Vec<&'a [u8]> {
    let mut parts = Vec::new();
    let mut rest = data;
    while let Some(at) = rest.windows(mark.len()).position(|window| window == mark) {
        parts.push(&rest[..at]);
        rest = &rest[at + mark.len()..];
    }
    parts.push(rest);
    parts
}

/// Lays a fabric over a garment, and knits it with tubes where it is small enough to be done at
/// once.
pub fn knit(garment: &Garment, fabric: &Fabric) -> Result<Option<Totals>, LayoutError> {
    let cloth = Cloth::cover(garment, fabric)?;
    if cloth.stitches() > MOST_STITCHES {
        return Ok(None);
    }
    let section = Section {
        st: 2,
        sr: 3,
        radius: fabric.radius(),
        flatten: 1.0,
        caps: true,
        texture_per_mm: 1.0,
    };
    // Solving the repeat for all strains of a crumpled garment takes longer than an input may.
    let options = drape::DrapeOptions {
        mapping: Mapping::Smooth,
        surface: Some(section),
        ..drape::DrapeOptions::default()
    };
    let Ok(totals) = drape::run(&cloth, &options, &mut |_, _| {}, &mut |_| Ok::<_, Infallible>(()));
    Ok(Some(totals))
}

/// Inspects a garment, and knits onto it coarsely.
pub fn use_garment(garment: &Garment) {
    assert!(!garment.panels.is_empty());
    let (warp, weft) = stretch(&garment.panels);
    assert!(warp.into_iter().chain(weft).all(|share| !share.is_nan()), "{warp:?} {weft:?}");
    for panel in &garment.panels {
        check_panel(panel);
    }
    let mut counted = garment.clone();
    if let Err(error) = count_covered(&mut counted, Path::new("flat.obj"), false) {
        one_line(&error);
    }
    counted.summary.warnings.iter().for_each(one_line);
    counted.summary.all_notes().iter().for_each(one_line);
    let _inspected = (isometry(&garment.panels), overlaps(garment));
    // Some ten wales and courses of the largest panel.
    let side = garment.panels.iter().map(|panel| panel.size().max_element()).fold(0.0, f64::max);
    if let Ok(fabric) = TRICOT.clone().at_densities(100.0 / side, 100.0 / side)
        && let Err(error) = knit(garment, &fabric)
    {
        one_line(&error);
    }
}

/// Asserts that a panel holds together.
pub fn check_panel(panel: &Panel) {
    let count = panel.uv.len();
    assert_eq!([panel.draped.len(), panel.normals.len()], [count; 2]);
    assert_eq!(panel.faces.len(), panel.triangles.len());
    assert!(panel.triangles.iter().chain(&panel.flipped).flatten().all(|&vertex| (vertex as usize) < count));
    assert!(panel.uv.iter().all(|p| p.is_finite()) && panel.draped.iter().all(|p| p.is_finite()));
    assert!(panel.normals.iter().all(|n| n.is_finite()));
    assert!(panel.area() > 0.0, "{}", panel.area());
    let _counted = panel.non_manifold_edges();
}

/// Asserts that a message is one line.
pub fn one_line(error: &impl std::fmt::Display) {
    let text = error.to_string();
    assert!(!text.is_empty() && !text.contains(['\n', '\r']), "not one line: {text:?}");
}

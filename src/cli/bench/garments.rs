//! The garments that are measured on, the shipped ones or the user's own, and fabrics with a wanted
//! number of stitches on them.
//!
//! In: the flags, a number of stitches or of triangles. Out: garments and fabrics. The shipped
//! garments are embedded in the program, so that it needs no files.

use std::fs;

use anyhow::{Context, Result};
use warpknit::drape::Cloth;
use warpknit::export::TemporaryFolder;
use warpknit::fabric::Fabric;
use warpknit::garment::{Garment, GarmentSummary, Panel, ReadOptions, read};
use warpknit::ids::index32;

use super::super::args::Bench;
use super::measure::{FLAT_YARN, time_stages};
use super::panel::shuffled_cone;

/// Accepted relative difference between the counted and the wanted number of stitches.
const TOLERANCE: f64 = 0.003;
/// The most iterations of the search for it.
const TRIES: usize = 5;

/// A garment in `meshes/`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shipped {
    Pinch,
    Tube,
    Skirt,
}

impl Shipped {
    fn name(self) -> &'static str {
        match self {
            Self::Pinch => "pinch",
            Self::Tube => "tube",
            Self::Skirt => "skirt",
        }
    }

    /// The flat and the draped file.
    fn files(self) -> [&'static [u8]; 2] {
        match self {
            Self::Pinch => [
                include_bytes!("../../../meshes/pinch_flat.obj"),
                include_bytes!("../../../meshes/pinch_draped.obj"),
            ],
            Self::Tube => [
                include_bytes!("../../../meshes/tube_flat.obj"),
                include_bytes!("../../../meshes/tube_draped.obj"),
            ],
            Self::Skirt => [
                include_bytes!("../../../meshes/skirt_flat.obj"),
                include_bytes!("../../../meshes/skirt_draped.obj"),
            ],
        }
    }

    /// Reads the garment, through temporary files: the reader takes paths.
    fn read(self) -> Result<Garment> {
        let folder = TemporaryFolder::create_in(&std::env::temp_dir())
            .context("no room for a temporary file")?;
        let [flat, draped] = ["flat.obj", "draped.obj"].map(|name| folder.path().join(name));
        for (path, bytes) in [&flat, &draped].into_iter().zip(self.files()) {
            fs::write(path, bytes).with_context(|| format!("{}: can't write", path.display()))?;
        }
        Ok(read(&flat, Some(&draped), &ReadOptions::default())?)
    }
}

/// The garments of a run. The user's garment, if there is one, replaces all shipped ones.
#[derive(Debug)]
pub(super) struct Garments {
    own: Option<(String, Garment)>,
}

impl Garments {
    /// Reads the user's garment, if one is named.
    pub(super) fn from_arguments(arguments: &Bench) -> Result<Self> {
        let Some(flat) = arguments.meshes.first() else { return Ok(Self { own: None }) };
        let draped = arguments.meshes.get(1);
        let garment = read(flat, draped.map(AsRef::as_ref), &arguments.reading.options())?;
        let name =
            draped.unwrap_or(flat).file_stem().unwrap_or_default().to_string_lossy().into_owned();
        Ok(Self { own: Some((name, garment)) })
    }

    /// Whether the garment is the user's own. Published figures don't apply to it.
    pub(super) fn are_own(&self) -> bool {
        self.own.is_some()
    }

    /// The name of a garment, and the garment.
    pub(super) fn get(&self, shipped: Shipped) -> Result<(String, Garment)> {
        self.own.clone().map_or_else(|| Ok((shipped.name().to_owned(), shipped.read()?)), Ok)
    }
}

/// A garment of one panel with about so many triangles, ordered as the reader orders them.
pub(super) fn folded_cone(triangles: usize) -> Garment {
    let mut panel = shuffled_cone(triangles);
    panel.order_along_curve();
    let facts = GarmentSummary {
        triangles: panel.triangles.len(),
        unit: "mm",
        uv_scale_mm: 1.0,
        ..GarmentSummary::default()
    };
    Garment { panels: vec![panel], summary: facts }
}

/// The fabric at densities that give about so many stitches on the garment. It is estimated from
/// the areas; the loops keep their aspect ratio.
pub(super) fn at_stitches(fabric: &Fabric, garment: &Garment, stitches: f64) -> Result<Fabric> {
    let area: f64 = garment.panels.iter().map(Panel::area).sum();
    // One stitch of each bar for each cell of wale spacing by course spacing.
    let bars = f64::from(index32(fabric.yarn_systems()));
    let there = bars * area / (fabric.wale_spacing() * fabric.course_spacing());
    scaled(fabric, stitches / there)
}

/// The same with the stitches counted, and their count: a fixed-point iteration to within 0.3 %, or
/// as near as some tries come. The estimate is off because bars are not always fully threaded and
/// panels have edges.
pub(super) fn fitted(fabric: &Fabric, garment: &Garment, stitches: f64) -> Result<(Fabric, usize)> {
    let mut fitted = at_stitches(fabric, garment, stitches)?;
    let mut tries = 1..=TRIES;
    let mut best: Option<(f64, Fabric, usize)> = None;
    // Stitches grow in proportion to the product of the densities, so scaling by the ratio of
    // wanted to counted stitches converges in a few iterations.
    loop {
        let (_, totals) = time_stages(&Cloth::cover(garment, &fitted)?, &FLAT_YARN);
        let there = totals.losses.stitches;
        let times = stitches / f64::from(index32(there)).max(1.0);
        let next = scaled(&fitted, times)?;
        let error = (times - 1.0).abs();
        // On small panels the count jumps by whole courses of an open net, so the last try need not
        // be the best.
        if best.as_ref().is_none_or(|(least, ..)| error < *least) {
            best = Some((error, fitted, there));
        }
        if let Some((least, fabric, count)) = &best
            && (tries.next().is_none() || *least < TOLERANCE)
        {
            return Ok((fabric.clone(), *count));
        }
        fitted = next;
    }
}

/// The fabric with so many times the stitches on the same area.
fn scaled(fabric: &Fabric, times: f64) -> Result<Fabric> {
    let finer = times.sqrt();
    let scaled =
        fabric.clone().at_densities(fabric.wales_per_cm * finer, fabric.courses_per_cm * finer);
    scaled.context("the garment is too small or too large for that many stitches: check --unit")
}

#[cfg(test)]
mod tests {
    use super::super::panel::SIZE;
    use super::*;

    #[test]
    fn shipped_garments_are_read_anywhere_and_take_the_wanted_stitches() {
        for (shipped, panels) in [(Shipped::Pinch, 1), (Shipped::Tube, 1), (Shipped::Skirt, 6)] {
            assert_eq!(shipped.read().unwrap().panels.len(), panels, "{}", shipped.name());
        }
        let garment = Shipped::Pinch.read().unwrap();
        let (net, stitches) =
            fitted(&Fabric::named("hex-net-3").unwrap(), &garment, 576.0).unwrap();
        let (_, totals) = time_stages(&Cloth::cover(&garment, &net).unwrap(), &FLAT_YARN);
        assert!(
            (556..=596).contains(&stitches) && totals.losses.stitches == stitches,
            "{stitches}"
        );
    }

    #[test]
    fn a_cone_covers_its_rectangle_with_triangles_the_right_way_round() {
        for wanted in [2, 2000] {
            let panel = shuffled_cone(wanted);
            assert!(
                panel.triangles.len().abs_diff(wanted) * 20 <= wanted,
                "{} for {wanted}",
                panel.triangles.len()
            );
            assert!((panel.area() - SIZE.x * SIZE.y).abs() < 1e-6);
            for corners in &panel.triangles {
                let [a, b, c] = corners.map(|vertex| panel.uv[vertex as usize]);
                assert!((b - a).perp_dot(c - a) > 0.0);
            }
        }
        let cone = shuffled_cone(2000);
        assert!(cone.triangles.windows(2).any(|pair| pair[0] > pair[1]));
        let outward = cone
            .draped
            .iter()
            .zip(&cone.normals)
            .filter(|(at, normal)| at.with_y(0.0).dot(**normal) > 0.0)
            .count();
        assert!(outward * 10 > cone.draped.len() * 9, "{outward} of {}", cone.draped.len());
    }
}

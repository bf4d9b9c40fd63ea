//! Baseline: the location of Liu, Kyosev and Jiang 2022 on this machine, a linear search through
//! all triangles for each data point.
//!
//! In: a cloth. Out: the time of locating (their section 3.1, eq. 1) and mapping (section 3.2) all
//! its data points. Cost: points times triangles. The paper has no clipping of yarns at a panel's
//! edge, so it is left out here.

use std::convert::Infallible;
use std::hint::black_box;

use glam::{DVec2, DVec3};
use rayon::prelude::*;
use warpknit::drape::{self, Block, Cloth};
use warpknit::garment::Panel;
use warpknit::ids::index32;
use warpknit::locate::SurfacePoint;
use warpknit::locate::orient2d::crosses;
use warpknit::map::{Mapping, map};

use super::measure::{FLAT_YARN, Moment, Sample};

/// Locates and maps all data points of a cloth, with as many threads as the pipeline, and returns
/// the time.
pub(super) fn located_and_mapped(cloth: &Cloth<'_>) -> Sample {
    let panels = &cloth.garment().panels;
    let orders: Vec<_> = panels.iter().map(file_order).collect();
    let mut taken = Sample::default();
    let mut deliver = |blocks: &[Block]| -> Result<(), Infallible> {
        let start = Moment::now();
        blocks.par_iter().for_each(|block| {
            let (panel, order) = (&panels[block.panel], &orders[block.panel]);
            let on_panel = |point: &DVec3| Some((*point, locate(panel, order, point.truncate())?));
            let (flat, located): (Vec<_>, Vec<_>) =
                block.knitted.points.iter().filter_map(on_panel).unzip();
            black_box(map(panel, &flat, &located, Mapping::Smooth));
        });
        taken += start.elapsed();
        Ok(())
    };
    let Ok(_totals) = drape::run(cloth, &FLAT_YARN, &mut |_, _| {}, &mut deliver);
    taken
}

/// A panel's triangles in the order of the file. The panel holds them along a space-filling curve.
fn file_order(panel: &Panel) -> Vec<u32> {
    let mut order: Vec<u32> = (0..index32(panel.triangles.len())).collect();
    order.sort_unstable_by_key(|&triangle| panel.faces[triangle as usize]);
    order
}

/// The first triangle that contains the point, edges included.
fn locate(panel: &Panel, order: &[u32], point: DVec2) -> Option<SurfacePoint> {
    order.iter().find_map(|&triangle| {
        let [a, b, c] = panel.triangles[triangle as usize].map(|vertex| panel.uv[vertex as usize]);
        let signs @ [ab, bc, ca] = crosses(point, a, b, c);
        // The point is inside where the three cross products have the same sign; a flipped triangle
        // has all of them negative. Their shares of the sum are the barycentric coordinates.
        let holds = signs.iter().all(|&sign| sign >= 0.0) || signs.iter().all(|&sign| sign <= 0.0);
        let area = ab + bc + ca;
        holds.then(|| SurfacePoint { triangle, b: ca / area, c: ab / area })
    })
}

#[cfg(test)]
mod tests {
    use super::super::garments::folded_cone;
    use super::*;
    use warpknit::locate::Locator;

    #[test]
    fn it_finds_what_the_locator_finds_on_edges_and_corners_too() {
        let garment = folded_cone(400);
        let panel = &garment.panels[0];
        let [low, high] = panel.bounds();
        let grid = (0..40)
            .flat_map(|x| (0..40).map(move |y| DVec2::new(f64::from(x), f64::from(y)) / 38.0));
        let points: Vec<_> =
            grid.map(|share| low + share * (high - low)).chain(panel.uv.iter().copied()).collect();
        let middles = panel
            .triangles
            .iter()
            .map(|[a, b, _]| panel.uv[*a as usize].midpoint(panel.uv[*b as usize]));
        let points: Vec<_> =
            points.into_iter().chain(middles).map(|point| point.extend(0.0)).collect();
        let ours = Locator::new(panel).locate(&points);
        assert!(ours.iter().any(Option::is_none) && ours.iter().flatten().count() > 1600);
        let order = file_order(panel);
        for (point, ours) in points.iter().zip(ours) {
            let found = locate(panel, &order, point.truncate());
            assert_eq!(found.map(|at| at.triangle), ours.map(|at| at.triangle), "{point}");
            // The same weights, come by in other ways.
            let apart = found.zip(ours).map_or(0.0, |(found, ours)| {
                (found.b - ours.b).abs().max((found.c - ours.c).abs())
            });
            assert!(apart < 1e-9, "{point}: {found:?}, {ours:?}");
        }
    }
}

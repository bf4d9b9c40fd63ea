//! The yarns of one repeat of a fabric, each closed in itself.
//!
//! In: a fabric and its [`Pattern`]. Out: a [`RepeatScene`]: the polylines of all copies that reach
//! into the repeat and its surroundings, with a look for each yarn of the repeat.
//!
//! A yarn's twist is changed a little, so that its plies make whole turns on the length of a
//! repeat: by at most half the distance of two plies. Cost: linear in the yarns' points.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use super::FabricMapsError;
use super::closed_path::{ClosedPath, Copies};
use crate::cloth::repeat_size;
use crate::light::SKY_REACH_RADII;
use crate::paths::YarnPaths;
use crate::ply;
use crate::scene::{Scene, YarnLook};
use warpknit_core::fabric::Fabric;
use warpknit_core::ids::index32;
use warpknit_core::knit::mesh::StructureMesh;
use warpknit_core::knit::spread::Spread;
use warpknit_core::knit::{Knitted, Pattern};
use warpknit_core::number::narrow;

/// One repeat of cloth as polylines.
pub(super) struct RepeatScene {
    /// The looks of the repeat's yarns. It has no strands.
    pub(super) scene: Scene,
    /// Coordinates relative to the middle of the repeat's area.
    pub(super) paths: YarnPaths,
    /// Arc length of a repeat of each look's yarn, mm.
    pub(super) periods: Vec<f32>,
}

/// One yarn of the repeat.
pub(super) struct TiledYarn {
    bar: usize,
    /// Its control points over one repeat, mm from the repeat's lowest-left corner.
    pub(super) points: Vec<DVec3>,
    /// Their data points in the fabric's repeat.
    origins: Vec<u32>,
    /// From a point to the same point in the next repeat, mm.
    period: DVec3,
}

impl TiledYarn {
    /// Width over height of its section at each point, as flat as the yarns of a scene lie. None
    /// where all of those are round.
    fn ratios(&self, scene: &Scene) -> Vec<f32> {
        let ratio = |spread: &Spread| self.origins.iter().map(|&at| spread.ratio(at)).collect();
        let even = |look: &YarnLook| vec![look.flatten; self.points.len()];
        match &scene.spread {
            Some(spread) => ratio(spread),
            None if scene.looks.iter().all(|look| look.flatten == 1.0) => Vec::new(),
            None => even(&scene.looks[self.bar]),
        }
    }
}

impl RepeatScene {
    /// The yarns of a repeat, with the looks of `bars`, subdivided for pixels of `pixel` mm. `cell`
    /// is the size of the repeat, mm.
    pub(super) fn new(
        yarns: &[TiledYarn],
        cell: DVec2,
        bars: &Scene,
        pixel: f64,
    ) -> Result<Self, FabricMapsError> {
        let thickest = bars.looks.iter().map(|look| look.radius).fold(0.0, f32::max);
        let mut made = Self {
            scene: Scene { shape: bars.shape, maps: bars.maps.clone(), ..Scene::default() },
            paths: YarnPaths { centre: (cell / 2.0).extend(0.0), ..YarnPaths::default() },
            periods: Vec::new(),
        };
        let reach = DVec2::splat(f64::from(thickest * SKY_REACH_RADII));
        let within = [-reach, cell + reach];
        for yarn in yarns {
            let look = u16::try_from(made.scene.looks.len())
                .map_err(|_over| FabricMapsError::TooManyYarns { yarns: yarns.len() })?;
            let path = ClosedPath::new(&yarn.points, &yarn.ratios(bars), yarn.period, pixel);
            let drawn = closed_look(&bars.looks[yarn.bar], path.length);
            let copies = Copies { within, cell, radius: drawn.radius, look };
            made.paths.push_copies(&path, &copies);
            made.scene.looks.push(drawn);
            made.periods.push(narrow(path.length));
        }
        Ok(made)
    }
}

/// All yarns of one repeat.
pub(super) fn repeat_yarns(fabric: &Fabric, pattern: &Pattern) -> Vec<TiledYarn> {
    let cell = repeat_size(fabric);
    let mesh = StructureMesh::anchored_at(fabric, DVec2::ZERO);
    let [wales, courses] =
        [fabric.threading_repeat(), fabric.repeat()].map(|count| i64::from(index32(count)));
    let mut yarns = Vec::new();
    for bar in 0..fabric.yarn_systems() {
        let across = pattern.runs_across(bar);
        let (numbers, steps) = if across { (courses, wales) } else { (wales, courses) };
        let period = if across { DVec3::X } else { DVec3::Y } * cell.extend(0.0);
        for number in (0..numbers).filter(|&number| pattern.has_yarn(bar, number)) {
            let mut knitted = Knitted::default();
            pattern.lay(bar, number, 0..steps, &mesh, &mut knitted);
            let Knitted { points, origins, .. } = knitted;
            yarns.push(TiledYarn { bar, points, origins, period });
        }
    }
    yarns
}

/// A look whose plies make whole turns on `length` mm.
fn closed_look(look: &YarnLook, length: f64) -> YarnLook {
    if look.plies < 2 {
        return *look;
    }
    let plies = f64::from(look.plies);
    let [slope, _] = ply::slopes(narrow(plies), look.twist_slope);
    // Plies that a line along the yarn crosses on the way.
    let crossed = plies * length / (TAU * f64::from(look.radius));
    let whole = (f64::from(slope) * crossed).round();
    YarnLook { twist_slope: Some(narrow(whole / crossed.max(f64::MIN_POSITIVE))), ..*look }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloth;

    #[test]
    fn a_repeat_holds_each_yarn_once_and_its_surroundings() {
        let fabric = Fabric::named("locknit").unwrap();
        let bars = Scene { looks: cloth::looks(&fabric, fabric.radius()), ..Scene::default() };
        let cell = repeat_size(&fabric);
        let yarns = repeat_yarns(&fabric, &Pattern::new(&fabric));
        let repeat = RepeatScene::new(&yarns, cell, &bars, 0.01).unwrap();
        // A wale of two bars.
        assert_eq!((repeat.scene.looks.len(), repeat.periods.len()), (2, 2));
        let reach = f64::from(SKY_REACH_RADII) * fabric.radius();
        for corner in [DVec2::ZERO, cell] {
            let near = |point: &glam::Vec4| {
                let place = point.truncate().truncate().as_dvec2() + cell / 2.0;
                place.distance(corner) < reach
            };
            assert!(repeat.paths.points.iter().any(near), "{corner}");
        }
    }

    #[test]
    fn plies_make_whole_turns() {
        for (plies, slope) in [(2, Some(0.31)), (3, Some(-0.27)), (3, None)] {
            let look = YarnLook {
                plies,
                twist_slope: slope,
                ..YarnLook::plain(glam::Vec3::ONE, 0.5, 0.05)
            };
            let closed = closed_look(&look, 4.2);
            let turns = f64::from(plies) * f64::from(closed.twist_slope.unwrap()) * 4.2
                / (TAU * f64::from(look.radius));
            assert!((turns - turns.round()).abs() < 1e-4, "{turns}");
        }
    }
}

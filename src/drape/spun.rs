//! Yarns as their fibres, for files and for pictures taken from near.
//!
//! In: a fabric's yarns as [`Block`]s hold them or as a [`Scene`] has them. Out: the same with a
//! strand a fibre. Of a scene only what a camera sees from near is spun, and its fibres are no
//! thinner than pixels can tell, so that memory is bounded by the picture and not by the garment.
//!
//! Not promised: data points of fibres; they have none, and their stitches are those of their
//! yarns.

use glam::DVec3;

use super::Block;
use super::strands::Strand;
use crate::fabric::Fabric;
use crate::ids::index32;
use crate::render::Camera;
use crate::render::ply::MIDDLING_SLOPE;
use crate::scene::{Scene, YarnLook};
use crate::yarn::fibres::{Axis, Bundle, FIBRE_RADIUS, spin};
use crate::yarn::tube::Section;

/// Pixels across a yarn from which on its fibres show.
pub const NEAR: f64 = 36.0;
/// Fibres are drawn at least so many pixels thick.
const FINEST: f64 = 0.9;
/// The most points of fibres in a picture: a gigabyte once rays are traced.
const MOST_POINTS: f64 = 4e6;
/// How far beside the picture yarns are spun, as a share of its half: they shade what is in it.
const MARGIN: f64 = 1.15;

/// The fibres of each of a fabric's yarns, the thickest of which has that radius; fibres are
/// `fibre` mm thick, were the cloth not enlarged.
#[must_use]
pub fn bundles(fabric: &Fabric, radius: f64, fibre: f64) -> Vec<Bundle> {
    let bundle = |(bar, thickness): (&crate::fabric::Bar, f64)| {
        let slope = bar.yarn.twist_slope().unwrap_or_else(|| MIDDLING_SLOPE.into());
        Bundle::filling(radius * thickness, bar.yarn.packing, fibre * fabric.enlargement, slope)
    };
    fabric.bars.iter().zip(fabric.thickness()).map(bundle).collect()
}

/// The fabric whose yarns are the fibres of another one's: as fine as `bundles` say, for whoever
/// asks how thick strands are.
#[must_use]
pub fn fabric(yarns: &Fabric, bundles: &[Bundle]) -> Fabric {
    let mut fibres = yarns.clone();
    for (bar, bundle) in fibres.bars.iter_mut().zip(bundles) {
        bar.yarn.count = bar.yarn.count.times((bundle.fibre / bundle.radius).powi(2));
        (bar.yarn.plies, bar.yarn.twist) = (Some(1), None);
    }
    fibres
}

/// A block of fibres in place of a block of yarns, with surfaces if they are asked for; a yarn's
/// fibres have its number. Where they lie on the flat panel isn't known.
#[must_use]
pub fn block(yarns: &Block, bundle: &Bundle, surface: Option<&Section>) -> Block {
    let mut spun = Block {
        panel: yarns.panel,
        bar: yarns.bar,
        knitted: yarns.knitted.clone(),
        ..Block::default()
    };
    for strand in &yarns.strands.strands {
        let range = strand.range();
        let controls = &yarns.draped.positions[range.clone()];
        let axis = Axis::through(controls, bundle.points_per_mm());
        let spans = 0..controls.len() - 1;
        let of_points: Vec<usize> =
            axis.spans_of(spans.clone()).map(|span| range.start + span).collect();
        let seed = u64::from(strand.yarn.0) << 32 | u64::from(strand.points.start);
        spin(bundle, &axis, spans, seed, &mut |points| {
            let (first, first_piece) =
                (index32(spun.draped.positions.len()), index32(spun.strands.pieces.len()));
            spun.draped.positions.extend(points.iter().map(|point| point.as_dvec3()));
            spun.draped.normals.extend(of_points.iter().map(|&at| yarns.draped.normals[at]));
            spun.strands.sources.extend(of_points.iter().map(|&at| yarns.strands.sources[at]));
            let end = index32(spun.draped.positions.len());
            spun.strands.pieces.extend(first..end - 1);
            let pieces = first_piece..index32(spun.strands.pieces.len());
            spun.strands.strands.push(Strand { yarn: strand.yarn, points: first..end, pieces });
        });
    }
    if let Some(section) = surface {
        spun.add_tubes(&Section { radius: bundle.fibre, ..*section }, 1.0);
    }
    spun
}

/// What of a scene's yarns a camera sees at least `near` pixels wide, as fibres; none where that is
/// nothing. `bundles` has a bundle a look, whose fibres may be taken thicker; the last numbers are
/// the picture's pixels.
#[must_use]
pub fn scene(
    yarns: &Scene,
    bundles: &[Bundle],
    near: f64,
    camera: &Camera,
    [width, height]: [u32; 2],
) -> Option<Scene> {
    let aspect = f64::from(width) / f64::from(height);
    let pixel = |point: DVec3| camera.pixel_size(point.distance(camera.eye()), height);
    // Of yarns side by side all show their fibres or none does.
    let widest = 2.0 * bundles.iter().map(|bundle| bundle.radius).fold(0.0, f64::max);
    let is_near = |point: &DVec3| {
        let at = camera.project(*point, aspect);
        at.is_some_and(|at| at.abs().max_element() < MARGIN) && widest > near * pixel(*point)
    };
    let controls = |strand: &crate::scene::SceneStrand| -> Vec<DVec3> {
        yarns.positions[strand.points.start as usize..strand.points.end as usize]
            .iter()
            .map(|point| point.as_dvec3())
            .collect()
    };
    // How long the yarns are that are near, and the smallest pixel there.
    let (mut lengths, mut finest) = (vec![(0.0, 0.0); bundles.len()], f64::INFINITY);
    for strand in &yarns.strands {
        let (look, points) = (usize::from(strand.look), controls(strand));
        for ends in points.windows(2).filter(|ends| ends.iter().any(is_near)) {
            lengths[look].0 += ends[0].distance(ends[1]);
            lengths[look].1 += 1.0;
            finest = finest.min(pixel(ends[0]));
        }
    }
    if !finest.is_finite() {
        return None;
    }
    let drawn = drawn(bundles, &lengths, finest);
    // Looks of fibres follow those of yarns.
    let fibre_look = |(look, bundle): (&YarnLook, &Bundle)| YarnLook {
        radius: crate::yarn::narrow(bundle.fibre),
        plies: 1,
        twist_slope: Some(0.0),
        maps: None,
        ..*look
    };
    let looks =
        yarns.looks.iter().copied().chain(yarns.looks.iter().zip(&drawn).map(fibre_look)).collect();
    let mut spun =
        Scene { looks, shape: yarns.shape, maps: yarns.maps.clone(), ..Scene::default() };
    for (number, strand) in (0_u64..).zip(&yarns.strands) {
        let (look, points) = (usize::from(strand.look), controls(strand));
        let bundle = &drawn[look];
        let runs: Vec<bool> = points.windows(2).map(|ends| ends.iter().any(is_near)).collect();
        let axis = runs.contains(&true).then(|| Axis::through(&points, bundle.points_per_mm()));
        let mut first = 0;
        for run in runs.chunk_by(|a, b| a == b) {
            let spans = first..first + run.len();
            first = spans.end;
            match axis.as_ref().filter(|_| run[0]) {
                Some(axis) => {
                    let look = strand.look + index16(yarns.looks.len());
                    spin(bundle, axis, spans, number, &mut |fibre| {
                        spun.push_strand(fibre.iter().copied(), look)
                    });
                }
                None => spun.push_strand(
                    points[spans.start..=spans.end].iter().map(|point| point.as_vec3()),
                    strand.look,
                ),
            }
        }
    }
    Some(spun)
}

/// Bundles whose fibres are as thick as pixels can tell, and as few as memory holds, over so many
/// mm and spans of each yarn.
fn drawn(bundles: &[Bundle], lengths: &[(f64, f64)], pixel: f64) -> Vec<Bundle> {
    let mut finest = FINEST * pixel / 2.0;
    loop {
        let thicker = |bundle: &Bundle| {
            let packing = f64::from(bundle.count) * (bundle.fibre / bundle.radius).powi(2);
            Bundle::filling(bundle.radius, packing, bundle.fibre.max(finest), bundle.slope)
        };
        let drawn: Vec<Bundle> = bundles.iter().map(thicker).collect();
        // A span has two points at the least.
        let points = |(bundle, (length, spans)): (&Bundle, &(f64, f64))| {
            f64::from(bundle.count) * (bundle.points_per_mm() * length).max(2.0 * spans)
        };
        let all: f64 = drawn.iter().zip(lengths).map(points).sum();
        if all <= MOST_POINTS || drawn.iter().all(|bundle| bundle.count == 1) {
            return drawn;
        }
        finest = finest.max(FIBRE_RADIUS) * (all / MOST_POINTS).sqrt().max(1.01);
    }
}

fn index16(count: usize) -> u16 {
    u16::try_from(count).expect("a fabric has a hundred bars at most")
}

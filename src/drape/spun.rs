//! Yarns as their fibres, for files and for close-up pictures.
//!
//! In: a fabric's yarns, as [`Block`]s or as a [`Scene`]. Out: the same with one strand for each
//! fibre. In a scene only the parts of yarns near the camera become fibres: level of detail by
//! screen size. Their fibres are no thinner than pixels can show. So memory is bounded by the
//! picture and not by the garment.
//!
//! Cost: linear in the fibres' points. A scene also takes a pass over all its points to find the
//! near parts.
//!
//! Not promised: data points of fibres. They have none, and their stitches are those of their
//! yarns.

use glam::DVec3;

use super::Block;
use super::strands::Strand;
use crate::fabric::Fabric;
use crate::ids::index32;
use crate::render::Camera;
use crate::render::ply::MIDDLING_SLOPE;
use crate::scene::{Scene, YarnLook};
use crate::yarn::fibres::{Axis, Bundle, FIBRE_RADIUS, for_each_fibre};
use crate::yarn::tube::Section;

/// Width of a yarn in pixels from which on it is drawn as fibres. A picture at this width shows
/// single fibres; far below it they would be thinner than a pixel.
pub const MIN_YARN_PIXELS: f64 = 36.0;
/// Least width of a drawn fibre, pixels. Thinner ones alias into noise; thicker ones look like
/// wire.
const MIN_FIBRE_PIXELS: f64 = 0.9;
/// The largest number of fibre points in a picture. It takes a gigabyte once rays are traced.
const MAX_POINTS: f64 = 4e6;
/// How far yarns become fibres beside the picture, relative to its half size. They cast shadows
/// into it. At 1 the shadows at the border would be those of plain yarns.
const MARGIN: f64 = 1.15;

/// The fibres of each of a fabric's yarns. `radius` is that of the thickest yarn, mm. `fibre` is
/// the radius of a fibre, mm, of the cloth before enlargement.
#[must_use]
pub fn bundles(fabric: &Fabric, radius: f64, fibre: f64) -> Vec<Bundle> {
    let mut bundles = Vec::with_capacity(fabric.bars.len());
    for (bar, thickness) in fabric.bars.iter().zip(fabric.thickness()) {
        let slope = bar.yarn.twist_slope().unwrap_or_else(|| MIDDLING_SLOPE.into());
        let fibre = fibre * fabric.enlargement;
        bundles.push(Bundle::filling(radius * thickness, bar.yarn.packing, fibre, slope));
    }
    bundles
}

/// The fabric whose yarns are the fibres of another fabric's yarns. Writers ask it how thick their
/// strands are.
#[must_use]
pub fn fabric(yarns: &Fabric, bundles: &[Bundle]) -> Fabric {
    let mut fibres = yarns.clone();
    for (bar, bundle) in fibres.bars.iter_mut().zip(bundles) {
        // A yarn's count is its mass by length, so it falls with the area of the section.
        bar.yarn.count = bar.yarn.count.times((bundle.fibre / bundle.radius).powi(2));
        (bar.yarn.plies, bar.yarn.twist) = (Some(1), None);
    }
    fibres
}

/// A block of fibres in place of a block of yarns, with tubes if a `surface` is given. A yarn's
/// fibres have its number. Their positions on the flat panel are unknown.
#[must_use]
pub fn block(yarns: &Block, bundle: &Bundle, surface: Option<&Section>) -> Block {
    let mut fibres = Block {
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
        // The yarn's point that each sample follows: fibres take their normals and tags from it.
        let followed: Vec<usize> =
            axis.spans_of(spans.clone()).map(|span| range.start + span).collect();
        // The seed is that of the strand, so that its fibres don't depend on how yarns are divided
        // into blocks.
        let seed = u64::from(strand.yarn.0) << 32 | u64::from(strand.points.start);
        for_each_fibre(bundle, &axis, spans, seed, &mut |points| {
            let (first, first_piece) =
                (index32(fibres.draped.positions.len()), index32(fibres.strands.pieces.len()));
            fibres.draped.positions.extend(points.iter().map(|point| point.as_dvec3()));
            fibres.draped.normals.extend(followed.iter().map(|&at| yarns.draped.normals[at]));
            fibres.strands.sources.extend(followed.iter().map(|&at| yarns.strands.sources[at]));
            let end = index32(fibres.draped.positions.len());
            // Each span of a fibre is a piece of its own: a tube gets St segments a piece.
            fibres.strands.pieces.extend(first..end - 1);
            let pieces = first_piece..index32(fibres.strands.pieces.len());
            fibres.strands.strands.push(Strand { yarn: strand.yarn, points: first..end, pieces });
        });
    }
    if let Some(section) = surface {
        fibres.add_tubes(&Section { radius: bundle.fibre, ..*section }, 1.0);
    }
    fibres
}

/// Decides which parts of yarns are near enough to be drawn as fibres.
struct NearTest<'a> {
    camera: &'a Camera,
    aspect: f64,
    /// Height of the picture, pixels.
    height: u32,
    /// Diameter of the thickest yarn, mm. One diameter for all: of yarns side by side either all
    /// show their fibres or none does.
    widest: f64,
    /// Least width of a yarn that shows its fibres, pixels.
    near: f64,
}

impl NearTest<'_> {
    /// The size of a pixel at a point, mm.
    fn pixel(&self, point: DVec3) -> f64 {
        self.camera.pixel_size(point.distance(self.camera.eye()), self.height)
    }

    /// Whether a point lies within the picture and its margin, and yarns are wide enough there.
    fn is_near(&self, point: &DVec3) -> bool {
        let projected = self.camera.project(*point, self.aspect);
        projected.is_some_and(|at| at.abs().max_element() < MARGIN)
            && self.widest > self.near * self.pixel(*point)
    }
}

/// For each look the length and the number of the near spans, and the smallest pixel there, mm. The
/// pixel is infinite where no span is near.
fn near_lengths(yarns: &Scene, test: &NearTest<'_>, looks: usize) -> (Vec<(f64, f64)>, f64) {
    let (mut lengths, mut finest) = (vec![(0.0, 0.0); looks], f64::INFINITY);
    for strand in &yarns.strands {
        let (look, points) = (usize::from(strand.look), controls(yarns, strand));
        for ends in points.windows(2).filter(|ends| ends.iter().any(|point| test.is_near(point))) {
            lengths[look].0 += ends[0].distance(ends[1]);
            lengths[look].1 += 1.0;
            finest = finest.min(test.pixel(ends[0]));
        }
    }
    (lengths, finest)
}

/// The control points of a scene's strand, mm.
fn controls(scene: &Scene, strand: &crate::scene::Strand) -> Vec<DVec3> {
    scene.positions[strand.points.start as usize..strand.points.end as usize]
        .iter()
        .map(|point| point.as_dvec3())
        .collect()
}

/// A scene whose yarns are fibres wherever the camera sees them at least `near` pixels wide, or
/// nothing where no yarn is that wide.
///
/// `bundles` has a bundle for each look, whose fibres may be drawn thicker. The last numbers are
/// the picture's width and height in pixels.
#[must_use]
pub fn scene(
    yarns: &Scene,
    bundles: &[Bundle],
    near: f64,
    camera: &Camera,
    [width, height]: [u32; 2],
) -> Option<Scene> {
    let test = NearTest {
        camera,
        aspect: f64::from(width) / f64::from(height),
        height,
        widest: 2.0 * bundles.iter().map(|bundle| bundle.radius).fold(0.0, f64::max),
        near,
    };
    // First pass: the near spans decide how many fibres memory allows.
    let (lengths, finest) = near_lengths(yarns, &test, bundles.len());
    if !finest.is_finite() {
        return None;
    }
    let drawn = drawn_bundles(bundles, &lengths, finest);
    let mut fibres = Scene {
        looks: with_fibre_looks(&yarns.looks, &drawn),
        shape: yarns.shape,
        maps: yarns.maps.clone(),
        ..Scene::default()
    };
    // Second pass: each strand is split into runs of near and far spans.
    for (number, strand) in (0_u64..).zip(&yarns.strands) {
        let (look, points) = (usize::from(strand.look), controls(yarns, strand));
        let bundle = &drawn[look];
        let near_spans: Vec<bool> =
            points.windows(2).map(|ends| ends.iter().any(|point| test.is_near(point))).collect();
        // The axis is that of the whole strand: the frame at a span depends on all spans before it,
        // so fibres would jump from picture to picture if it began where the picture does.
        let axis =
            near_spans.contains(&true).then(|| Axis::through(&points, bundle.points_per_mm()));
        let mut first = 0;
        for run in near_spans.chunk_by(|a, b| a == b) {
            let spans = first..first + run.len();
            first = spans.end;
            match axis.as_ref().filter(|_| run[0]) {
                Some(axis) => {
                    let look = strand.look + index16(yarns.looks.len());
                    for_each_fibre(bundle, axis, spans, number, &mut |fibre| {
                        fibres.push_strand(fibre.iter().copied(), look);
                    });
                }
                None => fibres.push_strand(
                    points[spans.start..=spans.end].iter().map(|point| point.as_vec3()),
                    strand.look,
                ),
            }
        }
    }
    Some(fibres)
}

/// The looks of yarns, followed by those of their fibres: the fibre of look i has look i plus the
/// number of yarns' looks.
fn with_fibre_looks(yarns: &[YarnLook], bundles: &[Bundle]) -> Vec<YarnLook> {
    let mut looks = yarns.to_vec();
    looks.extend(yarns.iter().zip(bundles).map(|(look, bundle)| YarnLook {
        radius: crate::yarn::narrow(bundle.fibre),
        plies: 1,
        twist_slope: Some(0.0),
        maps: None,
        ..*look
    }));
    looks
}

/// Bundles whose fibres are at least about a pixel thick and whose points fit in memory.
/// `lengths` has for each bundle the length in mm and the number of spans that become fibres.
fn drawn_bundles(bundles: &[Bundle], lengths: &[(f64, f64)], pixel: f64) -> Vec<Bundle> {
    let mut finest = MIN_FIBRE_PIXELS * pixel / 2.0;
    loop {
        // Thicker fibres are fewer, so that the share of the section that they fill stays the same.
        let drawn: Vec<Bundle> = bundles
            .iter()
            .map(|bundle| {
                let packing = f64::from(bundle.count) * (bundle.fibre / bundle.radius).powi(2);
                Bundle::filling(bundle.radius, packing, bundle.fibre.max(finest), bundle.slope)
            })
            .collect();
        // A span has at least two points.
        let all: f64 = drawn
            .iter()
            .zip(lengths)
            .map(|(bundle, (length, spans))| {
                f64::from(bundle.count) * (bundle.points_per_mm() * length).max(2.0 * spans)
            })
            .sum();
        if all <= MAX_POINTS || drawn.iter().all(|bundle| bundle.count == 1) {
            return drawn;
        }
        // The number of fibres falls with the square of their radius, hence the root. Rounded
        // counts may miss the goal by a little; at least 1 % a round makes sure that it ends.
        finest = finest.max(FIBRE_RADIUS) * (all / MAX_POINTS).sqrt().max(1.01);
    }
}

fn index16(count: usize) -> u16 {
    u16::try_from(count).expect("a fabric has a hundred bars at most")
}

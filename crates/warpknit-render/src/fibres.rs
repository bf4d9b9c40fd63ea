//! Yarns as their fibres, for close-up pictures.
//!
//! In: a [`Scene`] of yarns and a camera. Out: the same with one strand for each fibre. Only the
//! parts of yarns near the camera become fibres: level of detail by screen size. Their fibres are
//! no thinner than pixels can show. So memory is bounded by the picture and not by the garment.
//!
//! Cost: linear in the fibres' points, after a pass over all points of the scene to find the near
//! parts.

use glam::DVec3;
use warpknit_core::number::narrow;
use warpknit_core::yarn::fibres::{Axis, Bundle, FIBRE_RADIUS, for_each_fibre};

use crate::Camera;
use crate::scene::{Scene, SceneStrand, YarnKind, YarnLook};

/// Width of a yarn in pixels from which on it is drawn as fibres. A picture at this width shows
/// single fibres; far below it they would be thinner than a pixel.
pub const MIN_YARN_PIXELS: f64 = 36.0;
/// Least width of a drawn fibre, pixels. Thinner ones alias into noise; thicker ones look like
/// wire.
pub(crate) const MIN_FIBRE_PIXELS: f64 = 0.9;
/// The largest number of fibre points in a picture. It takes a gigabyte once rays are traced.
const MAX_POINTS: f64 = 4e6;
/// How far yarns become fibres beside the picture, relative to its half size. They cast shadows
/// into it. At 1 the shadows at the border would be those of plain yarns.
const MARGIN: f64 = 1.15;

/// What a camera sees, and how large.
pub(crate) struct PictureFrame<'a> {
    camera: &'a Camera,
    aspect: f64,
    /// Height of the picture, pixels.
    height: u32,
}

impl<'a> PictureFrame<'a> {
    /// The frame of a picture of this width and height in pixels.
    pub(crate) fn new(camera: &'a Camera, [width, height]: [u32; 2]) -> Self {
        Self { camera, aspect: f64::from(width) / f64::from(height), height }
    }

    /// The size of a pixel at a point, mm.
    pub(crate) fn pixel(&self, point: DVec3) -> f64 {
        self.camera.pixel_size(point.distance(self.camera.eye()), self.height)
    }

    /// Whether a point lies within the picture, or beside it by less than `reach` mm and some pixels.
    pub(crate) fn contains(&self, point: DVec3, reach: f64) -> bool {
        let half = 0.5 * f64::from(self.height) * self.aspect.min(1.0) * self.pixel(point);
        let projected = self.camera.project(point, self.aspect);
        projected.is_some_and(|at| at.abs().max_element() < MARGIN + reach / half)
    }
}

/// Decides which parts of yarns are near enough to be drawn as fibres.
struct NearTest<'a> {
    frame: PictureFrame<'a>,
    /// Diameter of the thickest yarn, mm. One diameter for all: of yarns side by side either all
    /// show their fibres or none does.
    widest: f64,
    /// Least width of a yarn that shows its fibres, pixels.
    near: f64,
}

impl NearTest<'_> {
    /// Whether a point lies within the picture and its margin, and yarns are wide enough there.
    fn is_near(&self, point: &DVec3) -> bool {
        self.frame.contains(*point, 0.0) && self.widest > self.near * self.frame.pixel(*point)
    }
}

/// For each look the length and the number of the near spans, and the smallest pixel there, mm. The
/// pixel is infinite where no span is near.
fn near_lengths(yarns: &Scene, test: &NearTest<'_>, looks: usize) -> (Vec<(f64, f64)>, f64) {
    let (mut lengths, mut finest) = (vec![(0.0, 0.0); looks], f64::INFINITY);
    for strand in yarns.strands.iter().filter(|strand| usize::from(strand.look) < looks) {
        let (look, points) = (usize::from(strand.look), controls(yarns, strand));
        for ends in points.windows(2).filter(|ends| ends.iter().any(|point| test.is_near(point))) {
            lengths[look].0 += ends[0].distance(ends[1]);
            lengths[look].1 += 1.0;
            finest = finest.min(test.frame.pixel(ends[0]));
        }
    }
    (lengths, finest)
}

/// The control points of a scene's strand, mm.
pub(crate) fn controls(scene: &Scene, strand: &SceneStrand) -> Vec<DVec3> {
    scene.positions[strand.points.start as usize..strand.points.end as usize]
        .iter()
        .map(|point| point.as_dvec3())
        .collect()
}

/// A scene whose yarns are fibres wherever the camera sees them at least `near` pixels wide, or
/// nothing where no yarn is that wide.
///
/// `bundles` has a bundle for each look, whose fibres may be drawn thicker. Looks after them are drawn
/// whole: sewing threads. The last numbers are the picture's width and height in pixels.
#[must_use]
pub fn scene(
    yarns: &Scene,
    bundles: &[Bundle],
    near: f64,
    camera: &Camera,
    size: [u32; 2],
) -> Option<Scene> {
    let test = NearTest {
        frame: PictureFrame::new(camera, size),
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
        extent: yarns.extent,
        ..Scene::default()
    };
    // Second pass: each strand is split into runs of near and far spans.
    for strand in &yarns.strands {
        let points = controls(yarns, strand);
        let bundle = drawn.get(usize::from(strand.look));
        let is_near =
            |ends: &[DVec3]| bundle.is_some() && ends.iter().any(|point| test.is_near(point));
        let near_spans: Vec<bool> = points.windows(2).map(is_near).collect();
        // The axis is that of the whole strand: the frame at a span depends on all spans before it,
        // so fibres would jump from picture to picture if it began where the picture does.
        let near_bundle = bundle.filter(|_| near_spans.contains(&true));
        let fibrous =
            near_bundle.map(|bundle| (bundle, Axis::through(&points, bundle.points_per_mm())));
        let mut first = 0;
        for run in near_spans.chunk_by(|a, b| a == b) {
            let spans = first..first + run.len();
            first = spans.end;
            match fibrous.as_ref().filter(|_| run[0]) {
                Some((bundle, axis)) => {
                    let look = strand.look + index16(yarns.looks.len());
                    for_each_fibre(bundle, axis, spans, u64::from(strand.yarn), &mut |fibre| {
                        fibres.push_strand(fibre.iter().copied(), look);
                    });
                }
                None => {
                    let [start, end] =
                        [spans.start, spans.end + 1].map(warpknit_core::ids::index32);
                    let first = strand.points.start;
                    fibres.push_range(yarns, first + start..first + end, strand.look);
                }
            }
        }
    }
    Some(fibres)
}

/// The looks of yarns, followed by those of their fibres: the fibre of look i has look i plus the
/// number of yarns' looks.
fn with_fibre_looks(yarns: &[YarnLook], bundles: &[Bundle]) -> Vec<YarnLook> {
    let mut looks = yarns.to_vec();
    looks.extend(yarns.iter().zip(bundles).map(|(look, bundle)| fibre_look(look, bundle.fibre)));
    looks
}

/// The look of a fibre of this radius, mm, in a yarn of this look.
pub(crate) fn fibre_look(yarn: &YarnLook, radius: f64) -> YarnLook {
    YarnLook {
        radius: narrow(radius),
        flatten: 1.0,
        plies: 1,
        twist_slope: Some(0.0),
        maps: None,
        kind: YarnKind::Fibre,
        ..*yarn
    }
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

pub(crate) fn index16(count: usize) -> u16 {
    u16::try_from(count).expect("a fabric has a hundred bars at most")
}

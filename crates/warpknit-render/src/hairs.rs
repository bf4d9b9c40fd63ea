//! Hairs on spun yarns, for pictures from near.
//!
//! In: a [`Scene`] of yarns, the [`Bundle`] of each look, and a camera. Out: the scene with a strand
//! for each hair that the picture shows. Level of detail is continuous: hairs fade in, one by one, as
//! their yarn grows on the screen, and they are no thinner than pixels can show.
//!
//! Cost: linear in the hairs, after a pass over all points of the scene.

use glam::{DVec3, Vec3};
use warpknit_core::yarn::fibres::Bundle;
use warpknit_core::yarn::hairs::{Hairs, for_each_hair};

use crate::Camera;
use crate::fibres::{MIN_FIBRE_PIXELS, PictureFrame, controls, fibre_look, index16};
use crate::scene::{Scene, SceneStrand};

/// Widths of a yarn in pixels: hairs begin to show at the first and are all there at the second. On a
/// narrower yarn they would be a haze that no one tells from the yarn.
const FADE: [f64; 2] = [8.0, 16.0];
/// The largest number of hairs in a picture. It takes some 200 MB once rays are traced.
const MAX_HAIRS: f64 = 150_000.0;

/// A scene with the hairs that a picture shows. `close_up` is the scene of fibres that stands for the
/// yarns in this picture, where there is one. Nothing where the picture shows no hair, and `close_up`
/// is none.
///
/// `bundles` has a bundle for each of the first looks. A yarn with textures shows its hairs in these,
/// and gets no others. `size` is the picture's width and height in pixels.
#[must_use]
pub fn with_hairs(
    yarns: &Scene,
    close_up: Option<Scene>,
    bundles: &[Bundle],
    camera: &Camera,
    size: [u32; 2],
) -> Option<Scene> {
    let frame = PictureFrame::new(camera, size);
    let hairs: Vec<Option<Hairs>> = bundles
        .iter()
        .zip(&yarns.looks)
        .map(|(bundle, look)| bundle.hairs.filter(|_| look.maps.is_none()))
        .collect();
    let widest = hairs.iter().flatten().map(|hairs| 2.0 * hairs.yarn).fold(0.0, f64::max);
    if widest <= FADE[0] * finest_pixel(yarns, camera, &frame) {
        return close_up;
    }
    let seen = Visible::of(yarns, &hairs, &frame);
    if seen.count == 0.0 {
        return close_up;
    }
    let share = (MAX_HAIRS / seen.count).min(1.0);
    let mut scene = close_up.unwrap_or_else(|| yarns.clone());
    let first_look = scene.looks.len();
    let drawn: Vec<_> = hairs
        .iter()
        .map(|hairs| hairs.map(|hairs| hairs.at_least(MIN_FIBRE_PIXELS * seen.finest / 2.0)))
        .collect();
    for (look, hairs) in yarns.looks.iter().zip(&drawn) {
        let radius = hairs.map_or(f64::from(look.radius), |hairs| hairs.radius);
        scene.looks.push(fibre_look(look, radius));
    }
    for strand in yarns.strands.iter().filter(|strand| !strand.is_shadow) {
        let Some(Some(hairs)) = drawn.get(usize::from(strand.look)) else { continue };
        let look = index16(first_look) + strand.look;
        add_hairs(&mut scene, strand, &controls(yarns, strand), (hairs, look), share, &frame);
    }
    Some(scene)
}

/// Appends the hairs of a strand through `points`.
fn add_hairs(
    scene: &mut Scene,
    strand: &SceneStrand,
    points: &[DVec3],
    (hairs, look): (&Hairs, u16),
    share: f64,
    frame: &PictureFrame<'_>,
) {
    for (span, number) in (0..points.len().saturating_sub(1)).zip(strand.first..) {
        let share = share * shown_share(hairs, points[span], frame);
        if share == 0.0 {
            continue;
        }
        let mut take = |hair: &[Vec3]| {
            scene.push_strand(hair.iter().copied(), look);
            // A hair is as light as its yarn.
            scene.strands.last_mut().expect("added just now").yarn = strand.yarn;
        };
        for_each_hair(hairs, points, span, (strand.yarn, number), share, &mut take);
    }
}

/// The share of a yarn's hairs that is drawn at a point.
fn shown_share(hairs: &Hairs, point: DVec3, frame: &PictureFrame<'_>) -> f64 {
    if !frame.holds(point) {
        return 0.0;
    }
    let width = 2.0 * hairs.yarn / frame.pixel(point);
    ((width - FADE[0]) / (FADE[1] - FADE[0])).clamp(0.0, 1.0)
}

/// A pixel that is no larger than any on the scene, mm.
fn finest_pixel(yarns: &Scene, camera: &Camera, frame: &PictureFrame<'_>) -> f64 {
    let eye = camera.eye();
    yarns.bounds().map_or(f64::INFINITY, |bounds| {
        frame.pixel(eye.clamp(bounds.min.as_dvec3(), bounds.max.as_dvec3()))
    })
}

/// The hairs that a picture shows.
struct Visible {
    /// Their number.
    count: f64,
    /// The smallest pixel on their yarns, mm.
    finest: f64,
}

impl Visible {
    fn of(yarns: &Scene, hairs: &[Option<Hairs>], frame: &PictureFrame<'_>) -> Self {
        let mut seen = Self { count: 0.0, finest: f64::INFINITY };
        for strand in yarns.strands.iter().filter(|strand| !strand.is_shadow) {
            let Some(Some(hairs)) = hairs.get(usize::from(strand.look)) else { continue };
            for ends in controls(yarns, strand).windows(2) {
                let share = shown_share(hairs, ends[0], frame);
                if share > 0.0 {
                    seen.count += share * hairs.per_mm * ends[0].distance(ends[1]);
                    seen.finest = seen.finest.min(frame.pixel(ends[0]));
                }
            }
        }
        seen
    }
}

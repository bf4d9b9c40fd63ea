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
use crate::scene::{Scene, SceneStrand, YarnLook};

/// Widths of a yarn in pixels: hairs begin to show at the first and are all there at the second. On a
/// narrower yarn they would be a haze that no one tells from the yarn.
const FADE: [f64; 2] = [8.0, 16.0];
/// The largest number of hairs in a picture. More become fewer and thicker ones.
const MAX_HAIRS: f64 = 150_000.0;
/// Memory of a hair: its points, and the pieces that rays are traced against.
const HAIR_BYTES: f64 = 1000.0;
/// Power of a yarn's base colour, 0..1, that is its hairs'. With this one cloth keeps its mean colour as
/// hairs fade in: they are lighter than yarn, and their shadows are darker.
const PALENESS: f32 = 0.67;
/// How far beside the picture yarns have hairs, mm of cloth in life. Few are longer.
const REACH: f64 = 2.0;

/// A scene with the hairs that a picture shows, or `close_up` where it shows none. `close_up` is the
/// scene of fibres that stands for the yarns in this picture, where there is one.
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
    let widest = hairs.iter().flatten().map(|hairs| 2.0 * hairs.yarn_radius).fold(0.0, f64::max);
    if widest <= FADE[0] * finest_pixel(yarns, camera, &frame) {
        return close_up;
    }
    let Some(hairs) = drawn(yarns, hairs, &frame) else { return close_up };
    let mut scene = close_up.unwrap_or_else(|| yarns.clone());
    let first_look = scene.looks.len();
    for (look, hairs) in yarns.looks.iter().zip(&hairs) {
        let radius = hairs.map_or(f64::from(look.radius), |hairs| hairs.radius);
        scene.looks.push(hair_look(look, radius));
    }
    for strand in yarns.strands.iter().filter(|strand| !strand.is_shadow) {
        let Some(Some(hairs)) = hairs.get(usize::from(strand.look)) else { continue };
        let look = index16(first_look) + strand.look;
        add_hairs(&mut scene, strand, &controls(yarns, strand), (hairs, look), &frame);
    }
    Some(scene)
}

/// Memory of the hairs in a picture of a cloth, bytes. `length` is that of its yarns, mm, and `pixel`
/// the size of a pixel on the cloth.
#[must_use]
pub fn bytes(bundles: &[Bundle], length: f64, pixel: f64) -> f64 {
    let wide = bundles.iter().filter(|bundle| 2.0 * bundle.radius > FADE[0] * pixel);
    let per_mm = wide.filter_map(|bundle| Some(bundle.hairs?.per_mm)).fold(0.0, f64::max);
    HAIR_BYTES * (per_mm * length).min(MAX_HAIRS)
}

/// The look of a hair of this radius, mm, on a yarn of this look. Light meets many fibres before it
/// leaves a yarn, and one in a hair, so a hair is paler.
fn hair_look(yarn: &YarnLook, radius: f64) -> YarnLook {
    let albedo = yarn.albedo.max(Vec3::ZERO).powf(PALENESS);
    YarnLook { albedo, ..fibre_look(yarn, radius) }
}

/// Appends the hairs of a strand through `points`.
fn add_hairs(
    scene: &mut Scene,
    strand: &SceneStrand,
    points: &[DVec3],
    (hairs, look): (&Hairs, u16),
    frame: &PictureFrame<'_>,
) {
    let spans = (0..points.len().saturating_sub(1)).zip(strand.first..);
    for (span, number) in spans.skip(strand.lead as usize) {
        let share = shown_share(hairs, points[span], frame);
        if share == 0.0 {
            continue;
        }
        let mut take = |hair: &[Vec3]| {
            scene.push_strand(hair.iter().copied(), look);
            // Its yarn decides how far it is off the mean lightness.
            scene.strands.last_mut().expect("added just now").yarn = strand.yarn;
        };
        for_each_hair(hairs, points, span, (strand.yarn, number), share, &mut take);
    }
}

/// The share of a yarn's hairs that is drawn at a point.
fn shown_share(hairs: &Hairs, point: DVec3, frame: &PictureFrame<'_>) -> f64 {
    if !frame.contains(point, REACH * hairs.scale) {
        return 0.0;
    }
    let width = 2.0 * hairs.yarn_radius / frame.pixel(point);
    ((width - FADE[0]) / (FADE[1] - FADE[0])).clamp(0.0, 1.0)
}

/// A pixel that is no larger than any on the scene, mm.
fn finest_pixel(yarns: &Scene, camera: &Camera, frame: &PictureFrame<'_>) -> f64 {
    let eye = camera.eye();
    yarns.bounds().map_or(f64::INFINITY, |bounds| {
        frame.pixel(eye.clamp(bounds.min.as_dvec3(), bounds.max.as_dvec3()))
    })
}

/// The hairs of each look as a picture draws them: no thinner than pixels can show, and no more than
/// [`MAX_HAIRS`]. `None` where the picture shows none.
fn drawn(
    yarns: &Scene,
    hairs: Vec<Option<Hairs>>,
    frame: &PictureFrame<'_>,
) -> Option<Vec<Option<Hairs>>> {
    let (mut lengths, mut finest) = (vec![0.0; hairs.len()], f64::INFINITY);
    for strand in yarns.strands.iter().filter(|strand| !strand.is_shadow) {
        let Some(Some(hairs)) = hairs.get(usize::from(strand.look)) else { continue };
        let points = controls(yarns, strand);
        for ends in points.windows(2).skip(strand.lead as usize) {
            let share = shown_share(hairs, ends[0], frame);
            if share > 0.0 {
                // In numbers of hairs, which are limited on a stray span.
                lengths[usize::from(strand.look)] +=
                    share * hairs.between(ends[0].distance(ends[1])) / hairs.per_mm;
                finest = finest.min(frame.pixel(ends[0]));
            }
        }
    }
    if !finest.is_finite() {
        return None;
    }
    let visible = |hairs: Hairs| hairs.at_least(MIN_FIBRE_PIXELS * finest / 2.0);
    let hairs: Vec<_> = hairs.into_iter().map(|hairs| hairs.map(visible)).collect();
    let numbers = hairs
        .iter()
        .zip(&lengths)
        .map(|(hairs, length)| hairs.map_or(0.0, |it| it.per_mm) * length);
    let excess = (numbers.sum::<f64>() / MAX_HAIRS).max(1.0);
    let fewer = |hairs: Hairs| hairs.at_least(hairs.radius * excess);
    Some(hairs.into_iter().map(|hairs| hairs.map(fewer)).collect())
}

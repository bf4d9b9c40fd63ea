//! Copies of a segment, each in its own frame and straightened: along the yarn to the right, across
//! it downwards.
//!
//! In: the photo, and the positions of the copies. Out: one plane for each copy, all of one size, a
//! pixel of the photo to a pixel. The yarn's own shading is taken off: it is what all copies share,
//! while each copy has fibres of its own.
//!
//! Cost: one bilinear sample a pixel. Not promised: copies at the rim of the photo, which are left
//! out.

use glam::DVec2;
use image::RgbImage;
use image::imageops::crop_imm;
use rayon::prelude::*;

use super::super::segment::Segment;
use super::super::steps;
use super::PhotoRegistration;
use crate::plane::{Plane, double, float, narrow, side, whole};

/// Copies from which on their mean is taken off. The mean of fewer copies holds much of each copy's
/// own fibres.
const MIN_COPIES_FOR_MEAN: usize = 4;

/// The position of a copy, pixels of the photo.
#[derive(Clone, Copy, Debug)]
pub(super) struct CopyFrame {
    pub(super) middle: DVec2,
    /// Along the yarn, of unit length.
    pub(super) direction: DVec2,
}

/// All copies of a segment that the view holds, the one nearest to its middle first.
pub(super) fn frames(registration: &PhotoRegistration, segment: &Segment) -> Vec<CopyFrame> {
    let matrix = registration.lattice.matrix();
    let inverse = matrix.inverse();
    let to_photo = |at: DVec2| registration.corner + at / registration.scale;
    let view = registration.view;
    let corners =
        [DVec2::ZERO, view.with_x(0.0), view.with_y(0.0), view].map(|corner| inverse * corner);
    let low = corners.into_iter().fold(DVec2::INFINITY, DVec2::min).floor();
    let high = corners.into_iter().fold(DVec2::NEG_INFINITY, DVec2::max).ceil();
    let [first, own, last] = [-0.5, 0.0, 0.5].map(|share| segment.axis(share * segment.length).0);
    let mut frames = Vec::new();
    for j in steps(low.y) - 1..=steps(high.y) {
        for i in steps(low.x) - 1..=steps(high.x) {
            let copy = matrix * DVec2::new(f64::from(i), f64::from(j));
            // The displacement of the cloth moves and turns each copy a little.
            let [middle, first, last] = [own, first, last]
                .map(|place| registration.field.pixel_at(inverse * (place + copy)));
            let radius = segment.bounding_radius();
            let is_in = middle.cmpge(DVec2::splat(radius)).all()
                && (middle + radius).cmple(view - 1.0).all();
            if is_in {
                frames.push(CopyFrame {
                    middle: to_photo(middle),
                    direction: (last - first).normalize_or(DVec2::X),
                });
            }
        }
    }
    let centre = to_photo(0.5 * view);
    frames.sort_by(|p, q| {
        p.middle.distance_squared(centre).total_cmp(&q.middle.distance_squared(centre))
    });
    frames
}

/// A number of copies as an integer; one at least.
pub(super) fn bounded(count: f64) -> usize {
    whole(narrow(count)).max(1)
}

/// The difference of each copy of a segment from the mean of all copies. The segment and `size`,
/// along and across it, are in pixels of the photo.
pub(super) fn details(
    photo: &RgbImage,
    frames: &[CopyFrame],
    segment: &Segment,
    size: DVec2,
) -> Vec<Plane> {
    let [columns, rows] = size.to_array().map(|side| 2 * whole(narrow(0.5 * side)) + 1);
    let axis = straightened(segment, columns);
    let patches: Vec<Plane> =
        frames.par_iter().map(|frame| patch(photo, frame, &axis, rows)).collect();
    if patches.len() < MIN_COPIES_FOR_MEAN {
        return patches;
    }
    let mean = Plane::from_fn(columns, rows, |x, y| {
        patches.iter().map(|patch| patch.at(x, y)).sum::<f32>() / float(patches.len())
    });
    patches.iter().map(|patch| patch.zip(&mean, |value, mean| value - mean)).collect()
}

/// The point of the axis for each column, one pixel of arc length apart, relative to the middle in
/// the frame of a segment; and the unit vector across the axis there.
fn straightened(segment: &Segment, columns: usize) -> Vec<(DVec2, DVec2)> {
    let flat = Segment { centre: DVec2::ZERO, angle: 0.0, ..*segment };
    let middle = flat.axis(0.0).0;
    let half = columns / 2;
    let mut along = walk(&flat, -1.0, half);
    along.reverse();
    along.push(0.0);
    along.extend(walk(&flat, 1.0, half));
    along
        .into_iter()
        .map(|along| flat.axis(along))
        .map(|(place, angle)| (place - middle, DVec2::from_angle(angle).perp()))
        .collect()
}

/// Positions on the chord of the points one, two and more pixels along the axis from its middle, in
/// the direction of `sign`.
fn walk(segment: &Segment, sign: f64, count: usize) -> Vec<f64> {
    let mut along = 0.0;
    (0..count)
        .map(|_| {
            // Euler's method on d(chord)/d(arc) = cos(turn), with steps of a quarter of a pixel.
            for _ in 0..4 {
                along += 0.25 * sign * segment.axis(along).1.cos();
            }
            along
        })
        .collect()
}

/// A patch along an axis that is given by [`straightened`].
fn patch(photo: &RgbImage, frame: &CopyFrame, axis: &[(DVec2, DVec2)], rows: usize) -> Plane {
    let half = 0.5 * double(rows - 1);
    let place = |u: usize, offset: f64| {
        frame.middle + frame.direction.rotate(axis[u].0 + axis[u].1 * offset)
    };
    // Only the bounding box of the patch is converted to lightness: a cube root a pixel.
    let edges = || (0..axis.len()).flat_map(|u| [place(u, -half), place(u, half)]);
    let corners = [
        edges().fold(DVec2::INFINITY, DVec2::min) - 1.0,
        edges().fold(DVec2::NEG_INFINITY, DVec2::max) + 1.0,
    ];
    let limits = DVec2::new(f64::from(photo.width()), f64::from(photo.height())) - 1.0;
    let [low, high] = corners.map(|corner| corner.clamp(DVec2::ZERO, limits).floor());
    let [x, y] = low.to_array().map(|at| side(whole(narrow(at))));
    let [width, height] = (high - low).to_array().map(|size| side(whole(narrow(size))) + 1);
    let light = Plane::lightness(&crop_imm(photo, x, y, width, height).to_image());
    Plane::from_fn(axis.len(), rows, |u, v| light.sample(place(u, double(v) - half) - low))
}

#[cfg(test)]
mod tests {
    use image::Rgb;

    use super::*;

    const STRAIGHT: Segment = Segment::straight(DVec2::ZERO, 0.0, 10.0, 20.0, 1.0);

    #[test]
    fn a_patch_lies_along_the_yarn() {
        // Lighter towards the right, then turned by a quarter: lighter across the yarn, against its
        // left.
        let photo = RgbImage::from_fn(60, 60, |x, _| Rgb([u8::try_from(4 * x).unwrap(); 3]));
        let at = |middle: DVec2, direction: DVec2, segment: &Segment| {
            details(&photo, &[CopyFrame { middle, direction }], segment, DVec2::new(20.0, 10.0))
                .remove(0)
        };
        let along = at(DVec2::new(30.5, 30.0), DVec2::X, &STRAIGHT);
        assert!(
            along.at(20, 3) > along.at(0, 3) + 0.1
                && (along.at(4, 0) - along.at(4, 10)).abs() < 1e-6
        );
        let down = at(DVec2::new(30.0, 30.0), DVec2::Y, &STRAIGHT);
        assert!(
            down.at(4, 0) > down.at(4, 10) + 0.1 && (down.at(0, 5) - down.at(20, 5)).abs() < 1e-6
        );
        // One that bends to its right, which is the photo's left, is the lighter the farther from
        // its middle.
        let bent = at(DVec2::new(30.0, 30.0), DVec2::Y, &Segment { bow: 3.0, ..STRAIGHT });
        let lighter = |u: usize| bent.at(u, 5) - bent.at(10, 5);
        assert!(
            lighter(0) > 0.02
                && lighter(20) > 0.02
                && (bent.at(10, 5) - down.at(10, 5)).abs() < 1e-6,
            "{}",
            lighter(0)
        );
    }

    #[test]
    fn what_all_copies_share_is_taken_off() {
        let photo = RgbImage::from_fn(80, 80, |x, _| Rgb([if x % 20 < 10 { 40 } else { 200 }; 3]));
        let frames: Vec<CopyFrame> = (0..4)
            .map(|n| CopyFrame {
                middle: DVec2::new(40.0, 20.0 + 10.0 * f64::from(n)),
                direction: DVec2::X,
            })
            .collect();
        assert!(
            details(&photo, &frames, &STRAIGHT, DVec2::new(30.0, 10.0))
                .iter()
                .all(|detail| detail.mean_square() < 1e-9)
        );
        assert!(
            details(&photo, &frames[..1], &STRAIGHT, DVec2::new(30.0, 10.0))[0].mean_square()
                > 0.01
        );
    }
}

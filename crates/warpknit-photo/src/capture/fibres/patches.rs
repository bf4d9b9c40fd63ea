//! Copies of a segment, each in its own frame and straightened: along the yarn to the right, across
//! it downwards.
//!
//! In: the photo, and where the copies lie. Out: one plane a copy, all of a size, a pixel of the
//! photo a pixel, without the yarn's own shading: what all copies share isn't fibres, since each
//! copy has fibres of its own.
//!
//! Not promised: copies at the photo's rim, which are left out.

use glam::DVec2;
use image::RgbImage;
use image::imageops::crop_imm;
use rayon::prelude::*;

use super::super::segment::Segment;
use super::super::steps;
use super::Sight;
use crate::plane::{Plane, double, float, narrow, side, whole};

/// Copies from which on their mean says more of the yarn than of its fibres.
const ENOUGH: usize = 4;

/// Where a copy lies, pixels of the photo.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    pub(super) middle: DVec2,
    /// Along the yarn, of unit length.
    pub(super) way: DVec2,
}

/// All copies of a segment that the view holds, the one nearest to its middle first.
pub(super) fn frames(sight: &Sight, segment: &Segment) -> Vec<Frame> {
    let matrix = sight.lattice.matrix();
    let inverse = matrix.inverse();
    let photo = |at: DVec2| sight.corner + at / sight.scale;
    let corners = [DVec2::ZERO, sight.view.with_x(0.0), sight.view.with_y(0.0), sight.view]
        .map(|corner| inverse * corner);
    let low = corners.into_iter().fold(DVec2::INFINITY, DVec2::min).floor();
    let high = corners.into_iter().fold(DVec2::NEG_INFINITY, DVec2::max).ceil();
    let [first, own, last] = [-0.5, 0.0, 0.5].map(|share| segment.axis(share * segment.length).0);
    let mut frames = Vec::new();
    for j in steps(low.y) - 1..=steps(high.y) {
        for i in steps(low.x) - 1..=steps(high.x) {
            let copy = matrix * DVec2::new(f64::from(i), f64::from(j));
            let [middle, first, last] =
                [own, first, last].map(|place| sight.warp.place(inverse * (place + copy)));
            let reach = segment.reach();
            let is_in = middle.cmpge(DVec2::splat(reach)).all()
                && (middle + reach).cmple(sight.view - 1.0).all();
            if is_in {
                frames.push(Frame {
                    middle: photo(middle),
                    way: (last - first).normalize_or(DVec2::X),
                });
            }
        }
    }
    let centre = photo(0.5 * sight.view);
    frames.sort_by(|p, q| {
        p.middle.distance_squared(centre).total_cmp(&q.middle.distance_squared(centre))
    });
    frames
}

/// A count of copies from what they may cost; one at least.
pub(super) fn bounded(count: f64) -> usize {
    whole(narrow(count)).max(1)
}

/// What tells the copies of a segment from each other; it and `size`, along and across them, are in
/// pixels of the photo.
pub(super) fn details(
    photo: &RgbImage,
    frames: &[Frame],
    segment: &Segment,
    size: DVec2,
) -> Vec<Plane> {
    let [columns, rows] = size.to_array().map(|side| 2 * whole(narrow(0.5 * side)) + 1);
    let axis = straightened(segment, columns);
    let patches: Vec<Plane> =
        frames.par_iter().map(|frame| patch(photo, frame, &axis, rows)).collect();
    if patches.len() < ENOUGH {
        return patches;
    }
    let mean = Plane::from_fn(columns, rows, |x, y| {
        patches.iter().map(|patch| patch.at(x, y)).sum::<f32>() / float(patches.len())
    });
    patches.iter().map(|patch| patch.zip(&mean, |value, mean| value - mean)).collect()
}

/// Where so many columns lie, a pixel of the axis apart, from its middle in the frame of a segment;
/// and which way is across it there.
fn straightened(segment: &Segment, columns: usize) -> Vec<(DVec2, DVec2)> {
    let flat = Segment { centre: DVec2::ZERO, angle: 0.0, ..*segment };
    let middle = flat.axis(0.0).0;
    // A step along the axis is one along the line between its ends by the cosine of its turn; a
    // quarter of a pixel at a time.
    let walk = |from: f64, by: f64| {
        (0..4).fold(from, |along, _| along + 0.25 * by * flat.axis(along).1.cos())
    };
    let half = columns / 2;
    let side = |by: f64| {
        std::iter::successors(Some(0.0), move |along| Some(walk(*along, by))).skip(1).take(half)
    };
    let before = side(-1.0).collect::<Vec<_>>();
    let along = before.into_iter().rev().chain([0.0]).chain(side(1.0));
    along
        .map(|along| flat.axis(along))
        .map(|(place, angle)| (place - middle, DVec2::from_angle(angle).perp()))
        .collect()
}

/// A patch along an axis: where each column is from its middle in the frame, and which way is
/// across it there.
fn patch(photo: &RgbImage, frame: &Frame, axis: &[(DVec2, DVec2)], rows: usize) -> Plane {
    let half = 0.5 * double(rows - 1);
    let place = |u: usize, off: f64| frame.middle + frame.way.rotate(axis[u].0 + axis[u].1 * off);
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
    Plane::from_fn(axis.len(), rows, |u, v| light.between(place(u, double(v) - half) - low))
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
        let at = |middle: DVec2, way: DVec2, segment: &Segment| {
            details(&photo, &[Frame { middle, way }], segment, DVec2::new(20.0, 10.0)).remove(0)
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
        let frames: Vec<Frame> = (0..4)
            .map(|n| Frame { middle: DVec2::new(40.0, 20.0 + 10.0 * f64::from(n)), way: DVec2::X })
            .collect();
        assert!(
            details(&photo, &frames, &STRAIGHT, DVec2::new(30.0, 10.0))
                .iter()
                .all(|detail| detail.power() < 1e-9)
        );
        assert!(details(&photo, &frames[..1], &STRAIGHT, DVec2::new(30.0, 10.0))[0].power() > 0.01);
    }
}

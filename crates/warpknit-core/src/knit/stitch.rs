//! The eight-point stitch: where the yarn of one lap passes, relative to its guide's gap 0 and its
//! course.
//!
//! Source: Liu, Kyosev, Jiang 2022, section 2.1 and Fig. 2, with the [`Dimensions`] of the
//! specification's knit page, which also gives the least distances between yarns that they reach.
//! S1, S8 are the feet (behind, where the underlaps join), S2, S7 the lower legs, S3, S6 the upper
//! legs, S4, S5 the head.

use glam::DVec3;

use crate::fabric::Dimensions;

// Further bars nest inside those behind them: changes in radii, times the number of knitting bars
// behind on the same needle.
const NEST_X: f64 = -2.25;
const NEST_FEET_Y: f64 = -2.9;
const NEST_LOWER_Y: f64 = -1.1;
const NEST_HEAD_Y: f64 = -2.6;
const NEST_LOWER_Z: f64 = -0.3;
const NEST_UPPER_Z: f64 = 3.2;
const NEST_HEAD_Z: f64 = -0.9;
/// Nesting leaves a loop this share of its width, and its head at this height, courses.
const NARROWEST: f64 = 0.3;
const LOWEST_HEAD: f64 = 1.12;
/// Depth between the feet of two knitting bars on the same needles, radii. The specification has
/// 7.2, so that nothing cuts without relaxation; contact makes the room that is needed, and at 7.2
/// two-bar cloth is a fifth thicker and its front bar takes the more yarn whatever it laps.
const LAYER: f64 = 3.6;
/// Depth of a layer next to an inlay, radii.
const INLAY_LAYER: f64 = 2.6;

// Yarns over these radii (over W, over C) need the feet wider and higher to pass each other.
const THICK_ACROSS: f64 = 0.045;
const THICK_ALONG: f64 = 0.0643;

/// What a bar's stitches share: spacings, radius and the layer in which the bar's feet lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Layer {
    pub(super) dimensions: Dimensions,
    /// W, mm.
    pub(super) wale_spacing: f64,
    /// C, mm.
    pub(super) course_spacing: f64,
    /// Layout radius, mm.
    pub(super) radius: f64,
    /// Knitting bars behind this one that form loops on the same needles.
    pub(super) nesting: f64,
    /// How far behind the wale's plane the bar's feet (or its inlay) lie, mm.
    pub(super) depth: f64,
}

/// Depths of all bars' feet, front first, in radii.
///
/// `bars` says, front first, whether each is an inlay and how many knitting bars behind it share
/// its needles.
pub(super) fn layer_depths(bars: &[(bool, u32)], dimensions: &Dimensions) -> Vec<f64> {
    let mut depths = vec![0.0; bars.len()];
    let mut behind: Option<(bool, f64)> = None;
    for (at, &(inlay, nesting)) in bars.iter().enumerate().rev() {
        let depth = match behind {
            None if inlay => INLAY_LAYER,
            None => dimensions.z2,
            Some((behind_is_inlay, depth)) if inlay || behind_is_inlay => depth + INLAY_LAYER,
            Some((_, depth)) if nesting > 0 => depth + LAYER,
            // Half-set nets: no needle has two threads, so the feet share a layer.
            Some((_, depth)) => depth,
        };
        depths[at] = depth;
        behind = Some((inlay, depth));
    }
    depths
}

/// A lap's surroundings, which decide on which side its feet lie.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turns {
    /// The overlap's direction, -1 or 1.
    pub(super) overlap: i32,
    /// Gaps of the underlap before.
    pub(super) before: i32,
    /// Gaps of the underlap after.
    pub(super) after: i32,
}

impl Layer {
    /// S1 to S8 relative to the control point O1, mm: x to the right, y along the wale, z towards
    /// the technical face.
    pub(super) fn loop_points(&self, turns: Turns) -> [DVec3; 8] {
        let (w, c, r) = (self.wale_spacing, self.course_spacing, self.radius);
        let d = &self.dimensions;
        let widen = (r / (THICK_ACROSS * w)).max(1.0);
        let raise = (r / (THICK_ALONG * c)).max(1.0);
        let entry = -f64::from(turns.overlap);
        let crossed_in = turns.before.signum() == -turns.overlap;
        let crossed_out = turns.after.signum() == -turns.overlap;
        let foot = |crossed: bool| if crossed { d.w1x } else { d.w1 } * widen * w;
        let nested = self.nesting * r;
        // Of many thick bars the innermost would turn inside out: it keeps some of its width, and
        // its head stays over the next loop.
        let nest = |x: f64| (x + NEST_X * nested).max(NARROWEST * x);

        let foot_y = NEST_FEET_Y * nested;
        let lower = (
            nest(d.w2 * widen * w),
            d.h1 * raise * c + NEST_LOWER_Y * nested,
            d.zs * r + NEST_LOWER_Z * nested,
        );
        let upper = (nest(d.w3 * w), d.h2 * c, d.z1 * r + NEST_UPPER_Z * nested);
        let head_y = ((1.0 + (d.h3 - 1.0) * raise) * c + NEST_HEAD_Y * nested).max(LOWEST_HEAD * c);
        let head = (nest(d.w4 * w), head_y, NEST_HEAD_Z * nested);
        let on = |side: f64, (x, y, z): (f64, f64, f64)| DVec3::new(side * x, y, z);
        [
            DVec3::new(entry * foot(crossed_in), foot_y, -self.depth),
            on(entry, lower),
            on(entry, upper),
            on(entry, head),
            on(-entry, head),
            on(-entry, upper),
            on(-entry, lower),
            DVec3::new(-entry * foot(crossed_out), foot_y, -self.depth - d.zo * r),
        ]
    }

    /// Points of an inlay that runs from gap `from` to gap `to` in a course: gaps from gap 0, and
    /// mm from the course.
    pub(super) fn inlay_points(&self, from: i32, to: i32) -> Vec<(f64, f64)> {
        let c = self.course_spacing;
        let gaps = f64::from((to - from).abs());
        if from == to {
            return vec![(f64::from(from), 0.5 * c)];
        }
        let rise = (1.125 * self.radius * gaps / c).clamp(0.12, 0.26);
        let step = f64::from((to - from).signum());
        let y = |x: f64| 0.5 - rise + 2.0 * rise * (x - f64::from(from)).abs() / gaps;
        let mut points = vec![(f64::from(from), (0.5 - rise - CORNER) * c)];
        points.extend((0..(to - from).abs()).map(|wale| {
            let x = f64::from(from) + step * (f64::from(wale) + 0.5);
            (x, y(x) * c)
        }));
        points.push((f64::from(to), (0.5 + rise + CORNER) * c));
        points
    }
}

/// Where an underlap longer than .57 W turns: .22 W from its ends, and once a wale between them.
/// Without them long spans bulge in depth.
pub(super) fn turns(from: DVec3, to: DVec3, wale_spacing: f64) -> impl Iterator<Item = DVec3> {
    let length = (to - from).truncate().length() / wale_spacing;
    let inset = 0.22 / length;
    // One turn more for every whole wale between the two ends; spans are short, so the numbers are
    // small.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "an underlap passes at most MAX_GAP wales"
    )]
    let count = if length > 0.57 { 2 + (length - 0.44).round().max(1.0) as u32 - 1 } else { 0 };
    (0..count).map(move |turn| {
        from.lerp(to, inset + (1.0 - 2.0 * inset) * f64::from(turn) / f64::from(count - 1))
    })
}

/// How far an inlay's corners lie outside its run, over C.
const CORNER: f64 = 0.07;

#[cfg(test)]
mod tests {
    use super::*;

    fn layer_0() -> Layer {
        let dimensions = Dimensions::default();
        Layer {
            dimensions,
            wale_spacing: 1.0,
            course_spacing: 0.7,
            radius: 0.042,
            nesting: 0.0,
            depth: 1.9 * 0.042,
        }
    }

    #[test]
    fn a_closed_lap_is_symmetric_but_for_its_exit_depth() {
        let points = layer_0().loop_points(Turns { overlap: -1, before: 1, after: 1 });
        for (left, right) in [(0, 7), (1, 6), (2, 5), (3, 4)] {
            assert!((points[left].x + points[right].x).abs() < 1e-12);
            assert!((points[left].y - points[right].y).abs() < 1e-12);
        }
        assert!((points[0].x - 0.13).abs() < 1e-12, "the crossed foot stands nearer the wale");
        assert!((points[7].z - points[0].z + 3.0 * 0.042).abs() < 1e-12);
    }

    #[test]
    fn layers_of_the_specification() {
        assert_eq!(
            layer_depths(&[(false, 1), (false, 0)], &Dimensions::default()),
            [1.9 + LAYER, 1.9]
        );
        assert_eq!(
            layer_depths(&[(false, 0), (true, 0)], &Dimensions::default()),
            [2.6 + 2.6, 2.6]
        );
        assert_eq!(layer_depths(&[(false, 0), (false, 0)], &Dimensions::default()), [1.9, 1.9]);
    }

    #[test]
    fn an_inlay_is_straight_between_its_corners() {
        assert_eq!(layer_0().inlay_points(0, 0), [(0.0, 0.35)]);
        let run = layer_0().inlay_points(0, 3);
        assert_eq!(run.len(), 5);
        assert!((run[2].0 - f64::midpoint(run[1].0, run[3].0)).abs() < 1e-12);
        assert!((run[2].1 - f64::midpoint(run[1].1, run[3].1)).abs() < 1e-12);
    }
}

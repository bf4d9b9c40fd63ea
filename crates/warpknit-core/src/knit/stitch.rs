//! The eight-point stitch: the points through which the yarn of one lap passes.
//!
//! In: a [`Layer`] (spacings, radius, depth of a bar) and the directions of a lap. Out: its eight
//! points relative to the control point O1, or the points of an inlay or an underlap, mm. S1 and S8
//! are the feet (behind, where the underlaps join), S2 and S7 the lower legs, S3 and S6 the upper
//! legs, S4 and S5 the head:
//!
//! ```text
//!      S4 ---- S5        z > 0 towards the technical face: the legs lie in front,
//!     /          \
//!   S3            S6     the head at z = 0,
//!     \          /
//!      S2      S7
//!   ---S1      S8---     the feet behind.
//! ```
//!
//! Source: Liu, Kyosev and Jiang 2022, "Yarn-level modelling and geometric simulation of
//! warp-knitted clothing elements", section 2.1 and Fig. 2. `docs/method.md` holds the table of
//! [`Dimensions`]. Cost: some dozens of nanoseconds a loop. Not promised: that the yarns of several
//! bars keep clear of each other; the relaxation (`relax`) makes the room that is missing.

use glam::DVec3;

use crate::fabric::Dimensions;

// Loops of several bars on one needle nest inside each other. These are the changes of a point's
// coordinates for each knitting bar behind on the same needle, in radii. A step between two loops
// under 2 radii (counted over all axes) lets their yarns cut; larger steps leave no width for the
// innermost loop.
const NEST_X: f64 = -2.25;
const NEST_FEET_Y: f64 = -2.9;
const NEST_LOWER_Y: f64 = -1.1;
const NEST_HEAD_Y: f64 = -2.6;
const NEST_LOWER_Z: f64 = -0.3;
const NEST_UPPER_Z: f64 = 3.2;
const NEST_HEAD_Z: f64 = -0.9;
/// Share of its width that nesting leaves a loop at least. At 0 the innermost of many thick loops
/// turns inside out; near 1 nested loops lie in the same place.
const MIN_NESTED_WIDTH: f64 = 0.3;
/// Height of a nested head at least, courses. The next loop's feet hang in the head, so it must
/// stay over 1; the head of a loop without nesting is at 1.355.
const MIN_HEAD_HEIGHT: f64 = 1.12;
/// Depth between the feet of two knitting bars on the same needles, radii. 7.2 keeps yarns clear
/// without relaxation, but makes two-bar cloth a fifth thicker and gives its front bar the more
/// yarn whatever it laps. At 3.6 the relaxation makes the room that is needed. Under 2 the feet of
/// both bars would start inside each other.
const KNITTING_LAYER: f64 = 3.6;
/// Depth of a layer next to an inlay, radii. Straight yarns need 2 to pass each other and a little
/// for bends; more only thickens the cloth.
const INLAY_LAYER: f64 = 2.6;

// Yarns with a radius over these shares of W and of C need wider and higher feet to pass each
// other: feet and lower legs grow in proportion from there on. With higher limits thick yarns cut
// each other at the feet; with lower limits thin yarns make loops with needlessly wide feet.
const MAX_RADIUS_ACROSS: f64 = 0.045;
const MAX_RADIUS_ALONG: f64 = 0.0643;

/// Underlaps longer than this get points of their own, over W. Shorter ones are straight enough.
const MIN_POINTED_UNDERLAP: f64 = 0.57;
/// Distance of an underlap's first and last point from its ends, over W. It must be under half of
/// [`MIN_POINTED_UNDERLAP`], or the two points would change places.
const UNDERLAP_INSET: f64 = 0.22;
/// How far an inlay's two corners lie outside its run, over C. At 0 the yarn overshoots its corner;
/// larger values lengthen the float in the gap.
const INLAY_CORNER: f64 = 0.07;

/// Values that all stitches of a bar share: spacings, radius and the layer in which its feet lie.
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
/// `bars` tells of each bar, front first, whether it is an inlay and how many knitting bars behind
/// it share its needles.
pub(super) fn layer_depths(bars: &[(bool, u32)], dimensions: &Dimensions) -> Vec<f64> {
    let mut depths = vec![0.0; bars.len()];
    let mut behind: Option<(bool, f64)> = None;
    for (at, &(inlay, nesting)) in bars.iter().enumerate().rev() {
        let depth = match behind {
            None if inlay => INLAY_LAYER,
            None => dimensions.z2,
            Some((behind_is_inlay, depth)) if inlay || behind_is_inlay => depth + INLAY_LAYER,
            Some((_, depth)) if nesting > 0 => depth + KNITTING_LAYER,
            // Half-set nets: no needle has two threads, so the feet share a layer.
            Some((_, depth)) => depth,
        };
        depths[at] = depth;
        behind = Some((inlay, depth));
    }
    depths
}

/// The directions of a lap and its underlaps. They decide on which side its feet lie.
#[derive(Clone, Copy, Debug)]
pub(super) struct LapDirections {
    /// The overlap's direction, -1 or 1.
    pub(super) overlap: i32,
    /// Gaps of the underlap before, signed.
    pub(super) underlap_before: i32,
    /// Gaps of the underlap after, signed.
    pub(super) underlap_after: i32,
}

impl Layer {
    /// S1 to S8 relative to the control point O1, mm: x to the right, y along the wale, z towards
    /// the technical face.
    pub(super) fn loop_points(&self, lap: LapDirections) -> [DVec3; 8] {
        let (w, c, r) = (self.wale_spacing, self.course_spacing, self.radius);
        let d = &self.dimensions;
        let widen = (r / (MAX_RADIUS_ACROSS * w)).max(1.0);
        let raise = (r / (MAX_RADIUS_ALONG * c)).max(1.0);
        // The guide swings in front of the needle in the overlap's direction, so the yarn enters
        // the loop on the opposite side. An underlap that comes from (or goes to) the other side
        // crosses the loop's own foot and draws it nearer to the wale: a closed lap.
        let entry = -f64::from(lap.overlap);
        let [foot_in, foot_out] = [lap.underlap_before, lap.underlap_after].map(|underlap| {
            let is_crossed = underlap.signum() == -lap.overlap;
            let width = if is_crossed { d.w1x } else { d.w1 };
            width * widen * w
        });
        let nested = self.nesting * r;

        let foot_y = NEST_FEET_Y * nested;
        let lower = DVec3::new(
            nested_width(d.w2 * widen * w, nested),
            d.h1 * raise * c + NEST_LOWER_Y * nested,
            d.zs * r + NEST_LOWER_Z * nested,
        );
        let upper =
            DVec3::new(nested_width(d.w3 * w, nested), d.h2 * c, d.z1 * r + NEST_UPPER_Z * nested);
        let head_y =
            ((1.0 + (d.h3 - 1.0) * raise) * c + NEST_HEAD_Y * nested).max(MIN_HEAD_HEIGHT * c);
        let head = DVec3::new(nested_width(d.w4 * w, nested), head_y, NEST_HEAD_Z * nested);
        // Entry side first, then mirrored. Only the exit foot breaks the symmetry: it lies deeper,
        // so that the underlap that leaves passes behind the one that arrives.
        [
            DVec3::new(entry * foot_in, foot_y, -self.depth),
            on_side(entry, lower),
            on_side(entry, upper),
            on_side(entry, head),
            on_side(-entry, head),
            on_side(-entry, upper),
            on_side(-entry, lower),
            DVec3::new(-entry * foot_out, foot_y, -self.depth - d.zo * r),
        ]
    }

    /// Points of an inlay that runs from gap `from` to gap `to` in a course, each as its gap from
    /// gap 0 and its height over the course, mm.
    pub(super) fn inlay_points(&self, from: i32, to: i32) -> Vec<(f64, f64)> {
        let c = self.course_spacing;
        let gaps = f64::from((to - from).abs());
        if from == to {
            return vec![(f64::from(from), 0.5 * c)];
        }
        // The run rises over the course: an inlay that passes many wales in one course has to cross
        // the underlaps of all of them. The range keeps thin yarns from lying flat on each other
        // and thick ones within their course.
        let rise = (1.125 * self.radius * gaps / c).clamp(0.12, 0.26);
        let step = f64::from((to - from).signum());
        let mut points = vec![(f64::from(from), (0.5 - rise - INLAY_CORNER) * c)];
        points.extend((0..(to - from).abs()).map(|wale| {
            let x = f64::from(from) + step * (f64::from(wale) + 0.5);
            let y = 0.5 - rise + 2.0 * rise * (x - f64::from(from)).abs() / gaps;
            (x, y * c)
        }));
        points.push((f64::from(to), (0.5 + rise + INLAY_CORNER) * c));
        points
    }
}

/// Half the width of a nested loop at some height: narrower by the yarns that lie around it.
fn nested_width(x: f64, nested: f64) -> f64 {
    (x + NEST_X * nested).max(MIN_NESTED_WIDTH * x)
}

/// A point of a loop on one side of its wale, 1 or -1.
fn on_side(side: f64, point: DVec3) -> DVec3 {
    DVec3::new(side * point.x, point.y, point.z)
}

/// Points of an underlap longer than 0.57 W: 0.22 W from its ends, and one more for each wale
/// between them. The path is a Catmull-Rom curve, and without these points the loops' feet would
/// make its long spans bulge in depth.
pub(super) fn underlap_points(
    from: DVec3,
    to: DVec3,
    wale_spacing: f64,
) -> impl Iterator<Item = DVec3> {
    let length = (to - from).truncate().length() / wale_spacing;
    let inset = UNDERLAP_INSET / length;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "an underlap passes at most MAX_GAP wales"
    )]
    let count = if length > MIN_POINTED_UNDERLAP {
        2 + (length - 2.0 * UNDERLAP_INSET).round().max(1.0) as u32 - 1
    } else {
        0
    };
    (0..count).map(move |point| {
        from.lerp(to, inset + (1.0 - 2.0 * inset) * f64::from(point) / f64::from(count - 1))
    })
}

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
        let points = layer_0().loop_points(LapDirections {
            overlap: -1,
            underlap_before: 1,
            underlap_after: 1,
        });
        for (left, right) in [(0, 7), (1, 6), (2, 5), (3, 4)] {
            assert!((points[left].x + points[right].x).abs() < 1e-12);
            assert!((points[left].y - points[right].y).abs() < 1e-12);
        }
        assert!((points[0].x - 0.13).abs() < 1e-12, "the crossed foot stands nearer the wale");
        assert!((points[7].z - points[0].z + 3.0 * 0.042).abs() < 1e-12);
    }

    #[test]
    fn layers_of_two_bars() {
        assert_eq!(
            layer_depths(&[(false, 1), (false, 0)], &Dimensions::default()),
            [1.9 + KNITTING_LAYER, 1.9]
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

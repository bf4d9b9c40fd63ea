//! Step 5, shape: each segment as a curved cylinder, in mm.
//!
//! In: segments in pixels and lightness, and the size of both in mm. Out: [`CylinderShape`]s.
//!
//! Method: the curved cylinder of Irawan and Marschner 2012, *Specular reflection from woven
//! cloth*. Along its length the axis is an arc that leaves the cloth's plane at its ends by the
//! angle
//! `u_max`. Its section is an ellipse, as wide as the yarn, with the semi-axis `a` upward.
//!
//! Not promised: a section and an arc better than "dark is deep" knows them. Both are clamped to
//! what yarns can be.

use glam::{DVec2, DVec3};

use super::segment::Segment;

/// The flattest section of a yarn: its height over its width.
const FLATTEST: f64 = 0.5;
/// The steepest end of a segment, radians: yarns don't stand upright.
const STEEPEST: f64 = 1.2;

/// A segment of yarn in space. Lengths are mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CylinderShape {
    /// Width w.
    pub width: f64,
    /// Length l.
    pub length: f64,
    /// Semi-axis a of its section, upward.
    pub semi_axis: f64,
    /// The angle at which its axis leaves the cloth's plane at its ends, radians: u_max.
    pub steepest: f64,
    /// Curvature of its axis in its middle, 1/mm: kappa.
    pub curvature: f64,
    /// Direction of its axis in the photo, radians from x towards y (down): theta.
    pub rotation: f64,
    /// The middle of its axis: x and y in the photo from a cell's corner, z over the deepest
    /// ground.
    pub centre: DVec3,
}

/// The size in mm of a pixel and of a lightness of 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PhotoScale {
    pub(super) pixel: f64,
    pub(super) light: f64,
}

impl CylinderShape {
    /// The shape of a segment.
    pub(super) fn new(segment: &Segment, scale: PhotoScale) -> Self {
        let Segment { angle, width, length, top, round, sag, .. } = *segment;
        let (width, length) = (width * scale.pixel, length * scale.pixel);
        // At most a circle: a yarn higher than wide would roll over.
        let semi_axis = (round * scale.light).clamp(FLATTEST * width / 2.0, width / 2.0);
        // The slope at the ends of the parabola that goes down by `sag` over half the length.
        let slope = (4.0 * sag * scale.light / length).clamp(0.0, STEEPEST.tan());
        let DVec2 { x, y } = segment.axis(0.0).0 * scale.pixel;
        Self {
            width,
            length,
            semi_axis,
            steepest: slope.atan(),
            // The second derivative of the same parabola.
            curvature: 2.0 * slope / length,
            rotation: angle,
            centre: DVec3::new(x, y, top * scale.light - semi_axis),
        }
    }

    /// How far the ends of its axis lie below its middle, mm.
    pub(super) fn sinks(&self) -> f64 {
        0.125 * self.curvature * self.length * self.length
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_and_an_ellipse_in_mm() {
        let segment = Segment {
            round: 0.7,
            sag: 1.0,
            bow: 2.0,
            ..Segment::straight(DVec2::new(10.0, 4.0), 0.3, 8.0, 20.0, 2.0)
        };
        let shape = CylinderShape::new(&segment, PhotoScale { pixel: 0.05, light: 0.25 });
        assert!((shape.width - 0.4).abs() < 1e-12 && (shape.length - 1.0).abs() < 1e-12);
        assert!((shape.semi_axis - 0.175).abs() < 1e-12);
        // Its middle is aside of the line between its ends.
        let middle = DVec2::new(0.5, 0.2) + 0.1 * DVec2::from_angle(0.3).perp();
        assert!((shape.centre - middle.extend(0.325)).length() < 1e-12, "{shape:?}");
        // At its ends it is as far below its middle as the light says, and slopes so.
        assert!((shape.sinks() - 0.25).abs() < 1e-12 && (shape.steepest.tan() - 1.0).abs() < 1e-12);
        let flat = CylinderShape::new(
            &Segment { round: 0.0, ..segment },
            PhotoScale { pixel: 0.05, light: 0.25 },
        );
        assert!((flat.semi_axis - 0.1).abs() < 1e-12, "{flat:?}");
    }
}

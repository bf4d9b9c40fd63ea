//! The camera: rays, projection and framing.
//!
//! In: the name of a view and points to frame, or an eye and a target. Out: rays through the
//! picture, and the projection that inverts them, in `f64` world coordinates, mm, y up. Picture
//! coordinates run from -1 at the left and bottom edges to 1 at the right and top. Not provided:
//! near and far planes. A renderer with a depth buffer takes them from the scene.

use glam::{DMat4, DQuat, DVec2, DVec3, DVec4, Mat4, Vec3};

/// Fraction of the frame that a framed box fills at zoom 1; the rest is margin.
pub const FRAME_FILL: f64 = 0.94;

/// Limits of the field of view, radians, within which rays stay finite.
const FOV_LIMITS: (f64, f64) = (1e-4, 3.0);

/// A direction from which to see the whole of something.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum View {
    /// From +z, x to the right.
    Front,
    /// From -z.
    Back,
    /// From -x.
    Left,
    /// From +x.
    Right,
    /// From above; what is in front (+z) is at the picture's bottom.
    Top,
    /// From the front, the right and above by equal parts.
    Iso,
}

impl View {
    /// The unit vector from the target to the eye.
    #[must_use]
    pub fn toward_eye(self) -> DVec3 {
        match self {
            Self::Front => DVec3::Z,
            Self::Back => DVec3::NEG_Z,
            Self::Left => DVec3::NEG_X,
            Self::Right => DVec3::X,
            Self::Top => DVec3::Y,
            Self::Iso => DVec3::ONE.normalize(),
        }
    }
}

/// A perspective camera without distortion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    eye: DVec3,
    right: DVec3,
    up: DVec3,
    back: DVec3,
    /// Half the picture's height at distance 1, zoom included.
    tan_half: f64,
    /// Where the picture's middle lies at distance 1, along `right` and `up`. Zero unless the
    /// picture is a part of another one.
    middle: DVec2,
}

impl Camera {
    /// Default vertical field of view: 30 degrees.
    pub const DEFAULT_FOV: f64 = std::f64::consts::PI / 6.0;

    /// Looks at `points` from the side that `view` names, so near that they fill [`FRAME_FILL`] of
    /// the frame in one direction.
    ///
    /// `fov` is the vertical field of view, radians. `zoom` magnifies the centre of the picture.
    /// `aspect` is width over height. Without points the camera looks at the origin.
    #[must_use]
    pub fn view(view: View, points: &[Vec3], fov: f64, zoom: f64, aspect: f64) -> Self {
        Self::facing(view.toward_eye(), points, fov, zoom, aspect)
    }

    /// The same from any side: `toward_eye` is the unit vector from the points to the eye.
    #[must_use]
    pub fn facing(toward_eye: DVec3, points: &[Vec3], fov: f64, zoom: f64, aspect: f64) -> Self {
        let axes = Self::look_at(toward_eye, DVec3::ZERO, fov, 1.0);
        let in_camera_axes = points
            .iter()
            .map(|point| axes.in_camera_axes(point.as_dvec3()))
            .filter(|point| point.is_finite());
        let low = in_camera_axes.clone().fold(DVec3::INFINITY, DVec3::min);
        let high = in_camera_axes.clone().fold(DVec3::NEG_INFINITY, DVec3::max);
        // The centre in camera axes, not that of the world's bounding box: seen from a corner, the
        // two lie far apart.
        let middle = if low.x <= high.x { low.midpoint(high) } else { DVec3::ZERO };
        let reach = FRAME_FILL * axes.tan_half;
        let distance =
            in_camera_axes.map(|point| point - middle).fold(0.0_f64, |farthest, offset| {
                let across = (offset.x.abs() / aspect).max(offset.y.abs());
                farthest.max(offset.z + across / reach)
            });
        // Back to world axes.
        let target = axes.right * middle.x + axes.up * middle.y + axes.back * middle.z;
        // A single point has no size to fit. Any distance shows it.
        Self::look_at(target + toward_eye * distance.max(1e-3), target, fov, zoom)
    }

    /// Stands at `eye` and looks at `target`, upright. Where it looks straight down, -z is up;
    /// where it looks straight up, +z is.
    ///
    /// `fov` is the vertical field of view, radians, clamped to a range in which rays are finite.
    /// `zoom` magnifies. Where `eye` equals `target`, it looks along -z.
    #[must_use]
    pub fn look_at(eye: DVec3, target: DVec3, fov: f64, zoom: f64) -> Self {
        let back = (eye - target).try_normalize().unwrap_or(DVec3::Z);
        let steep = back.y.abs() > 0.9999;
        let upright = if steep { DVec3::NEG_Z * back.y.signum() } else { DVec3::Y };
        let right = upright.cross(back).normalize();
        let half = (if fov.is_finite() { fov } else { Self::DEFAULT_FOV })
            .clamp(FOV_LIMITS.0, FOV_LIMITS.1)
            / 2.0;
        let zoom = if zoom > 0.0 && zoom.is_finite() { zoom } else { 1.0 };
        Self {
            eye,
            right,
            up: back.cross(right),
            back,
            tan_half: half.tan() / zoom,
            middle: DVec2::ZERO,
        }
    }

    /// The camera rotated about the vertical line through `target`, counter-clockwise as seen from
    /// above, radians.
    #[must_use]
    pub fn turned_about(&self, target: DVec3, angle: f64) -> Self {
        let turn = DQuat::from_rotation_y(angle);
        let [right, up, back] = [self.right, self.up, self.back].map(|axis| turn * axis);
        Self { eye: target + turn * (self.eye - target), right, up, back, ..*self }
    }

    /// The camera of a part of the picture, with the same eye, axes and light. `middle` is the
    /// part's middle in a picture of this aspect, and `share` its height over the picture's.
    #[must_use]
    pub fn part(&self, middle: DVec2, aspect: f64, share: f64) -> Self {
        let middle = self.middle + middle * DVec2::new(aspect, 1.0) * self.tan_half;
        Self { middle, tan_half: share * self.tan_half, ..*self }
    }

    /// Position of the eye.
    #[must_use]
    pub fn eye(&self) -> DVec3 {
        self.eye
    }

    /// Unit direction of the ray through picture point (x, y).
    #[must_use]
    pub fn direction(&self, x: f64, y: f64, aspect: f64) -> DVec3 {
        let at = self.middle + DVec2::new(x * aspect, y) * self.tan_half;
        (self.right * at.x + self.up * at.y - self.back).normalize()
    }

    /// The picture point at which `point` appears. `None` for points that are not in front of the
    /// eye.
    #[must_use]
    pub fn project(&self, point: DVec3, aspect: f64) -> Option<DVec2> {
        let p = self.in_camera_axes(point - self.eye);
        (p.z < 0.0).then(|| {
            (p.truncate() / -p.z - self.middle) / (DVec2::new(aspect, 1.0) * self.tan_half)
        })
    }

    /// The planes around what a picture of this aspect shows: an inward unit normal n and a number d.
    /// Inside, n·p + d is not negative. The last plane lies across the eye.
    #[must_use]
    pub fn sides(&self, aspect: f64) -> [(DVec3, f64); 5] {
        let reach = DVec2::new(aspect, 1.0) * self.tan_half;
        let (low, high) = (self.middle - reach, self.middle + reach);
        let sides = [
            self.right + self.back * low.x,
            -self.right - self.back * high.x,
            self.up + self.back * low.y,
            -self.up - self.back * high.y,
            -self.back,
        ];
        sides.map(|side| {
            let normal = side.normalize();
            (normal, -normal.dot(self.eye))
        })
    }

    /// Matrix from coordinates relative to `centre` to clip coordinates. z is 0 at distance `near`
    /// along the camera's axis and 1 at `far`. w is that distance.
    #[must_use]
    pub fn clip_from_world(&self, centre: DVec3, aspect: f64, near: f32, far: f32) -> Mat4 {
        let offset = centre - self.eye;
        let distance = projection_row(-self.back, offset, 1.0);
        let (near, far) = (f64::from(near), f64::from(far));
        let depth = (distance - DVec4::W * near) * (far / (far - near));
        DMat4::from_cols(
            projection_row(
                self.right + self.back * self.middle.x,
                offset,
                1.0 / (aspect * self.tan_half),
            ),
            projection_row(self.up + self.back * self.middle.y, offset, 1.0 / self.tan_half),
            depth,
            distance,
        )
        .transpose()
        .as_mat4()
    }

    /// Size of a pixel, mm, at `distance` from the eye, in a picture that is `height` pixels high.
    #[must_use]
    pub fn pixel_size(&self, distance: f64, height: u32) -> f64 {
        2.0 * self.tan_half * distance / f64::from(height.max(1))
    }

    /// A direction from camera axes (right, up, back) to world axes.
    #[must_use]
    pub fn to_world(&self, direction: Vec3) -> Vec3 {
        let d = direction.as_dvec3();
        (self.right * d.x + self.up * d.y + self.back * d.z).as_vec3()
    }

    /// A vector from world axes to camera axes (right, up, back).
    fn in_camera_axes(&self, offset: DVec3) -> DVec3 {
        DVec3::new(offset.dot(self.right), offset.dot(self.up), offset.dot(self.back))
    }
}

/// Row of a matrix that maps a point p to `axis . (p + offset)`, scaled.
fn projection_row(axis: DVec3, offset: DVec3, scale: f64) -> DVec4 {
    (axis * scale).extend(axis.dot(offset) * scale)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Bounds;

    const ALL: [View; 6] = [View::Front, View::Back, View::Left, View::Right, View::Top, View::Iso];

    fn box_of(x: f32, y: f32, z: f32) -> Bounds {
        Bounds { min: Vec3::new(-x, 2.0, 5.0), max: Vec3::new(x, 2.0 + y, 5.0 + z) }
    }

    /// The largest coordinate of any corner in the picture.
    fn extent(camera: &Camera, bounds: &Bounds, aspect: f64) -> f64 {
        let seen =
            |corner: &Vec3| camera.project(corner.as_dvec3(), aspect).unwrap().abs().max_element();
        bounds.corners().iter().map(seen).fold(0.0, f64::max)
    }

    #[test]
    fn every_view_frames_the_box_and_touches_the_margin() {
        for bounds in [box_of(3.0, 4.0, 0.1), box_of(300.0, 1.0, 40.0), box_of(0.5, 900.0, 200.0)] {
            for view in ALL {
                let camera = Camera::view(view, &bounds.corners(), 0.5, 1.0, 4.0 / 3.0);
                assert!(
                    (extent(&camera, &bounds, 4.0 / 3.0) - FRAME_FILL).abs() < 1e-6,
                    "{view:?}"
                );
                let zoomed = Camera::view(view, &bounds.corners(), 0.5, 2.0, 4.0 / 3.0);
                assert!(
                    (extent(&zoomed, &bounds, 4.0 / 3.0) - 2.0 * FRAME_FILL).abs() < 1e-6,
                    "{view:?}"
                );
            }
        }
    }

    #[test]
    fn rays_and_projection_are_inverse() {
        let camera =
            Camera::look_at(DVec3::new(3.0, 4.0, 5.0), DVec3::new(-1.0, 0.0, 2.0), 0.7, 1.3);
        for (x, y) in [(0.0, 0.0), (-0.9, 0.4), (0.2, -1.0)] {
            let point = camera.eye() + camera.direction(x, y, 1.6) * 17.0;
            assert!(camera.project(point, 1.6).unwrap().distance(DVec2::new(x, y)) < 1e-12);
        }
    }

    #[test]
    fn a_turned_camera_sees_what_it_saw_of_a_turned_world() {
        let camera =
            Camera::look_at(DVec3::new(3.0, 4.0, 5.0), DVec3::new(-1.0, 0.0, 2.0), 0.7, 1.3);
        let (target, point) = (DVec3::new(1.0, 2.0, -1.0), DVec3::new(0.5, 1.0, 0.3));
        let carried = target + DQuat::from_rotation_y(0.8) * (point - target);
        let turned = camera.turned_about(target, 0.8);
        assert!(
            turned.project(carried, 1.6).unwrap().distance(camera.project(point, 1.6).unwrap())
                < 1e-12
        );
    }

    #[test]
    fn points_inside_all_sides_are_those_of_the_picture() {
        let camera =
            Camera::look_at(DVec3::new(3.0, 4.0, 5.0), DVec3::new(-1.0, 0.0, 2.0), 0.7, 1.3);
        for (x, y) in [(0.0, 0.0), (-0.99, 0.99), (1.01, 0.0), (0.2, -1.01), (-1.01, 0.3)] {
            for distance in [0.5, 40.0, -2.0] {
                let point = camera.eye() + camera.direction(x, y, 1.6) * distance;
                let inside =
                    camera.sides(1.6).iter().all(|(normal, d)| normal.dot(point) + d >= 0.0);
                let shown = f64::max(x.abs(), y.abs()) < 1.0 && distance > 0.0;
                assert_eq!(inside, shown, "{x} {y} {distance}");
            }
        }
    }

    #[test]
    fn clip_coordinates_are_the_projection() {
        let camera =
            Camera::look_at(DVec3::new(3.0, 4.0, 5.0), DVec3::new(-1.0, 0.0, 2.0), 0.7, 1.3);
        let centre = DVec3::new(-0.5, 0.2, 1.0);
        let clip = camera.clip_from_world(centre, 1.6, 2.0, 30.0);
        for (x, y, distance) in [(0.0, 0.0, 2.0), (-0.9, 0.4, 17.0), (0.2, -1.0, 30.0)] {
            let direction = camera.direction(x, y, 1.6);
            let point = camera.eye() + direction * (distance / -direction.dot(camera.back));
            let seen = clip * (point - centre).as_vec3().extend(1.0);
            let depth = (distance - 2.0) * 30.0 / (28.0 * distance);
            let expected = DVec4::new(x, y, depth, 1.0) * distance;
            assert!(seen.as_dvec4().distance(expected) < 1e-4, "{seen} {expected}");
        }
    }

    #[test]
    fn a_part_shows_what_is_there_in_the_whole() {
        let whole =
            Camera::look_at(DVec3::new(3.0, 4.0, 5.0), DVec3::new(-1.0, 0.0, 2.0), 0.7, 1.3);
        let (middle, share, aspect) = (DVec2::new(0.5, -0.3), 0.2, 1.6);
        let part = whole.part(middle, aspect, share);
        for (x, y) in [(0.0, 0.0), (-0.9, 0.4), (1.1, -1.0)] {
            // The part is square.
            let there = middle + DVec2::new(x / aspect, y) * share;
            let direction = part.direction(x, y, 1.0);
            assert!(direction.distance(whole.direction(there.x, there.y, aspect)) < 1e-12);
            let point = whole.eye() + direction * 17.0;
            let at = DVec2::new(x, y);
            assert!(part.project(point, 1.0).unwrap().distance(at) < 1e-12);
            let inside = part.sides(1.0).iter().all(|(normal, d)| normal.dot(point) + d >= 0.0);
            assert_eq!(inside, at.abs().max_element() < 1.0, "{x} {y}");
            let clip = part.clip_from_world(DVec3::ONE, 1.0, 2.0, 30.0)
                * (point - DVec3::ONE).as_vec3().extend(1.0);
            assert!(
                (clip.as_dvec4().truncate().truncate() / f64::from(clip.w)).distance(at) < 1e-4
            );
        }
        // A part of the part is a part of the whole.
        let again = part.part(DVec2::new(0.5, 0.5), 1.0, 0.5);
        let there = middle + DVec2::new(0.5 / aspect, 0.5) * share;
        let (seen, expected) =
            (again.direction(0.0, 0.0, 1.0), whole.direction(there.x, there.y, aspect));
        assert!(seen.distance(expected) < 1e-12);
        let sizes = [&part, &whole].map(|camera| camera.pixel_size(10.0, 100));
        assert!((sizes[0] / sizes[1] - share).abs() < 1e-12);
    }

    #[test]
    fn front_has_x_right_and_y_up_and_back_mirrors_x() {
        let bounds = box_of(1.0, 1.0, 1.0);
        let point = bounds.centre().as_dvec3() + DVec3::new(0.2, 0.3, 0.0);
        let seen = |view| {
            Camera::view(view, &bounds.corners(), 0.5, 1.0, 1.0).project(point, 1.0).unwrap()
        };
        assert!(seen(View::Front).x > 0.0 && seen(View::Front).y > 0.0);
        assert!(seen(View::Back).x < 0.0 && seen(View::Back).y > 0.0);
    }

    #[test]
    fn top_view_has_the_front_at_the_bottom() {
        let bounds = box_of(1.0, 1.0, 1.0);
        let point = bounds.centre().as_dvec3() + DVec3::new(0.2, 0.0, 0.3);
        let seen =
            Camera::view(View::Top, &bounds.corners(), 0.5, 1.0, 1.0).project(point, 1.0).unwrap();
        assert!(seen.x > 0.0 && seen.y < 0.0);
    }

    #[test]
    fn degenerate_input_keeps_rays_finite() {
        let point = Bounds { min: Vec3::ONE, max: Vec3::ONE };
        let cameras = [
            Camera::view(View::Iso, &point.corners(), f64::NAN, 0.0, 1.0),
            Camera::look_at(DVec3::ONE, DVec3::ONE, 10.0, f64::NAN),
            Camera::look_at(DVec3::Y, DVec3::ZERO, 0.0, 1.0),
        ];
        for camera in cameras {
            assert!(camera.direction(1.0, -1.0, 1.0).is_finite());
        }
    }

    #[test]
    fn the_pixel_size_spans_the_field_of_view() {
        let camera =
            Camera::look_at(DVec3::Z * 100.0, DVec3::ZERO, std::f64::consts::FRAC_PI_2, 1.0);
        assert!((camera.pixel_size(100.0, 50) - 4.0).abs() < 1e-12);
    }
}

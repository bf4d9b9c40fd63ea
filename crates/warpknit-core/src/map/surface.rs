//! A draped panel as a smooth surface: places, slopes and normals that are continuous everywhere.
//!
//! In: a [`Panel`]. Out: a [`SmoothSurface`], and for each triangle a [`Patch`] that is evaluated at
//! barycentric coordinates.
//!
//! Method: each triangle is a cubic patch in three parts that share a tangent plane along all edges
//! (Clough and Tocher 1965, "Finite element stiffness matrices for analysis of plates in bending";
//! control points as in Farin 1986, "Triangular Bernstein-Bézier patches"). It passes through the
//! corners with the slopes given there. A corner's slopes are the mean of those of its triangles,
//! each turned into the plane across the corner's normal, so that cloth which only bends keeps its
//! lengths. Slopes across an edge change linearly along it.
//!
//! Cost: linear in the triangles, and some 40 ns a place. Not promised: the surface keeps near the
//! triangles, but between corners it bulges where they bend.

use std::array::from_fn;

use glam::{DMat2, DVec2, DVec3};

use crate::garment::Panel;

/// The derivative of a map from the flat panel into space: along u, along v.
pub(crate) type Slope = [DVec3; 2];

/// The slopes of a draped panel and of its normals, by vertex.
#[derive(Clone, Debug, Default)]
pub(crate) struct SmoothSurface {
    slopes: Vec<Slope>,
    /// Slopes of the unit normal: how the surface bends.
    bends: Vec<Slope>,
}

impl SmoothSurface {
    /// Measures the slopes of a panel. Cost: about 100 ns a triangle.
    pub(crate) fn new(panel: &Panel) -> Self {
        let mut surface = Self {
            slopes: vec![[DVec3::ZERO; 2]; panel.uv.len()],
            bends: vec![[DVec3::ZERO; 2]; panel.uv.len()],
        };
        let mut areas = vec![0.0; panel.uv.len()];
        for corners in &panel.triangles {
            let corners = corners.map(|v| v as usize);
            let gradients = Gradients::of(corners.map(|v| panel.uv[v]));
            let slope = gradients.slope(corners.map(|v| panel.draped[v]));
            let bend = gradients.slope(corners.map(|v| panel.normals[v]));
            let normal = slope[0].cross(slope[1]).normalize_or_zero();
            for corner in corners {
                let turned = slope.map(|along| turned(along, normal, panel.normals[corner]));
                for axis in 0..2 {
                    surface.slopes[corner][axis] += turned[axis] * gradients.area;
                    surface.bends[corner][axis] += bend[axis] * gradients.area;
                }
                areas[corner] += gradients.area;
            }
        }
        for (vertex, area) in areas.into_iter().enumerate().filter(|(_, area)| *area > 0.0) {
            surface.slopes[vertex] = surface.slopes[vertex].map(|slope| slope / area);
            surface.bends[vertex] = surface.bends[vertex].map(|bend| bend / area);
        }
        surface
    }

    /// The patch of a triangle.
    pub(crate) fn patch(&self, panel: &Panel, triangle: usize) -> Patch {
        let corners = panel.triangles[triangle].map(|v| v as usize);
        Patch::new(
            corners.map(|v| panel.uv[v]),
            corners.map(|v| panel.draped[v]),
            corners.map(|v| self.slopes[v]),
            corners.map(|v| panel.normals[v]),
            corners.map(|v| self.bends[v]),
        )
    }
}

/// Turns a vector by the smallest turn that takes one unit vector to another.
fn turned(vector: DVec3, from: DVec3, to: DVec3) -> DVec3 {
    let (axis, cosine) = (from.cross(to), from.dot(to));
    // Opposite normals have no smallest turn; such a triangle lies on its back.
    if cosine < -0.99 {
        return vector;
    }
    vector + axis.cross(vector) + axis.cross(axis.cross(vector)) / (1.0 + cosine)
}

/// The derivatives of a triangle's barycentric coordinates.
struct Gradients {
    corners: [DVec2; 3],
    area: f64,
}

impl Gradients {
    fn of([a, b, c]: [DVec2; 3]) -> Self {
        let flat = DMat2::from_cols(b - a, c - a);
        // Rows of the inverse are the derivatives of the second and the third coordinate.
        let [second, third] = {
            let rows = flat.inverse().transpose();
            [rows.x_axis, rows.y_axis]
        };
        Self { corners: [-second - third, second, third], area: flat.determinant() / 2.0 }
    }

    /// The slope of a linear function with these values at the corners.
    fn slope(&self, values: [DVec3; 3]) -> Slope {
        from_fn(|axis| (0..3).map(|k| values[k] * self.corners[k][axis]).sum())
    }
}

/// The smooth surface over one triangle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Patch {
    /// Control points of the three parts. Part k lies opposite corner k, between the corners k + 1
    /// and k + 2 and the middle.
    parts: [Part; 3],
    normals: [DVec3; 3],
    bends: [Slope; 3],
}

/// A cubic Bézier triangle over the part between two corners and the middle.
#[derive(Clone, Copy, Debug)]
struct Part {
    /// b300, b210, b120, b030; b201, b111, b021; b102, b012; b003. The exponents count the first
    /// corner, the second and the middle.
    points: [DVec3; 10],
    /// Derivatives of the part's barycentric coordinates along u and along v.
    gradients: [DVec2; 3],
}

/// The surface at a place.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfaceFrame {
    pub(crate) place: DVec3,
    pub(crate) slope: Slope,
    /// Unit normal.
    pub(crate) normal: DVec3,
    /// Slope of the normal.
    pub(crate) bend: Slope,
}

impl Patch {
    fn new(
        flat: [DVec2; 3],
        places: [DVec3; 3],
        slopes: [Slope; 3],
        normals: [DVec3; 3],
        bends: [Slope; 3],
    ) -> Self {
        let middle = (flat[0] + flat[1] + flat[2]) / 3.0;
        let along =
            |corner: usize, way: DVec2| slopes[corner][0] * way.x + slopes[corner][1] * way.y;
        // Control points next to a corner, a third of the way to another one or to the middle.
        let beside =
            |corner: usize, to: DVec2| places[corner] + along(corner, to - flat[corner]) / 3.0;
        let inner: [DVec3; 3] = from_fn(|k| beside(k, middle));
        // The control point at the heart of each part follows from the slope across its edge.
        let hearts: [DVec3; 3] = from_fn(|k| {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            let edge = flat[j] - flat[i];
            let share = (middle - flat[i]).dot(edge) / edge.length_squared();
            let across = middle - flat[i] - share * edge;
            (along(i, across) + along(j, across)) / 6.0
                + (1.0 - share) * beside(i, flat[j])
                + share * beside(j, flat[i])
        });
        let outer: [DVec3; 3] =
            from_fn(|k| (inner[k] + hearts[(k + 1) % 3] + hearts[(k + 2) % 3]) / 3.0);
        let centre = (outer[0] + outer[1] + outer[2]) / 3.0;
        let gradients = Gradients::of(flat).corners;
        let parts = from_fn(|k| {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            Part {
                points: [
                    places[i],
                    beside(i, flat[j]),
                    beside(j, flat[i]),
                    places[j],
                    inner[i],
                    hearts[k],
                    inner[j],
                    outer[i],
                    outer[j],
                    centre,
                ],
                gradients: [
                    gradients[i] - gradients[k],
                    gradients[j] - gradients[k],
                    3.0 * gradients[k],
                ],
            }
        });
        Self { parts, normals, bends }
    }

    /// Distance of the surface from its flat triangle at most, mm: that of its control points, since
    /// a Bézier triangle lies within their hull. `corners` are the triangle's, in order.
    pub(crate) fn bulge(&self, corners: [DVec3; 3]) -> f64 {
        // The exponents of the control points, as `Part::points` has them.
        const EXPONENTS: [[f64; 3]; 10] = [
            [3.0, 0.0, 0.0],
            [2.0, 1.0, 0.0],
            [1.0, 2.0, 0.0],
            [0.0, 3.0, 0.0],
            [2.0, 0.0, 1.0],
            [1.0, 1.0, 1.0],
            [0.0, 2.0, 1.0],
            [1.0, 0.0, 2.0],
            [0.0, 1.0, 2.0],
            [0.0, 0.0, 3.0],
        ];
        let middle = corners.iter().sum::<DVec3>() / 3.0;
        let mut farthest: f64 = 0.0;
        for (k, part) in self.parts.iter().enumerate() {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            for (point, [r, s, t]) in part.points.iter().zip(EXPONENTS) {
                let flat = (corners[i] * r + corners[j] * s + middle * t) / 3.0;
                farthest = farthest.max(point.distance(flat));
            }
        }
        farthest
    }

    /// The surface at barycentric coordinates of the second and the third corner.
    #[inline]
    pub(crate) fn at(&self, b: f64, c: f64) -> SurfaceFrame {
        let shares = [1.0 - b - c, b, c];
        // The smallest coordinate tells in which of the three parts the place lies.
        let part = if shares[0] <= shares[1] && shares[0] <= shares[2] {
            0
        } else if shares[1] <= shares[2] {
            1
        } else {
            2
        };
        let least = shares[part];
        let within = [shares[(part + 1) % 3] - least, shares[(part + 2) % 3] - least, 3.0 * least];
        let (place, slope) = self.parts[part].at(within);
        let normal: DVec3 = (0..3).map(|k| self.normals[k] * shares[k]).sum();
        let bend = from_fn(|axis| (0..3).map(|k| self.bends[k][axis] * shares[k]).sum());
        SurfaceFrame { place, slope, normal: normal.normalize_or(DVec3::Z), bend }
    }
}

impl Part {
    /// Place and slope by de Casteljau's steps.
    #[inline]
    fn at(&self, [r, s, t]: [f64; 3]) -> (DVec3, Slope) {
        let p = &self.points;
        let mix = |a: DVec3, b: DVec3, c: DVec3| a * r + b * s + c * t;
        let first = [
            mix(p[0], p[1], p[4]),
            mix(p[1], p[2], p[5]),
            mix(p[2], p[3], p[6]),
            mix(p[4], p[5], p[7]),
            mix(p[5], p[6], p[8]),
            mix(p[7], p[8], p[9]),
        ];
        let second = [
            mix(first[0], first[1], first[3]),
            mix(first[1], first[2], first[4]),
            mix(first[3], first[4], first[5]),
        ];
        let slope = from_fn(|axis| {
            (0..3).map(|k| second[k] * self.gradients[k][axis]).sum::<DVec3>() * 3.0
        });
        (mix(second[0], second[1], second[2]), slope)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::garment::Garment;

    /// A rectangle of 8 triangles, draped by a function of the flat place.
    fn draped(place: impl Fn(DVec2) -> DVec3) -> Panel {
        let mut panel = Garment::rectangle(4.0, 3.0).panels.remove(0);
        panel.uv =
            (0..9).map(|k| DVec2::new(f64::from(k % 3) * 2.0, f64::from(k / 3) * 1.5)).collect();
        panel.uv[4] += DVec2::new(0.3, -0.2);
        panel.triangles = [
            [0, 1, 4],
            [0, 4, 3],
            [1, 2, 5],
            [1, 5, 4],
            [3, 4, 7],
            [3, 7, 6],
            [4, 5, 8],
            [4, 8, 7],
        ]
        .to_vec();
        panel.draped = panel.uv.iter().map(|&uv| place(uv)).collect();
        panel.normals = vec![DVec3::Z; 9];
        let triangles = panel.triangles.clone();
        let mut normals = vec![DVec3::ZERO; 9];
        for corners in triangles {
            let [a, b, c] = corners.map(|v| panel.draped[v as usize]);
            corners.iter().for_each(|&v| normals[v as usize] += (b - a).cross(c - a));
        }
        panel.normals = normals.into_iter().map(DVec3::normalize).collect();
        panel
    }

    fn wavy(uv: DVec2) -> DVec3 {
        DVec3::new(
            1.1 * uv.x,
            0.9 * uv.y + 0.1 * uv.x,
            0.3 * uv.x.sin() + 0.2 * (uv.x * uv.y).cos(),
        )
    }

    #[test]
    fn an_affine_drape_is_met_exactly() {
        let panel = draped(|uv| DVec3::new(1.2 * uv.x + 0.1 * uv.y, 0.3, 0.8 * uv.y - 2.0));
        let surface = SmoothSurface::new(&panel);
        for triangle in 0..panel.triangles.len() {
            let patch = surface.patch(&panel, triangle);
            let [p, q, r] = panel.triangles[triangle].map(|v| panel.draped[v as usize]);
            for (b, c) in [(0.2, 0.3), (0.6, 0.1), (0.1, 0.8), (0.0, 0.5)] {
                let frame = patch.at(b, c);
                assert!(frame.place.distance(p + b * (q - p) + c * (r - p)) < 1e-12);
                assert!(frame.slope[0].distance(DVec3::new(1.2, 0.0, 0.0)) < 1e-12);
                assert!(frame.slope[1].distance(DVec3::new(0.1, 0.0, 0.8)) < 1e-12);
            }
        }
    }

    #[test]
    fn place_and_slope_are_continuous_across_edges() {
        let panel = draped(wavy);
        let surface = SmoothSurface::new(&panel);
        // The edge from vertex 4 to 0 is the last of triangle 0 and the first of triangle 1.
        let [one, other] = [0, 1].map(|triangle| surface.patch(&panel, triangle));
        for share in [0.0, 0.1, 0.37, 0.5, 0.8, 1.0] {
            let (a, b) = (one.at(0.0, share), other.at(share, 0.0));
            assert!(a.place.distance(b.place) < 1e-12);
            for axis in 0..2 {
                assert!(a.slope[axis].distance(b.slope[axis]) < 1e-12, "{share}");
            }
        }
    }

    #[test]
    fn the_slope_is_the_derivative_of_the_place() {
        let panel = draped(wavy);
        let patch = SmoothSurface::new(&panel).patch(&panel, 3);
        let [p, q, r] = panel.triangles[3].map(|v| panel.uv[v as usize]);
        for (b, c) in [(0.2, 0.3), (0.6, 0.1), (0.1, 0.7)] {
            let step = 1e-6;
            let along = (patch.at(b + step, c).place - patch.at(b - step, c).place) / (2.0 * step);
            let [u, v] = patch.at(b, c).slope;
            let expected = u * (q - p).x + v * (q - p).y;
            assert!(along.distance(expected) < 1e-6, "{along} {expected} {r}");
        }
    }

    #[test]
    fn a_cylinder_keeps_its_lengths() {
        let mut panel =
            draped(|uv| DVec3::new(10.0 * (uv.x / 10.0).sin(), uv.y, 10.0 * (uv.x / 10.0).cos()));
        for (normal, place) in panel.normals.iter_mut().zip(&panel.draped) {
            *normal = DVec3::new(place.x, 0.0, place.z) / 10.0;
        }
        let patch = SmoothSurface::new(&panel).patch(&panel, 3);
        let frame = patch.at(0.3, 0.3);
        // Between corners the surface lies near the cylinder, and its courses are hardly stretched.
        assert!((frame.slope[0].length() - 1.0).abs() < 0.01, "{}", frame.slope[0].length());
        assert!((DVec2::new(frame.place.x, frame.place.z).length() - 10.0).abs() < 0.02);
        // A layer outside the surface is longer by its depth over the radius.
        assert!((frame.bend[0].length() - 0.1).abs() < 0.02, "{}", frame.bend[0].length());
    }
}

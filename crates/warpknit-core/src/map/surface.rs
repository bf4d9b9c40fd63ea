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
//! Cost: linear in the triangles, and some 30 ns a place. Not promised: the surface keeps near the
//! triangles, but between corners it bulges where they bend.

use std::array::from_fn;

use glam::{DMat2, DVec2, DVec3};

use crate::garment::Panel;

/// The derivative of a map from the flat panel into space: along u, along v.
pub(crate) type Slope = [DVec3; 2];

/// The vertices of a draped panel with the slopes there.
#[derive(Clone, Debug, Default)]
pub(crate) struct SmoothSurface {
    vertices: Vec<SurfaceVertex>,
}

/// What the surface is at a vertex. It lies together in memory: triangles ask for all of it, and
/// for vertices in no order.
#[derive(Clone, Copy, Debug)]
struct SurfaceVertex {
    flat: DVec2,
    place: DVec3,
    normal: DVec3,
    slope: Slope,
    /// Slope of the unit normal: how the surface bends.
    bend: Slope,
}

impl SmoothSurface {
    /// Measures the slopes of a panel. Cost: about 100 ns a triangle.
    pub(crate) fn new(panel: &Panel) -> Self {
        let mut vertices: Vec<_> = (0..panel.uv.len())
            .map(|v| SurfaceVertex {
                flat: panel.uv[v],
                place: panel.draped[v],
                normal: panel.normals[v],
                slope: [DVec3::ZERO; 2],
                bend: [DVec3::ZERO; 2],
            })
            .collect();
        let mut areas = vec![0.0; vertices.len()];
        for ids in &panel.triangles {
            let ids = ids.map(|v| v as usize);
            let corners = ids.map(|v| vertices[v]);
            let gradients = Gradients::of(corners.map(|corner| corner.flat));
            let slope = gradients.slope(corners.map(|corner| corner.place));
            let bend = gradients.slope(corners.map(|corner| corner.normal));
            let normal = slope[0].cross(slope[1]).normalize_or_zero();
            for id in ids {
                let corner = &mut vertices[id];
                let turned = slope.map(|along| turned(along, normal, corner.normal));
                for axis in 0..2 {
                    corner.slope[axis] += turned[axis] * gradients.area;
                    corner.bend[axis] += bend[axis] * gradients.area;
                }
                areas[id] += gradients.area;
            }
        }
        for (vertex, area) in vertices.iter_mut().zip(areas).filter(|(_, area)| *area > 0.0) {
            vertex.slope = vertex.slope.map(|slope| slope / area);
            vertex.bend = vertex.bend.map(|bend| bend / area);
        }
        Self { vertices }
    }

    /// The patch of a triangle.
    pub(crate) fn patch(&self, panel: &Panel, triangle: usize) -> Patch {
        Patch::new(panel.triangles[triangle].map(|v| self.vertices[v as usize]))
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
    /// Bézier control points of the three parts. Part k lies opposite corner k, between the corners
    /// k + 1 and k + 2 and the middle. Order: b300, b210, b120, b030; b201, b111, b021; b102, b012;
    /// b003. The exponents count the first corner, the second and the middle.
    parts: [[DVec3; 10]; 3],
    /// Derivatives of the triangle's barycentric coordinates.
    gradients: [DVec2; 3],
    normals: [DVec3; 3],
    bends: [Slope; 3],
}

/// One part of a patch as a cubic polynomial.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PatchPart<'a> {
    patch: &'a Patch,
    /// Its number.
    number: usize,
    /// Coefficients of 1; s, t; s², st, t²; s³, s²t, st², t³. s is the barycentric coordinate of the
    /// part's second corner, t that of the middle.
    cubic: [DVec3; 10],
    /// Derivatives of s and t along u and along v.
    gradients: [DVec2; 2],
}

/// Numbers at several places side by side, so that the compiler computes them together.
type Lanes<const N: usize> = [f64; N];

/// Vectors at several places, coordinate by coordinate.
pub(crate) type LaneVec<const N: usize> = [Lanes<N>; 3];

/// The surface at several places.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfaceFrames<const N: usize> {
    pub(crate) place: LaneVec<N>,
    /// Along u, along v.
    pub(crate) slope: [LaneVec<N>; 2],
    /// Unit normal.
    pub(crate) normal: LaneVec<N>,
    /// Slope of the normal.
    pub(crate) bend: [LaneVec<N>; 2],
}

/// The part of a triangle in which a place lies, by the coordinates of its second and third corner:
/// the smallest coordinate tells.
#[inline]
pub(crate) fn part_of(b: f64, c: f64) -> usize {
    let a = 1.0 - b - c;
    if a <= b && a <= c {
        0
    } else if b <= c {
        1
    } else {
        2
    }
}

impl Patch {
    fn new(corners: [SurfaceVertex; 3]) -> Self {
        let flat = corners.map(|corner| corner.flat);
        let places = corners.map(|corner| corner.place);
        let slopes = corners.map(|corner| corner.slope);
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
        let parts = from_fn(|k| {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            [
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
            ]
        });
        Self {
            parts,
            gradients: Gradients::of(flat).corners,
            normals: corners.map(|corner| corner.normal),
            bends: corners.map(|corner| corner.bend),
        }
    }

    /// Distance of the surface from its flat triangle at most, mm: that of its control points, since
    /// a Bézier triangle lies within their hull. `corners` are the triangle's, in order.
    pub(crate) fn bulge(&self, corners: [DVec3; 3]) -> f64 {
        // The exponents of the control points, as `Self::parts` has them.
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
            for (point, [r, s, t]) in part.iter().zip(EXPONENTS) {
                let flat = (corners[i] * r + corners[j] * s + middle * t) / 3.0;
                farthest = farthest.max(point.distance(flat));
            }
        }
        farthest
    }

    /// A part as a polynomial.
    #[inline]
    pub(crate) fn part(&self, number: usize) -> PatchPart<'_> {
        let p = &self.parts[number];
        let cubic = [
            p[0],
            3.0 * (p[1] - p[0]),
            3.0 * (p[4] - p[0]),
            3.0 * (p[2] - 2.0 * p[1] + p[0]),
            6.0 * (p[5] - p[1] - p[4] + p[0]),
            3.0 * (p[7] - 2.0 * p[4] + p[0]),
            p[3] - p[0] + 3.0 * (p[1] - p[2]),
            3.0 * (p[6] - p[2] + 2.0 * (p[1] - p[5]) + p[4] - p[0]),
            3.0 * (p[8] - p[7] + 2.0 * (p[4] - p[5]) + p[1] - p[0]),
            p[9] - p[0] + 3.0 * (p[4] - p[7]),
        ];
        let gradients = [
            self.gradients[(number + 2) % 3] - self.gradients[number],
            3.0 * self.gradients[number],
        ];
        PatchPart { patch: self, number, cubic, gradients }
    }
}

impl PatchPart<'_> {
    /// The surface at places in this part, by barycentric coordinates of the triangle's second and
    /// third corner.
    #[inline]
    pub(crate) fn at<const N: usize>(&self, b: Lanes<N>, c: Lanes<N>) -> SurfaceFrames<N> {
        let shares: [Lanes<N>; 3] = [from_fn(|k| 1.0 - b[k] - c[k]), b, c];
        let least = shares[self.number];
        let second = shares[(self.number + 2) % 3];
        let (s, t): (Lanes<N>, Lanes<N>) =
            (from_fn(|k| second[k] - least[k]), from_fn(|k| 3.0 * least[k]));
        let mut place = [[0.0; N]; 3];
        let mut slope = [[[0.0; N]; 3]; 2];
        for axis in 0..3 {
            let [one, ms, mt, mss, mst, mtt, msss, msst, mstt, mttt] =
                self.cubic.map(|coefficient| coefficient[axis]);
            let [[su, sv], [tu, tv]] = self.gradients.map(|gradient| gradient.to_array());
            for k in 0..N {
                let (s, t) = (s[k], t[k]);
                place[axis][k] = one
                    + s * (ms + s * (mss + s * msss + t * msst) + t * mst)
                    + t * (mt + t * (mtt + s * mstt + t * mttt));
                let along_s =
                    ms + s * (2.0 * mss + 3.0 * s * msss + 2.0 * t * msst) + t * (mst + t * mstt);
                let along_t =
                    mt + t * (2.0 * mtt + 3.0 * t * mttt + 2.0 * s * mstt) + s * (mst + s * msst);
                slope[0][axis][k] = along_s * su + along_t * tu;
                slope[1][axis][k] = along_s * sv + along_t * tv;
            }
        }
        let bends = &self.patch.bends;
        let bend = from_fn(|way| blended(bends.map(|corner| corner[way]), &shares));
        let normal = normalised(blended(self.patch.normals, &shares));
        SurfaceFrames { place, slope, normal, bend }
    }
}

/// Interpolates the vectors of three corners.
#[inline]
fn blended<const N: usize>(corners: [DVec3; 3], shares: &[Lanes<N>; 3]) -> LaneVec<N> {
    let [p, q, r] = corners;
    from_fn(|axis| {
        from_fn(|k| p[axis] * shares[0][k] + q[axis] * shares[1][k] + r[axis] * shares[2][k])
    })
}

/// Vectors of unit length, and +z in place of zero.
#[inline]
fn normalised<const N: usize>(vectors: LaneVec<N>) -> LaneVec<N> {
    let [x, y, z] = &vectors;
    let squared: Lanes<N> = from_fn(|k| x[k] * x[k] + y[k] * y[k] + z[k] * z[k]);
    let over: Lanes<N> = from_fn(|k| 1.0 / squared[k].sqrt());
    // A selection, not a branch, which would stop the vectorisation.
    let unit = |axis: usize, otherwise: f64| {
        from_fn(|k| if squared[k] > 0.0 { vectors[axis][k] * over[k] } else { otherwise })
    };
    [unit(0, 0.0), unit(1, 0.0), unit(2, 1.0)]
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

    /// Place and slope at a place of a patch.
    fn at(patch: &Patch, b: f64, c: f64) -> (DVec3, Slope, Slope) {
        let frames = patch.part(part_of(b, c)).at([b], [c]);
        let single = |lanes: LaneVec<1>| DVec3::from_array(lanes.map(|lane| lane[0]));
        (single(frames.place), frames.slope.map(single), frames.bend.map(single))
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
                let (place, slope, _) = at(&patch, b, c);
                assert!(place.distance(p + b * (q - p) + c * (r - p)) < 1e-12);
                assert!(slope[0].distance(DVec3::new(1.2, 0.0, 0.0)) < 1e-12);
                assert!(slope[1].distance(DVec3::new(0.1, 0.0, 0.8)) < 1e-12);
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
            let (a, b) = (at(&one, 0.0, share), at(&other, share, 0.0));
            assert!(a.0.distance(b.0) < 1e-12);
            for axis in 0..2 {
                assert!(a.1[axis].distance(b.1[axis]) < 1e-12, "{share}");
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
            let (after, ..) = at(&patch, b + step, c);
            let (before, ..) = at(&patch, b - step, c);
            let along = (after - before) / (2.0 * step);
            let (_, [u, v], _) = at(&patch, b, c);
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
        let (place, slope, bend) = at(&patch, 0.3, 0.3);
        // Between corners the surface lies near the cylinder, and its courses are hardly stretched.
        assert!((slope[0].length() - 1.0).abs() < 0.01, "{}", slope[0].length());
        assert!((DVec2::new(place.x, place.z).length() - 10.0).abs() < 0.02);
        // A layer outside the surface is longer by its depth over the radius.
        assert!((bend[0].length() - 0.1).abs() < 0.02, "{}", bend[0].length());
    }
}

//! Tubes around yarns: St segments a stitch, Sr edges around, 2 · St · Sr triangles a stitch.
//!
//! In: strands of draped points ([`crate::drape`]). Out: vertices and triangles, in `f32` as every
//! file format takes them.
//!
//! Method: Liu, Kyosev and Jiang, Yarn-level modelling and geometric simulation of warp-knitted
//! clothing elements, 2022, sections 4.1 and 4.2, equation 6 and Table 1. The curve is that of
//! [`super::curve`], the frames are those of [`super::frame`]. Each stitch is sampled evenly in its
//! own parameter, with both ends on data points, so neighbouring stitches share a ring. A piece of
//! a stitch that the panel's edge has cut gets St segments too. Four rings are made at a time
//! (`rings`).
//!
//! Cost: about 20 ns a vertex with five edges, most of it for the ring. Where the ratio changes
//! from ring to ring, a vertex takes a root more.
//!
//! Not promised: tubes that don't intersect themselves in bends tighter than their radius. Ends are
//! open unless [`Section::caps`] is set.

use std::ops::Range;

use glam::{DVec3, Vec2, Vec3, Vec3A};

use super::lanes::LANES;
use super::outline::SectionOutline;
use super::rings::{FrameCarrier, Ring, RingStation};
use super::steps::Steps;
use super::walk::SpanCursor;
use crate::ids::index32;
use crate::number::narrow;

/// The largest number of segments in a stitch (the smallest is 1).
pub const MAX_ST: u32 = 256;
/// The range of edges around a tube's section.
pub const SR: std::ops::RangeInclusive<u32> = 3..=64;

/// The section of a tube and the fineness of its mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// St: segments along a stitch, 1..=256.
    pub st: u32,
    /// Sr: edges of the section, 3..=64.
    pub sr: u32,
    /// Radius, mm. For a flattened yarn it is that of the circle of the same area.
    pub radius: f64,
    /// Ratio of the section's width to its height. 1 is round; real warp-knit yarns are flattened
    /// in the fabric's plane.
    pub flatten: f64,
    /// Whether the ends are closed by flat discs.
    pub caps: bool,
    /// Mapping coefficient e: the texture coordinate v grows by e for each mm of yarn.
    pub texture_per_mm: f64,
}

impl Section {
    /// Triangles of one stitch: 2 · St · Sr.
    #[must_use]
    pub fn triangles_per_stitch(&self) -> u32 {
        2 * self.st * self.sr
    }

    /// The numbers of vertices and triangles of tubes with so many stitches and strands in total.
    #[must_use]
    pub fn size_of(&self, stitches: usize, strands: usize) -> (usize, usize) {
        let (st, sr) = (self.st as usize, self.sr as usize);
        // A strand of n stitches has n St + 1 rings, and each ring repeats its first vertex at the
        // texture's seam.
        let (cap_vertices, cap_triangles) = if self.caps { (2 * (sr + 1), 2 * sr) } else { (0, 0) };
        let vertices = (stitches * st + strands) * (sr + 1) + strands * cap_vertices;
        (vertices, stitches * 2 * st * sr + strands * cap_triangles)
    }
}

/// Tubes of many strands, one after the other.
#[derive(Clone, Debug, Default)]
pub struct Tubes {
    /// Vertex positions, mm.
    pub positions: Vec<Vec3>,
    /// Smooth unit normals, from the frame and not from faces.
    pub normals: Vec<Vec3>,
    /// Texture coordinates: u = s / Sr around the yarn, v = e · l along it.
    pub uvs: Vec<Vec2>,
    /// Vertex indices of the triangles, counter-clockwise from outside.
    pub triangles: Vec<[u32; 3]>,
    /// The vertex range and the triangle range of each strand.
    pub strands: Vec<(Range<u32>, Range<u32>)>,
}

impl Tubes {
    /// Removes everything but keeps the memory.
    pub fn clear(&mut self) {
        self.positions.clear();
        self.normals.clear();
        self.uvs.clear();
        self.triangles.clear();
        self.strands.clear();
    }

    /// Reserves memory for more tubes, with so many stitches and strands in total, so that nothing
    /// is moved while they are added.
    pub fn reserve(&mut self, stitches: usize, strands: usize, section: &Section) {
        let (vertices, triangles) = section.size_of(stitches, strands);
        self.positions.reserve(vertices);
        self.normals.reserve(vertices);
        self.uvs.reserve(vertices);
        self.triangles.reserve(triangles);
    }

    /// Adds the tube of one strand. `points` are two points or more in mm, `normals` the fabric's
    /// unit normal at each. `stitches` are ranges of points that share their ends, from the first
    /// point on.
    ///
    /// ```
    /// use glam::DVec3;
    /// use warpknit_core::yarn::tube::{Section, Tubes};
    /// let section =
    ///     Section { st: 10, sr: 5, radius: 0.1, flatten: 1.0, caps: false, texture_per_mm: 1.0 };
    /// let mut tubes = Tubes::default();
    /// tubes.add(&[DVec3::ZERO, DVec3::X, DVec3::ONE], &[DVec3::Z; 3], [0..3], &section);
    /// assert_eq!(tubes.triangles.len(), 100);
    /// ```
    pub fn add(
        &mut self,
        points: &[DVec3],
        normals: &[DVec3],
        stitches: impl IntoIterator<Item = Range<usize>>,
        section: &Section,
    ) {
        self.add_spread(points, normals, &[], stitches, section);
    }

    /// The same for a yarn that is more or less flat from point to point: `ratios`, at least 1,
    /// take the place of [`Section::flatten`] where there are any. Where such a yarn runs along
    /// the fabric's normal it is round.
    pub fn add_spread(
        &mut self,
        points: &[DVec3],
        normals: &[DVec3],
        ratios: &[f32],
        stitches: impl IntoIterator<Item = Range<usize>>,
        section: &Section,
    ) {
        let (first_vertex, first_triangle) =
            (index32(self.positions.len()), index32(self.triangles.len()));
        let mut rings = Rings::new(self, points, ratios, section);
        for stitch in stitches {
            rings.add_stitch(points, normals, stitch);
        }
        rings.finish();
        self.strands.push((
            first_vertex..index32(self.positions.len()),
            first_triangle..index32(self.triangles.len()),
        ));
    }
}

/// Adds the rings of one strand, one after the other.
struct Rings<'a> {
    tubes: &'a mut Tubes,
    section: &'a Section,
    /// Width over height at each point, or none.
    ratios: &'a [f32],
    outline: SectionOutline,
    steps: Steps,
    cursor: SpanCursor<'a>,
    /// Vector from the last ring to the first point of the current span.
    to_span: Vec3A,
    frames: FrameCarrier,
    /// Rings that wait until there are enough for a group, and their number.
    waiting: [RingStation; LANES],
    count: usize,
    first_vertex: u32,
    first: Option<Ring>,
    last: Option<Ring>,
}

impl<'a> Rings<'a> {
    fn new(
        tubes: &'a mut Tubes,
        points: &'a [DVec3],
        ratios: &'a [f32],
        section: &'a Section,
    ) -> Self {
        let first_vertex = index32(tubes.positions.len());
        Self {
            tubes,
            section,
            ratios,
            outline: SectionOutline::new(section),
            steps: Steps::default(),
            cursor: SpanCursor::new(points),
            to_span: Vec3A::ZERO,
            frames: FrameCarrier::new(section.flatten != 1.0 || !ratios.is_empty()),
            waiting: [RingStation::default(); LANES],
            count: 0,
            first_vertex,
            first: None,
            last: None,
        }
    }

    /// Adds St segments over the spans of one stitch, evenly spaced in its own parameter.
    fn add_stitch(&mut self, points: &[DVec3], normals: &[DVec3], stitch: Range<usize>) {
        self.steps.fit(stitch.len() - 1, self.section.st);
        let steps = std::mem::take(&mut self.steps);
        // From the second stitch on, the first ring is the last ring of the stitch before.
        let mut first = usize::from(self.last.is_some() || self.count > 0);
        for (index, parameters) in stitch.clone().zip(steps.per_span()) {
            let (span, chord) = self.cursor.next();
            let start = points[index].as_vec3a();
            let ups = [normals[index].as_vec3a(), normals[index + 1].as_vec3a()];
            let flatness = self.ratios.get(index..index + 2).map(|ends| {
                // 1 - 1 / ratio is the square of what changes evenly from point to point.
                [ends[0], ends[1]].map(|ratio| (1.0 - ratio.recip()).max(0.0).sqrt())
            });
            for &t in &parameters[first..] {
                let offset = span.at(t);
                // The chord between two rings is summed from small vectors. The difference of two
                // rounded positions on a garment would lose digits that the frame needs.
                let (along, up) = (span.tangent(t), ups[0].lerp(ups[1], t));
                let ratio = match flatness {
                    Some([start, end]) => {
                        let sine = along.normalize_or_zero().cross(up).length();
                        let flatness = (start + (end - start) * t) * sine;
                        (1.0 - flatness * flatness).recip()
                    }
                    None => narrow(self.section.flatten),
                };
                self.wait(RingStation {
                    center: start + offset,
                    chord: self.to_span + offset,
                    along,
                    up,
                    ratio,
                });
                self.to_span = -offset;
            }
            self.to_span += chord;
            first = 0;
        }
        self.steps = steps;
    }

    /// Adds a ring to those that wait, and all of them to the tube if they make a group.
    #[inline]
    fn wait(&mut self, station: RingStation) {
        self.waiting[self.count] = station;
        self.count += 1;
        if self.count == LANES {
            self.add_group();
        }
    }

    /// Adds the rings that wait.
    #[inline]
    fn add_group(&mut self) {
        let rings = self.frames.next(self.waiting);
        for ring in &rings[..self.count] {
            self.add_ring(*ring);
        }
        self.count = 0;
    }

    /// Adds a ring's vertices, and the triangles between it and the last ring.
    fn add_ring(&mut self, ring: Ring) {
        let base = index32(self.tubes.positions.len());
        let v = narrow(self.section.texture_per_mm * ring.length);
        if ring.ratio != self.outline.ratio {
            self.outline.flatten(self.section.radius, f64::from(ring.ratio));
        }
        // `f32` in four SIMD lanes: as exact as the files that take the vertices.
        let Ring { center, normal: up, binormal: sideways, .. } = ring;
        let SectionOutline { vertices, normals, u, triangles, .. } = &self.outline;
        // Each array is extended from an iterator of known length. A push for each vertex would
        // check the capacity each time.
        self.tubes.positions.extend(
            vertices
                .iter()
                .map(|vertex| Vec3::from(center + (up * vertex.x + sideways * vertex.y))),
        );
        self.tubes
            .normals
            .extend(normals.iter().map(|normal| Vec3::from(up * normal.x + sideways * normal.y)));
        self.tubes.uvs.extend(u.iter().map(|&u| Vec2::new(u, v)));
        match self.last {
            Some(_) => {
                let before = base - (self.section.sr + 1);
                self.tubes
                    .triangles
                    .extend(triangles.iter().map(|[a, b, c]| [before + a, before + b, before + c]));
            }
            None => self.first = Some(ring),
        }
        self.last = Some(ring);
    }

    /// Closes an end with a disc that faces `outward`. `rim` is the first vertex of the end's ring.
    fn cap(&mut self, ring: Ring, outward: Vec3A, rim: u32) {
        let base = index32(self.tubes.positions.len());
        let v = narrow(self.section.texture_per_mm * ring.length);
        // The rim is repeated: its normals point outward here, and sideways on the tube.
        self.tubes.positions.push(Vec3::from(ring.center));
        self.tubes.uvs.push(Vec2::new(0.5, v));
        for s in 0..self.section.sr {
            let position = self.tubes.positions[(rim + s) as usize];
            self.tubes.positions.push(position);
            self.tubes.uvs.push(Vec2::new(0.5, v));
        }
        self.tubes
            .normals
            .extend(std::iter::repeat_n(Vec3::from(outward), self.section.sr as usize + 1));
        // Counter-clockwise from outside is clockwise along the tube at its start.
        let ahead = outward.dot(ring.tangent) > 0.0;
        for s in 0..self.section.sr {
            let (p, q) = (base + 1 + s, base + 1 + (s + 1) % self.section.sr);
            self.tubes.triangles.push(if ahead { [base, p, q] } else { [base, q, p] });
        }
    }

    /// Adds the last rings, and both caps if the section has them.
    fn finish(&mut self) {
        if self.count > 0 {
            self.add_group();
        }
        let (Some(first), Some(last), true) = (self.first, self.last, self.section.caps) else {
            return;
        };
        let last_rim = index32(self.tubes.positions.len()) - (self.section.sr + 1);
        self.cap(first, -first.tangent, self.first_vertex);
        self.cap(last, last.tangent, last_rim);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn section(st: u32, sr: u32, caps: bool) -> Section {
        Section { st, sr, radius: 0.25, flatten: 1.0, caps, texture_per_mm: 2.0 }
    }

    fn straight(st: u32, sr: u32, caps: bool) -> Tubes {
        let points: Vec<_> = (0..9).map(|i| DVec3::new(f64::from(i), 0.0, 0.0)).collect();
        let mut tubes = Tubes::default();
        for _ in 0..2 {
            tubes.add(&points, &[DVec3::Z; 9], [0..5, 4..9], &section(st, sr, caps));
        }
        tubes
    }

    #[test]
    fn triangle_counts_of_the_table() {
        for (st, sr, triangles) in
            [(10, 5, 100), (25, 5, 250), (40, 5, 400), (10, 13, 260), (25, 13, 650), (40, 13, 1040)]
        {
            assert_eq!(section(st, sr, false).triangles_per_stitch(), triangles);
            let tubes = straight(st, sr, false);
            assert_eq!(tubes.triangles.len(), 4 * triangles as usize);
            assert_eq!(tubes.positions.len(), section(st, sr, false).size_of(4, 2).0);
        }
    }

    #[test]
    fn a_straight_yarn_is_a_cylinder() {
        let tubes = straight(10, 8, false);
        for ((position, normal), uv) in tubes.positions.iter().zip(&tubes.normals).zip(&tubes.uvs) {
            assert!((position.y.hypot(position.z) - 0.25).abs() < 1e-6);
            assert!((Vec3::new(0.0, position.y, position.z) / 0.25 - *normal).length() < 1e-5);
            assert!((uv.y - 2.0 * position.x).abs() < 1e-4, "v is e times the yarn's length");
        }
    }

    #[test]
    fn a_flattened_yarn_lies_in_the_fabrics_plane_and_keeps_its_area() {
        let points: Vec<_> = (0..9).map(|i| DVec3::new(f64::from(i), 0.0, 0.0)).collect();
        let mut tubes = Tubes::default();
        let flat = Section { flatten: 4.0, ..section(4, 64, false) };
        tubes.add(&points, &[DVec3::Z; 9], std::iter::once(0..9), &flat);
        let widest =
            |axis: usize| tubes.positions.iter().map(|p| p[axis].abs()).fold(0.0, f32::max);
        assert!(
            (widest(1) - 0.5).abs() < 1e-3 && (widest(2) - 0.125).abs() < 1e-3,
            "half-width 2r, half-height r/2"
        );
        for (position, normal) in tubes.positions.iter().zip(&tubes.normals) {
            let gradient = Vec3::new(0.0, position.y / 0.25, position.z / 0.015_625).normalize();
            assert!((gradient - *normal).length() < 1e-4);
        }
    }

    #[test]
    fn a_spread_yarn_widens_from_point_to_point_and_keeps_its_area() {
        let points: Vec<_> = (0..9).map(|i| DVec3::new(f64::from(i), 0.0, 0.0)).collect();
        let mut tubes = Tubes::default();
        let ratios = [1.0, 1.0, 1.0, 1.0, 4.0, 1.0, 1.0, 1.0, 1.0];
        let stitches = std::iter::once(0..9);
        tubes.add_spread(&points, &[DVec3::Z; 9], &ratios, stitches, &section(16, 64, false));
        let widest = |x: f32, axis: usize| {
            let ring = tubes.positions.iter().filter(|p| (p.x - x).abs() < 1e-4);
            ring.map(|p| p[axis].abs()).fold(0.0, f32::max)
        };
        // Halfway, 1 - 1 / ratio is a quarter of what it is at the flat point.
        let middle = (1.0 - 0.25 * 0.75_f32).recip();
        for (x, ratio) in [(1.0, 1.0), (3.5, middle), (4.0, 4.0), (7.0, 1.0)] {
            let off = [widest(x, 1) - 0.25 * ratio.sqrt(), widest(x, 2) - 0.25 / ratio.sqrt()];
            assert!(off.iter().all(|off| off.abs() < 2e-3), "{x}: {off:?}");
        }
    }

    #[test]
    fn a_capped_tube_is_closed_and_holds_its_volume() {
        let tubes = straight(7, 64, true);
        assert_eq!(tubes.triangles.len(), section(7, 64, true).size_of(4, 2).1);
        assert_eq!(tubes.positions.len(), section(7, 64, true).size_of(4, 2).0);
        let corner = |v: u32| tubes.positions[v as usize].as_dvec3();
        let six_volumes = tubes
            .triangles
            .iter()
            .map(|t| t.map(corner))
            .map(|[a, b, c]| a.dot(b.cross(c)))
            .sum::<f64>();
        let cylinder = std::f64::consts::PI * 0.25 * 0.25 * 8.0;
        assert!(
            (six_volumes / 6.0 / 2.0 - cylinder).abs() < 0.01 * cylinder,
            "outward windings add up to the volume"
        );
    }

    #[test]
    fn a_bent_yarn_keeps_its_radius_and_its_frames_never_flip() {
        let points: Vec<_> = (0..60)
            .map(|i| f64::from(i) * 0.3)
            .map(|a| DVec3::new(a.cos(), a.sin() * 2.0, a * 0.1))
            .collect();
        let mut tubes = Tubes::default();
        tubes.add(
            &points,
            &[DVec3::Z; 60],
            std::iter::once(0..points.len()),
            &section(256, 6, false),
        );
        for ring in tubes.normals.windows(8) {
            assert!(ring[0].dot(ring[7]) > 0.9, "neighbouring rings turn little");
        }
    }
}

//! What a renderer draws: yarns as control points, and what they are made of.
//!
//! In: the strands of the blocks that [`crate::drape`] hands out. Out: structure-of-arrays control points in `f32`, 12 bytes a
//! data point, so that millions of stitches fit; renderers expand them on their own.

use crate::ids::index32;
use glam::Vec3;

/// Renderers pass over points with a larger coordinate, mm: ten kilometres, where `f32` has lost whole stitches.
pub const FARTHEST: f32 = 1e7;

/// Whether renderers take `point` for a point of a yarn: finite and not beyond [`FARTHEST`].
#[must_use]
pub fn drawable(point: Vec3) -> bool {
    point.abs().cmple(Vec3::splat(FARTHEST)).all()
}

/// How a yarn looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct YarnLook {
    /// Base colour, linear RGB 0..1.
    pub albedo: Vec3,
    /// Perceived roughness 0..1 (Beckmann's `a` is its square).
    pub roughness: f32,
    /// 0 for fibres, 1 for metal.
    pub metallic: f32,
    /// Radius, mm.
    pub radius: f32,
    /// Single yarns that are wound around each other.
    pub plies: u32,
    /// Circumference over the length of one turn of the plies, or of the fibres where there is one ply; S over 0, Z under 0. A middling
    /// twist where it isn't known.
    pub twist_slope: Option<f32>,
}

impl YarnLook {
    /// Fibres of one colour in three plies of a middling twist.
    #[must_use]
    pub const fn plain(albedo: Vec3, roughness: f32, radius: f32) -> Self {
        Self { albedo, roughness, metallic: 0.0, radius, plies: 3, twist_slope: None }
    }
}

/// One uninterrupted run of yarn.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Strand {
    /// Its control points in [`Scene::positions`].
    pub points: std::ops::Range<u32>,
    /// Its look in [`Scene::looks`].
    pub look: u16,
}

/// Everything in front of the camera.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Control points of all strands, mm; the yarn passes through each (centripetal Catmull-Rom, [`crate::yarn::curve`]).
    pub positions: Vec<Vec3>,
    /// Strands, in yarn order.
    pub strands: Vec<Strand>,
    /// Looks, one a guide bar.
    pub looks: Vec<YarnLook>,
}

/// An axis-aligned box, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Smallest corner.
    pub min: Vec3,
    /// Largest corner.
    pub max: Vec3,
}

impl Bounds {
    /// The middle of the box.
    #[must_use]
    pub fn centre(&self) -> Vec3 {
        self.min.midpoint(self.max)
    }

    /// All eight corners.
    #[must_use]
    pub fn corners(&self) -> [Vec3; 8] {
        let pick = |corner: usize, axis: usize| if corner >> axis & 1 == 0 { self.min[axis] } else { self.max[axis] };
        std::array::from_fn(|corner| Vec3::from_array(std::array::from_fn(|axis| pick(corner, axis))))
    }
}

impl Scene {
    /// Appends one strand through `points` with the look at index `look`.
    ///
    /// ```
    /// use glam::Vec3;
    /// let mut scene = warpknit::scene::Scene::default();
    /// scene.push_strand([Vec3::ZERO, Vec3::X], 0);
    /// assert_eq!(scene.strands[0].points, 0..2);
    /// ```
    pub fn push_strand(&mut self, points: impl IntoIterator<Item = Vec3>, look: u16) {
        let start = index32(self.positions.len());
        self.positions.extend(points);
        self.strands.push(Strand { points: start..index32(self.positions.len()), look });
    }

    /// The radius of a strand, if it is one that can be drawn: above 0 and under [`FARTHEST`].
    #[must_use]
    pub fn radius(&self, strand: &Strand) -> Option<f32> {
        let radius = self.looks[usize::from(strand.look)].radius;
        (radius > 0.0 && radius < FARTHEST).then_some(radius)
    }

    /// The box around all yarns, their radii included; `None` where nothing is there to be seen.
    ///
    /// The curve between two data points may leave the box by a little: Catmull-Rom curves overshoot their points.
    #[must_use]
    pub fn bounds(&self) -> Option<Bounds> {
        let mut bounds: Option<Bounds> = None;
        for strand in &self.strands {
            let Some(radius) = self.radius(strand) else { continue };
            let points = &self.positions[strand.points.start as usize..strand.points.end as usize];
            for &point in points.iter().filter(|&&point| drawable(point)) {
                let ball = Bounds { min: point - radius, max: point + radius };
                bounds = Some(bounds.map_or(ball, |b| Bounds { min: b.min.min(ball.min), max: b.max.max(ball.max) }));
            }
        }
        bounds
    }
}

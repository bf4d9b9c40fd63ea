//! What a renderer draws: yarns as control points, and what they are made of.
//!
//! In: the strands of the blocks that [`crate::drape`] hands out. Out: structure-of-arrays control
//! points in `f32`, 12 bytes a data point and 4 a stitch, so that millions of stitches fit;
//! renderers expand them on their own.

use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use crate::ids::index32;
use crate::render::maps::Maps;
use crate::unit::PackedUnit;

/// Renderers pass over points with a larger coordinate, mm: ten kilometres, where `f32` has lost
/// whole stitches.
pub const MAX_COORDINATE: f32 = 1e7;

/// Whether renderers take `point` for a point of a yarn: finite and not beyond [`MAX_COORDINATE`].
#[must_use]
pub fn drawable(point: Vec3) -> bool {
    point.abs().cmple(Vec3::splat(MAX_COORDINATE)).all()
}

/// Whether renderers draw yarns of some radius.
fn is_drawable_radius(radius: f32) -> bool {
    radius > 0.0 && radius < MAX_COORDINATE
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
    /// Circumference over the length of one turn of the plies, or of the fibres where there is one
    /// ply; S over 0, Z under 0. A middling twist where it isn't known.
    pub twist_slope: Option<f32>,
    /// How much its fibres mirror, 0 for dull ones to 1; see [`crate::render::sheen`].
    pub sheen: f32,
    /// Its pictures in [`Scene::maps`]; a plain yarn has none, and plies and fibres are made up.
    pub maps: Option<u16>,
}

impl YarnLook {
    /// Fibres of one colour in three plies of a middling twist.
    #[must_use]
    pub const fn plain(albedo: Vec3, roughness: f32, radius: f32) -> Self {
        Self {
            albedo,
            roughness,
            metallic: 0.0,
            radius,
            plies: 3,
            twist_slope: None,
            sheen: 0.0,
            maps: None,
        }
    }
}

/// What yarns are drawn as.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shape {
    /// Round, with [`YarnLook::radius`].
    #[default]
    Tube,
    /// Flat strips in the fabric's plane, [`YarnLook::radius`] to either side of the axis, lit as
    /// the fabric's surface is.
    Ribbon,
}

/// One uninterrupted run of yarn.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SceneStrand {
    /// Its control points in [`Scene::positions`].
    pub points: Range<u32>,
    /// Its stitches in [`Scene::stitches`].
    pub stitches: Range<u32>,
    /// Its look in [`Scene::looks`].
    pub look: u16,
}

/// Everything in front of the camera.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// What all yarns are drawn as.
    pub shape: Shape,
    /// Control points of all strands, mm; the yarn passes through each (centripetal Catmull-Rom,
    /// [`crate::yarn::curve`]).
    pub positions: Vec<Vec3>,
    /// The fabric's normal at each, for ribbons; tubes need none.
    pub normals: Vec<PackedUnit>,
    /// First control points of the stitches.
    pub stitches: Vec<u32>,
    /// Strands, in yarn order; their ranges of points rise and don't overlap.
    pub strands: Vec<SceneStrand>,
    /// Looks, one a guide bar.
    pub looks: Vec<YarnLook>,
    /// Pictures of yarns that looks name.
    pub maps: Vec<Maps>,
}

/// How far neighbouring data points lie apart, mm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpanLengths {
    /// Of all together.
    pub sum: f64,
    /// How many there are.
    pub count: u64,
    /// The longest.
    pub longest: f64,
}

impl SpanLengths {
    fn with(self, length: f64) -> Self {
        Self { sum: self.sum + length, count: self.count + 1, longest: self.longest.max(length) }
    }
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
        let pick = |corner: usize, axis: usize| {
            if corner >> axis & 1 == 0 { self.min[axis] } else { self.max[axis] }
        };
        std::array::from_fn(|corner| {
            Vec3::from_array(std::array::from_fn(|axis| pick(corner, axis)))
        })
    }
}

impl Scene {
    /// An empty scene for yarns of these looks that wear `maps`, those at `worn(bar)`: tubes what
    /// of the pictures goes around them, and ribbons are as wide as their pictures.
    pub fn with_textures(
        shape: Shape,
        mut looks: Vec<YarnLook>,
        maps: Vec<Maps>,
        worn: impl Fn(usize) -> Option<u16>,
    ) -> Self {
        let maps: Vec<_> = maps.into_iter().map(|maps| maps.for_shape(shape)).collect();
        for (bar, look) in looks.iter_mut().enumerate() {
            look.maps = worn(bar);
            if let (Some(place), Shape::Ribbon) = (look.maps, shape) {
                look.radius = maps[usize::from(place)].width / 2.0;
            }
        }
        Self { shape, looks, maps, ..Self::default() }
    }

    /// Forgets the yarns, and keeps what they look like.
    pub fn clear(&mut self) {
        self.positions.clear();
        self.normals.clear();
        self.stitches.clear();
        self.strands.clear();
    }

    /// Appends one strand through `points` with the look at index `look`, all of it one stitch, in
    /// a fabric that faces +z.
    ///
    /// ```
    /// use glam::Vec3;
    /// let mut scene = warpknit::scene::Scene::default();
    /// scene.push_strand([Vec3::ZERO, Vec3::X], 0);
    /// assert_eq!(scene.strands[0].points, 0..2);
    /// ```
    pub fn push_strand(&mut self, points: impl IntoIterator<Item = Vec3>, look: u16) {
        self.push_stitches(points.into_iter().map(|point| (point, Vec3::Z)), [0], look);
    }

    /// Appends one strand through points, each with the fabric's unit normal there, and says which
    /// of them begin stitches, from 0.
    pub fn push_stitches(
        &mut self,
        points: impl IntoIterator<Item = (Vec3, Vec3)>,
        stitches: impl IntoIterator<Item = u32>,
        look: u16,
    ) {
        let (start, first) = (index32(self.positions.len()), index32(self.stitches.len()));
        for (point, normal) in points {
            self.positions.push(point);
            if self.shape == Shape::Ribbon {
                self.normals.push(PackedUnit::new(normal));
            }
        }
        self.stitches.extend(stitches.into_iter().map(|stitch| start + stitch));
        let (points, stitches) =
            (start..index32(self.positions.len()), first..index32(self.stitches.len()));
        self.strands.push(SceneStrand { points, stitches, look });
    }

    /// The pictures of a look, if it has any.
    #[must_use]
    pub fn maps_of(&self, look: &YarnLook) -> Option<&Maps> {
        self.maps.get(usize::from(look.maps?))
    }

    /// The colour of all of a look's yarn, linear RGB.
    #[must_use]
    pub fn albedo_of(&self, look: &YarnLook) -> Vec3 {
        self.maps_of(look).map_or(look.albedo, Maps::mean_albedo)
    }

    /// The colour of all yarn, by the share of the data points that each look has: what light
    /// between the yarns takes on.
    #[must_use]
    pub fn mean_albedo(&self) -> Vec3 {
        let drawn = self.strands.iter().filter(|strand| self.radius(strand).is_some());
        let (sum, points) = drawn.fold((Vec3::ZERO, 0.0), |(sum, points), strand| {
            let own = strand.points.len() as f32;
            (sum + self.albedo_of(&self.looks[usize::from(strand.look)]) * own, points + own)
        });
        if points > 0.0 { sum / points } else { Vec3::ZERO }
    }

    /// Radii of the thinnest and the thickest yarn that is drawn, mm; infinite and 0 where there is
    /// none.
    #[must_use]
    pub fn radii(&self) -> (f32, f32) {
        let drawn = self.strands.iter().filter_map(|strand| self.radius(strand));
        drawn.fold((f32::INFINITY, 0.0), |(thinnest, thickest), radius| {
            (radius.min(thinnest), radius.max(thickest))
        })
    }

    /// How far the data points that are drawn lie from the next one on their strand.
    #[must_use]
    pub fn span_lengths(&self) -> SpanLengths {
        let of_strand = |strand: &SceneStrand| {
            let points = &self.positions[strand.points.start as usize..strand.points.end as usize];
            let drawn = points.windows(2).filter(|ends| ends.iter().all(|end| drawable(*end)));
            drawn
                .map(|ends| f64::from(ends[0].distance(ends[1])))
                .fold(SpanLengths::default(), SpanLengths::with)
        };
        // Summed in order, so that any number of threads finds the same.
        let strands: Vec<SpanLengths> = self.strands.par_iter().map(of_strand).collect();
        strands.into_iter().fold(SpanLengths::default(), |sum, own| SpanLengths {
            sum: sum.sum + own.sum,
            count: sum.count + own.count,
            longest: sum.longest.max(own.longest),
        })
    }

    /// The radius of a strand, if it is one that can be drawn: above 0 and under [`MAX_COORDINATE`].
    #[must_use]
    pub fn radius(&self, strand: &SceneStrand) -> Option<f32> {
        let radius = self.looks[usize::from(strand.look)].radius;
        is_drawable_radius(radius).then_some(radius)
    }

    /// The box around all yarns, their radii included; `None` where nothing is there to be seen.
    ///
    /// The curve between two data points may leave the box by a little: Catmull-Rom curves
    /// overshoot their points.
    #[must_use]
    pub fn bounds(&self) -> Option<Bounds> {
        let mut bounds: Option<Bounds> = None;
        for strand in &self.strands {
            let Some(radius) = self.radius(strand) else { continue };
            let points = &self.positions[strand.points.start as usize..strand.points.end as usize];
            for &point in points.iter().filter(|&&point| drawable(point)) {
                let ball = Bounds { min: point - radius, max: point + radius };
                bounds = Some(bounds.map_or(ball, |b| Bounds {
                    min: b.min.min(ball.min),
                    max: b.max.max(ball.max),
                }));
            }
        }
        bounds
    }
}

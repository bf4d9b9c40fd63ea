//! The scene: what renderers draw. Yarns are control points with a look for each guide bar.
//!
//! In: strands of the blocks that [`warpknit_core::drape`] hands out. Out: control points in `f32`
//! as a structure of arrays, with 12 bytes a data point, or 16 where yarns are flattened, and 4 a
//! stitch, so that millions of stitches fit into memory. Renderers subdivide the curves on their
//! own.

use std::ops::Range;
use std::sync::Arc;

use glam::Vec3;
use rayon::prelude::*;

use crate::limits::is_drawable_radius;
pub use crate::limits::{MAX_COORDINATE, drawable};
pub use crate::look::{YarnKind, YarnLook};
use crate::look::{cloth_radii, radii};
use crate::maps::Maps;
use crate::octahedral::PackedUnit;
use crate::oval::{PackedPress, Press};
use crate::ply;
pub use crate::shape::Shape;
use warpknit_core::drape::evenness::{self, Evenness};
use warpknit_core::ids::{YarnId, index32};
use warpknit_core::knit::spread::Spread;
use warpknit_core::number::narrow;

/// Spans that count as a stitch in strands without any. The graphics card divides each stitch into as many
/// pieces, and a knitted stitch has about as many spans.
const STITCH_SPANS: u32 = 10;
/// Radius of sewing thread, pixels, up to which it does not decide against coverage masks. In masks
/// it has no plies, and with a higher limit it would show straight pieces. With a lower one, cloth
/// of fine yarns would be traced, with noise, because of a few threads.
const MASKED_THREAD_PIXELS: f32 = 4.0;

/// A yarn, or a run of one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SceneStrand {
    /// Range of its control points in [`Scene::positions`].
    pub points: Range<u32>,
    /// Range of its stitches in [`Scene::stitches`].
    pub stitches: Range<u32>,
    /// Index of its look in [`Scene::looks`].
    pub look: u16,
    /// Number of its yarn. It decides where along the yarn plies and textures begin.
    pub yarn: u32,
    /// Number of its first point, counted along its yarn: where it is thick and thin.
    pub first: i64,
    /// How many of its first points need not be drawn: they lie out of view, and only tell how the
    /// plies lie that are in view.
    pub lead: u32,
    /// Whether it is out of view and only casts the sun's shadow, so that a coarse one will do.
    pub is_shadow: bool,
}

/// Everything in front of the camera.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Primitive that all yarns are drawn as.
    pub shape: Shape,
    /// Whether yarns vary in thickness and lightness.
    pub evenness: Evenness,
    /// How flat the cloth's yarns lie. Otherwise [`YarnLook::flatten`] tells.
    pub spread: Option<Arc<Spread>>,
    /// Control points of all strands, mm. The yarn passes through each of them (centripetal
    /// Catmull-Rom, [`warpknit_core::yarn::curve`]).
    pub positions: Vec<Vec3>,
    /// Normal of the fabric at each control point, for ribbons. Empty for tubes.
    pub normals: Vec<PackedUnit>,
    /// How yarns are pressed at each control point, for tubes. Empty where all of them are round.
    pub presses: Vec<PackedPress>,
    /// Index of the first control point of each stitch.
    pub stitches: Vec<u32>,
    /// Strands in yarn order. Their ranges of points rise and do not overlap.
    pub strands: Vec<SceneStrand>,
    /// Looks, one for each guide bar.
    pub looks: Vec<YarnLook>,
    /// Textures that looks refer to.
    pub maps: Vec<Maps>,
    /// Box around the whole cloth, if the scene holds what a picture sees of it. So a picture does
    /// not depend on how much of the cloth is there.
    pub extent: Option<Bounds>,
}

/// A control point of a yarn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScenePoint {
    /// Its place, mm.
    pub position: Vec3,
    /// The fabric's unit normal there.
    pub normal: Vec3,
    /// Width over height of the yarn's section, from 0.1 to 10. Within a strand it is nowhere
    /// over 1 or nowhere under 1.
    pub flatten: f32,
}

/// Distances between neighbouring data points, mm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpanLengths {
    /// Sum of all distances.
    pub sum: f64,
    /// Number of distances.
    pub count: u64,
    /// The longest distance.
    pub longest: f64,
}

impl SpanLengths {
    /// These lengths with one more.
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

    /// The box around drawable points. `None` without any.
    #[must_use]
    pub fn around(points: &[Vec3]) -> Option<Self> {
        let balls = points.iter().filter(|point| drawable(**point));
        balls.map(|&point| Self { min: point, max: point }).reduce(Self::union)
    }

    /// The box around both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// All eight corners.
    #[must_use]
    pub fn corners(&self) -> [Vec3; 8] {
        // Bit `axis` of a corner's number chooses between the smaller and the larger coordinate.
        std::array::from_fn(|corner| {
            Vec3::from_array(std::array::from_fn(|axis| {
                if corner >> axis & 1 == 0 { self.min[axis] } else { self.max[axis] }
            }))
        })
    }
}

impl Scene {
    /// An empty scene for yarns of these looks, textured with `maps`. `texture_of(bar)` is the
    /// index of a bar's texture. For tubes, textures are converted so that they wrap around.
    /// Ribbons become as wide as their textures.
    pub fn with_textures(
        shape: Shape,
        mut looks: Vec<YarnLook>,
        maps: Vec<Maps>,
        texture_of: impl Fn(usize) -> Option<u16>,
    ) -> Self {
        // A tube shows the texture from all sides, so it is converted once, here.
        let maps: Vec<_> = maps.into_iter().map(|maps| maps.for_shape(shape)).collect();
        for (bar, look) in looks.iter_mut().enumerate() {
            look.maps = texture_of(bar);
            if let (Some(texture), Shape::Ribbon) = (look.maps, shape) {
                look.radius = maps[usize::from(texture)].width / 2.0;
            }
        }
        Self { shape, looks, maps, ..Self::default() }
    }

    /// The same, with sections `ratio` times as wide as high. It has no yarns yet.
    #[must_use]
    pub fn flattened(mut self, ratio: f64) -> Self {
        self.looks.iter_mut().for_each(|look| look.flatten = narrow(ratio));
        self
    }

    /// Removes the yarns and keeps their looks.
    pub fn clear(&mut self) {
        self.positions.clear();
        self.normals.clear();
        self.presses.clear();
        self.stitches.clear();
        self.strands.clear();
    }

    /// Appends one strand through `points` with the look at index `look`, in a fabric that faces +z. As
    /// it has no stitches, ten spans in a row count as one.
    ///
    /// ```
    /// use glam::Vec3;
    /// let mut scene = warpknit_render::scene::Scene::default();
    /// scene.push_strand([Vec3::ZERO, Vec3::X], 0);
    /// assert_eq!(scene.strands[0].points, 0..2);
    /// ```
    pub fn push_strand(&mut self, points: impl IntoIterator<Item = Vec3>, look: u16) {
        let flatten = self.flatten(look);
        let facing = |position| ScenePoint { position, normal: Vec3::Z, flatten };
        self.push_stitches(points.into_iter().map(facing), [0], look);
        if let Some(SceneStrand { points, stitches, .. }) = self.strands.last_mut() {
            // No stitch begins at the last point, where no span does.
            let further = (points.start + STITCH_SPANS)..points.end.saturating_sub(1);
            self.stitches.extend(further.step_by(STITCH_SPANS as usize));
            stitches.end = index32(self.stitches.len());
        }
    }

    /// Appends one strand through points. `stitches` are the indices, from 0, of the points that
    /// begin stitches.
    pub fn push_stitches(
        &mut self,
        points: impl IntoIterator<Item = ScenePoint>,
        stitches: impl IntoIterator<Item = u32>,
        look: u16,
    ) {
        // Indices are 32 bits wide: half the memory of `usize`.
        let (start, first) = (index32(self.positions.len()), index32(self.stitches.len()));
        for ScenePoint { position, normal, flatten } in points {
            match self.shape {
                Shape::Ribbon => self.normals.push(PackedUnit::new(normal)),
                Shape::Tube if flatten != 1.0 || !self.presses.is_empty() => {
                    self.presses.resize(self.positions.len(), PackedPress::default());
                    self.presses.push(PackedPress::new(normal, flatten));
                }
                Shape::Tube => {}
            }
            self.positions.push(position);
        }
        self.stitches.extend(stitches.into_iter().map(|stitch| start + stitch));
        let (points, stitches) =
            (start..index32(self.positions.len()), first..index32(self.stitches.len()));
        let yarn = index32(self.strands.len());
        self.strands.push(SceneStrand {
            points,
            stitches,
            look,
            yarn,
            first: 0,
            lead: 0,
            is_shadow: false,
        });
    }

    /// Appends some points of another scene's strand as a strand with its look, with one more point on
    /// each side, which gives the curve its direction there.
    pub(crate) fn push_part(&mut self, of: &Self, strand: usize, points: Range<u32>) {
        let SceneStrand { points: all, look, .. } = &of.strands[strand];
        let (start, end) =
            (points.start.saturating_sub(1).max(all.start), all.end.min(points.end + 1));
        self.push_range(of, start..end, *look);
    }

    /// Appends some control points of another scene as a strand.
    pub(crate) fn push_range(&mut self, of: &Self, points: Range<u32>, look: u16) {
        let range = points.start as usize..points.end as usize;
        let first = self.positions.len();
        self.push_strand(of.positions[range.clone()].iter().copied(), look);
        if !of.presses.is_empty() {
            self.presses.truncate(first);
            self.presses.resize(first, PackedPress::default());
            self.presses.extend_from_slice(&of.presses[range]);
        }
    }

    /// Width over height of the sections of yarns with a look, where no [`Self::spread`] tells.
    #[must_use]
    pub fn flatten(&self, look: u16) -> f32 {
        self.looks.get(usize::from(look)).map_or(1.0, |look| look.flatten)
    }

    /// How the yarn is pressed at a control point; `None` where all yarns are round.
    pub(crate) fn press(&self, point: u32) -> Option<Press> {
        self.presses.get(point as usize).map(|press| press.unpack())
    }

    /// The textures of a look, if it has any.
    #[must_use]
    pub fn maps_of(&self, look: &YarnLook) -> Option<&Maps> {
        self.maps.get(usize::from(look.maps?))
    }

    /// Whether pixels of this size, mm, show how any yarn of the cloth is turned about its axis: by
    /// its plies, its fibres or its textures.
    #[must_use]
    pub fn shows_turns(&self, pixel: f64) -> bool {
        self.looks.iter().filter(|look| look.kind != YarnKind::SewingThread).any(|look| {
            look.maps.is_some() || pixel < f64::from(ply::coarsest_detail(look.plies, look.radius))
        })
    }

    /// Mean colour of a look's yarn, linear RGB.
    #[must_use]
    pub fn albedo_of(&self, look: &YarnLook) -> Vec3 {
        self.maps_of(look).map_or(look.albedo, Maps::mean_albedo)
    }

    /// Size of a pixel above which the processor draws strands as coverage masks, mm. Then yarns are
    /// up to two pixels wide, and no pixel shows their bends. With textures they are up to a pixel
    /// wide, because places around a yarn are left out there. Sewing thread may be wider.
    ///
    /// A scene that is still empty counts with all its looks.
    #[must_use]
    pub fn mask_pixel(&self) -> f32 {
        let waiting = self.looks.iter().filter(|_| self.strands.is_empty());
        let looks = self.strand_looks().chain(waiting);
        let ((_, cloth), (_, any)) = (cloth_radii(looks.clone()), radii(looks));
        let textured = if self.maps.is_empty() { 1.0 } else { 2.0 };
        (textured * cloth).max(any / MASKED_THREAD_PIXELS)
    }

    /// Mean colour of all yarns, weighted by their data points. Light that is reflected between
    /// yarns takes on this colour.
    #[must_use]
    pub fn mean_albedo(&self) -> Vec3 {
        // Strands that no renderer draws do not colour the light.
        let drawable = self.strands.iter().filter(|strand| self.radius(strand).is_some());
        let (sum, points) = drawable.fold((Vec3::ZERO, 0.0), |(sum, points), strand| {
            let own = strand.points.len() as f32;
            (sum + self.albedo_of(&self.looks[usize::from(strand.look)]) * own, points + own)
        });
        if points > 0.0 { sum / points } else { Vec3::ZERO }
    }

    /// Radii of the thinnest and of the thickest drawable yarn, mm; infinity and 0 if there is
    /// none.
    #[must_use]
    pub fn radii(&self) -> (f32, f32) {
        radii(self.strand_looks())
    }

    /// How far a strand's section reaches from its axis at most, mm.
    fn reach(&self, strand: &SceneStrand) -> f32 {
        let look = &self.looks[usize::from(strand.look)];
        let spread = self.spread.as_ref().filter(|_| look.kind == YarnKind::Yarn);
        let ratio = spread.map_or(look.flatten, |spread| spread.widest());
        look.radius * ratio.max(ratio.recip()).sqrt()
    }

    /// How far the section of any yarn reaches from its axis, mm.
    pub(crate) fn widest_reach(&self) -> f32 {
        let drawable = self.strands.iter().filter(|strand| self.radius(strand).is_some());
        let reaches = drawable.map(|strand| self.reach(strand));
        reaches.fold(0.0, f32::max)
    }

    /// As [`Scene::radii`], without sewing thread. Where there is nothing else, it counts.
    #[must_use]
    pub(crate) fn cloth_radii(&self) -> (f32, f32) {
        cloth_radii(self.strand_looks())
    }

    /// As [`Scene::radii`], of strands that are no fibre or hair.
    #[must_use]
    #[cfg(feature = "gpu")]
    pub(crate) fn yarn_radii(&self) -> (f32, f32) {
        radii(self.strand_looks().filter(|look| look.kind != YarnKind::Fibre))
    }

    /// The look of each strand.
    fn strand_looks(&self) -> impl Iterator<Item = &YarnLook> + Clone {
        self.strands.iter().map(|strand| &self.looks[usize::from(strand.look)])
    }

    /// Distances between neighbouring drawable data points of strands.
    #[must_use]
    pub fn span_lengths(&self) -> SpanLengths {
        // Sums are taken in order, so that the result does not depend on the number of threads.
        let strands: Vec<SpanLengths> =
            self.strands.par_iter().map(|strand| self.strand_lengths(strand)).collect();
        strands.into_iter().fold(SpanLengths::default(), |sum, own| SpanLengths {
            sum: sum.sum + own.sum,
            count: sum.count + own.count,
            longest: sum.longest.max(own.longest),
        })
    }

    /// Distances between neighbouring drawable data points of one strand.
    fn strand_lengths(&self, strand: &SceneStrand) -> SpanLengths {
        let points = &self.positions[strand.points.start as usize..strand.points.end as usize];
        points
            .windows(2)
            .filter(|ends| ends.iter().all(|end| drawable(*end)))
            .map(|ends| f64::from(ends[0].distance(ends[1])))
            .fold(SpanLengths::default(), SpanLengths::with)
    }

    /// The radius of a strand if it is drawable: above 0 and below [`MAX_COORDINATE`].
    #[must_use]
    pub fn radius(&self, strand: &SceneStrand) -> Option<f32> {
        let radius = self.looks[usize::from(strand.look)].radius;
        is_drawable_radius(radius).then_some(radius)
    }

    /// Factor on a strand's radius at one of its control points.
    #[must_use]
    pub fn thickness(&self, strand: &SceneStrand, point: u32) -> f32 {
        match self.evenness {
            Evenness::Regular => 1.0,
            Evenness::Uneven if self.looks[usize::from(strand.look)].kind == YarnKind::Fibre => 1.0,
            Evenness::Uneven => {
                let along = strand.first + i64::from(point) - i64::from(strand.points.start);
                evenness::thickness(YarnId(strand.yarn), along)
            }
        }
    }

    /// Factor on the base colour of a strand.
    #[must_use]
    pub fn shade(&self, strand: &SceneStrand) -> f32 {
        match self.evenness {
            Evenness::Regular => 1.0,
            Evenness::Uneven => evenness::shade(YarnId(strand.yarn)),
        }
    }

    /// Bounding box of all yarns, including their radii, or [`Self::extent`]. `None` if nothing is
    /// visible.
    ///
    /// The curve between two data points may leave the box by a little, because Catmull-Rom curves
    /// overshoot.
    #[must_use]
    pub fn bounds(&self) -> Option<Bounds> {
        if self.extent.is_some() && !self.strands.is_empty() {
            return self.extent;
        }
        let mut bounds: Option<Bounds> = None;
        for strand in &self.strands {
            if self.radius(strand).is_none() {
                continue;
            }
            let radius = self.reach(strand);
            let points = &self.positions[strand.points.start as usize..strand.points.end as usize];
            for &point in points.iter().filter(|&&point| drawable(point)) {
                let ball = Bounds { min: point - radius, max: point + radius };
                bounds = Some(bounds.map_or(ball, |bounds| bounds.union(ball)));
            }
        }
        bounds
    }
}

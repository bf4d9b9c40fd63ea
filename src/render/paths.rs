//! Yarns as chains of short straight pieces, for whoever draws them.
//!
//! In: a scene and how finely to cut it. Out: [`YarnPaths`], structure of arrays, 30 bytes a point:
//! points on the centripetal Catmull-Rom curve, with the curve's own tangent at each and a
//! direction across it. Around a tube that is a rotation-minimising frame's (double reflection,
//! Wang et al. 2008), on a ribbon the fabric's normal. Coordinates are relative to the scene's
//! middle, which keeps `f32` good to a ten-thousandth of a millimetre on a garment. A strand is
//! broken where a point is not [`drawable`]; a lone point becomes a ball.

use std::ops::Range;

use glam::{DVec3, Vec3A, Vec4};

use super::{Camera, RenderOptions};
use crate::ids::index32;
use crate::scene::{Scene, SceneStrand, Shape, drawable};
use crate::unit::PackedUnit;
use crate::yarn::curve::{self, Span};
use crate::yarn::frame;

/// Largest distance between a curve and its chord, pixels.
const CHORD_ERROR: f64 = 0.2;
/// Most pieces between two data points; at 8, a half turn is a sixteen-sided polygon's.
const MAX_PIECES: u32 = 8;
/// Most by which a piece that stands for several spans is widened, so that it hides what they hid;
/// a sharper bend is kept.
const MAX_WIDENING: f64 = 1.5;
/// Farthest that several spans may lie from their piece on the average, pixels. At .2 loops grow
/// flat enough that a fabric of a million stitches is 2 % brighter, at .1 it is by less than 1 %.
const MAX_BULGE: f64 = 0.1;
/// Least sine of the angle between a yarn and the fabric's normal at which a ribbon's width is
/// across both.
const MIN_SINE: f32 = 1e-3;

/// How finely yarns are cut.
#[derive(Clone, Copy, Debug)]
pub(super) enum Subdivision<'a> {
    /// So that a chord leaves its curve by less than [`CHORD_ERROR`] pixels, where [`MAX_PIECES`]
    /// allows; with [`RenderOptions::lod`] by no pieces shorter than a pixel, where bends allow.
    Picture(&'a Camera, &'a RenderOptions),
    /// St pieces a stitch, evenly in its own parameter, as [`crate::yarn::tube`] cuts it.
    Stitch(u32),
}

/// Consecutive points of yarns.
#[derive(Debug, Default)]
pub(super) struct YarnPaths {
    /// What to add to a point to be in the world.
    pub(super) centre: DVec3,
    /// Points on the axis, and in w the radius of the piece that starts here: 0 at a strand's end,
    /// where none does.
    pub(super) points: Vec<Vec4>,
    /// Unit tangents.
    pub(super) tangents: Vec<PackedUnit>,
    /// Of a tube the unit vector across the yarn from which angles around it count, of a ribbon the
    /// fabric's normal.
    pub(super) across: Vec<PackedUnit>,
    /// Arc length, mm, from a start that differs from strand to strand.
    pub(super) along: Vec<f32>,
    /// The yarns' looks.
    pub(super) looks: Vec<u16>,
}

impl YarnPaths {
    /// The strands of numbers `range`, cut; `centre` is what coordinates are relative to.
    pub(super) fn new(
        scene: &Scene,
        range: Range<usize>,
        centre: DVec3,
        cut: Subdivision<'_>,
    ) -> Self {
        let mut paths = Self { centre, ..Self::default() };
        let mut buffer = PointRun::default();
        for (strand, number) in scene.strands[range.clone()].iter().zip(index32(range.start)..) {
            paths.push_strand(scene, strand, number, cut, &mut buffer);
        }
        paths
    }

    /// Appends other paths with the same centre.
    pub(super) fn append(&mut self, other: &Self) {
        self.points.extend_from_slice(&other.points);
        self.tangents.extend_from_slice(&other.tangents);
        self.across.extend_from_slice(&other.across);
        self.along.extend_from_slice(&other.along);
        self.looks.extend_from_slice(&other.looks);
    }

    fn push_strand(
        &mut self,
        scene: &Scene,
        strand: &SceneStrand,
        number: u32,
        cut: Subdivision<'_>,
        buffer: &mut PointRun,
    ) {
        let Some(radius) = scene.radius(strand) else { return };
        let mut along = phase(number);
        let mut start = strand.points.start;
        while start < strand.points.end {
            let good = |point: u32| drawable(scene.positions[point as usize]);
            let end =
                (start..strand.points.end).find(|&point| !good(point)).unwrap_or(strand.points.end);
            if start < end {
                buffer.fill(scene, strand, start..end, self.centre);
                along = self.push_run(
                    buffer,
                    PathStyle { radius, look: strand.look, shape: scene.shape },
                    along,
                    cut,
                );
            }
            start = end + 1;
        }
    }

    /// The length at the run's end.
    fn push_run(
        &mut self,
        run: &PointRun,
        style: PathStyle,
        along: f64,
        cut: Subdivision<'_>,
    ) -> f64 {
        let mut builder = PathBuilder {
            paths: self,
            run,
            style,
            cached: (usize::MAX, None),
            frame: TangentFrame::default(),
            along,
        };
        match cut {
            Subdivision::Picture(camera, options) => builder.subdivide_spans(camera, options),
            Subdivision::Stitch(st) => builder.subdivide_stitches(st),
        }
        let along = builder.along;
        if let Some(last) = self.points.last_mut() {
            last.w = 0.0;
        }
        along
    }
}

/// What is the same all along a yarn.
#[derive(Clone, Copy)]
struct PathStyle {
    radius: f32,
    look: u16,
    shape: Shape,
}

/// A run of drawable points, in double precision, relative to the middle. Its memory serves strand
/// after strand.
#[derive(Default)]
struct PointRun {
    points: Vec<DVec3>,
    /// The fabric's normals, for ribbons.
    normals: Vec<Vec3A>,
    /// Points at which stitches begin or end, both ends of the run among them.
    stitches: Vec<usize>,
}

impl PointRun {
    fn fill(&mut self, scene: &Scene, strand: &SceneStrand, range: Range<u32>, centre: DVec3) {
        let (start, end) = (range.start as usize, range.end as usize);
        self.points.clear();
        self.points
            .extend(scene.positions[start..end].iter().map(|point| point.as_dvec3() - centre));
        self.normals.clear();
        if scene.shape == Shape::Ribbon {
            self.normals.extend(
                scene.normals[start..end].iter().map(|normal| Vec3A::from(normal.unpack())),
            );
        }
        if let [only] = self.points[..] {
            self.points.push(only);
            self.normals.extend_from_within(..);
        }
        let last = self.points.len() - 1;
        let starts = &scene.stitches[strand.stitches.start as usize..strand.stitches.end as usize];
        self.stitches.clear();
        self.stitches.push(0);
        let within = starts
            .iter()
            .map(|&point| (point as usize).saturating_sub(start))
            .filter(|&point| 0 < point && point < last);
        self.stitches.extend(within);
        self.stitches.push(last);
    }

    /// From point `index` on as many spans as it takes to come a pixel far, fewer where they bend
    /// too much for one piece.
    fn merge_spans(&self, index: usize, pixel: f64) -> MergedSpans {
        let start = self.points[index];
        let (mut found, mut arc, mut moment) = (MergedSpans::default(), 0.0, DVec3::ZERO);
        for spans in 1..self.points.len() - index {
            let end = self.points[index + spans];
            let length = start.distance(end);
            if spans == 1 && length >= pixel {
                break;
            }
            let span = curve::span(&self.points, index + spans - 1);
            let span_length = span.length();
            arc += span_length;
            moment += span.mean() * span_length;
            let bulge = moment / arc.max(f64::MIN_POSITIVE) - start.midpoint(end);
            if spans > 1 && (arc > MAX_WIDENING * length || bulge.length() > MAX_BULGE * pixel) {
                break;
            }
            found = MergedSpans { spans, length, arc, bulge };
            if length >= pixel {
                break;
            }
        }
        found
    }
}

/// A straight piece in place of whole spans.
#[derive(Default)]
struct MergedSpans {
    /// None where the first span alone is long enough to be cut.
    spans: usize,
    length: f64,
    /// Length of the curve.
    arc: f64,
    /// From the chord to where the curve lies on the average.
    bulge: DVec3,
}

/// A run on its way into [`YarnPaths`].
struct PathBuilder<'a> {
    paths: &'a mut YarnPaths,
    run: &'a PointRun,
    style: PathStyle,
    /// The span that was last asked for.
    cached: (usize, Option<Span>),
    frame: TangentFrame,
    along: f64,
}

impl PathBuilder<'_> {
    /// As many pieces between two data points, or as few, as the picture shows.
    fn subdivide_spans(&mut self, camera: &Camera, options: &RenderOptions) {
        let eye = camera.eye() - self.paths.centre;
        let pixel = |point: DVec3| camera.pixel_size(point.distance(eye), options.height);
        let last = self.run.points.len() - 1;
        let mut index = 0;
        let mut bulge = DVec3::ZERO;
        while index < last {
            let far = if options.lod {
                self.run.merge_spans(index, pixel(self.run.points[index]))
            } else {
                MergedSpans::default()
            };
            if far.spans > 0 {
                self.push_merged(index, &far, bulge);
                index += far.spans;
                bulge = far.bulge;
                continue;
            }
            let count = pieces(&self.span(index), pixel);
            for piece in 0..count {
                self.push_point(index, f64::from(piece) / f64::from(count));
            }
            index += 1;
            bulge = DVec3::ZERO;
        }
        self.push_point(last - 1, 1.0);
    }

    /// One piece for all of a chord's spans: as long as they are in `along`, and as much wider as
    /// it is shorter than they are. Its start is moved so that it lies where they lie on the
    /// average, not inside their bend; `bulge` is that of the chord before.
    fn push_merged(&mut self, index: usize, chord: &MergedSpans, bulge: DVec3) {
        self.push_point(index, 0.0);
        if let Some(start) = self.paths.points.last_mut() {
            let moved = (bulge + chord.bulge).as_vec3() * 0.5;
            #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
            let widening =
                (chord.arc / chord.length.max(f64::MIN_POSITIVE)).clamp(1.0, MAX_WIDENING) as f32;
            *start = (start.truncate() + moved).extend(start.w * widening);
        }
        self.along += chord.arc - chord.length;
    }

    /// St pieces a stitch.
    fn subdivide_stitches(&mut self, st: u32) {
        let run = self.run;
        self.push_point(0, 0.0);
        for ends in run.stitches.windows(2) {
            let spans = f64::from(index32(ends[1] - ends[0]));
            for step in 1..=st {
                let parameter = spans * f64::from(step) / f64::from(st);
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "between 0 and the number of spans"
                )]
                let index = (ends[0] + parameter.floor() as usize).min(ends[1] - 1);
                self.push_point(index, parameter - f64::from(index32(index - ends[0])));
            }
        }
    }

    fn span(&mut self, index: usize) -> Span {
        match self.cached {
            (at, Some(span)) if at == index => span,
            _ => {
                let span = curve::span(&self.run.points, index);
                self.cached = (index, Some(span));
                span
            }
        }
    }

    fn push_point(&mut self, index: usize, t: f64) {
        let span = self.span(index);
        let position = span.at(t);
        self.along += self.frame.advance(position, span.tangent(t));
        let across = match self.style.shape {
            Shape::Tube => self.frame.across,
            Shape::Ribbon => {
                #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
                let share = t as f32;
                self.frame
                    .ribbon_normal(self.run.normals[index].lerp(self.run.normals[index + 1], share))
            }
        };
        self.paths.points.push(position.as_vec3().extend(self.style.radius));
        self.paths.tangents.push(PackedUnit::new(self.frame.tangent.into()));
        self.paths.across.push(PackedUnit::new(across.into()));
        #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
        self.paths.along.push(self.along as f32);
        self.paths.looks.push(self.style.look);
    }
}

/// Pieces that keep the chord error of `span` below [`CHORD_ERROR`], given the size of a pixel at a
/// point.
fn pieces(span: &Span, pixel: impl Fn(DVec3) -> f64) -> u32 {
    let (start, middle, end) = (span.tangent(0.0), span.tangent(0.5), span.tangent(1.0));
    // The second derivative is linear in t, so its largest value is at an end; a chord of 1/n
    // leaves the curve by |p''| / (8 n^2).
    let cubic = 2.0 * (start + end) - 4.0 * middle;
    let bend = (end - start - cubic).length().max((end - start + cubic).length());
    let wanted = (bend / (8.0 * CHORD_ERROR * pixel(span.at(0.5)).max(f64::MIN_POSITIVE))).sqrt();
    (1..MAX_PIECES).find(|&count| f64::from(count) >= wanted).unwrap_or(MAX_PIECES)
}

/// Where a strand's arc length starts, mm: spread out, so that neighbours don't show the same plies
/// side by side.
pub(super) fn phase(strand: u32) -> f64 {
    f64::from(super::ply::hash(strand) >> 20) * 0.37
}

/// A rotation-minimising frame on its way along a yarn.
#[derive(Default)]
struct TangentFrame {
    position: DVec3,
    tangent: Vec3A,
    across: Vec3A,
}

impl TangentFrame {
    /// Moves on to `position`, where the curve runs along `derivative`; the distance moved, 0 for
    /// the first point.
    fn advance(&mut self, position: DVec3, derivative: DVec3) -> f64 {
        let first = self.tangent == Vec3A::ZERO;
        let tangent =
            derivative.as_vec3a().normalize_or(if first { Vec3A::X } else { self.tangent });
        let chord = position - self.position;
        let (across, moved) = if first {
            (frame::across(Vec3A::Z, tangent), 0.0)
        } else {
            (frame::carry(self.across, chord.as_vec3a(), self.tangent, tangent), chord.length())
        };
        *self = Self { position, tangent, across };
        moved
    }

    /// The fabric's normal where it is `normal`, leant so that a ribbon across both it and the
    /// tangent keeps its last direction where the yarn runs along the normal.
    fn ribbon_normal(&mut self, normal: Vec3A) -> Vec3A {
        let width = self.tangent.cross(normal);
        if width.length_squared() >= MIN_SINE * MIN_SINE {
            self.across = frame::across(normal, self.tangent);
            return normal;
        }
        // Here `across` holds what `carry` made of the last normal.
        normal + self.across * (10.0 * MIN_SINE)
    }
}

//! Yarns as chains of short straight pieces (polylines), for all renderers.
//!
//! In: a scene and a level of subdivision. Out: [`YarnPaths`], a structure of arrays with 31
//! bytes a point, or 35 where yarns are flattened. Points lie on the centripetal Catmull-Rom
//! curve (Yuksel, Schaefer and Keyser 2011, 'Parameterization and applications of Catmull-Rom
//! curves'). Each has the curve's unit tangent and a direction across it. For tubes that
//! direction belongs to a rotation-minimising frame (double reflection: Wang, Jüttler, Zheng and
//! Liu 2008, 'Computation of rotation minimizing frames'). For ribbons it is the fabric's normal.
//!
//! Coordinates are relative to the scene's centre, so that `f32` resolves a ten-thousandth of a
//! millimetre on a garment. A strand is split at points that are not [`drawable`]. A single point
//! becomes a ball. Cost: linear in the number of points.

use std::ops::Range;

use glam::{DVec3, Vec4};

use super::{Camera, RenderOptions};
use crate::octahedral::PackedUnit;
use crate::oval::{PackedOval, Press};
use crate::point_run::{MAX_WIDENING, MergedSpans, PointRun};
use crate::scene::{Scene, SceneStrand, Shape, drawable};
use crate::tangent_frame::TangentFrame;
use warpknit_core::ids::index32;
use warpknit_core::number::narrow;
use warpknit_core::yarn::curve::{self, Span};

/// Tolerance of the distance between a curve and its chord, pixels. Higher values show corners in
/// loops. Lower ones add pieces that no pixel shows.
const CHORD_ERROR: f64 = 0.2;
/// Tolerance of the step of a section's half-width from a piece to the next, pixels.
const TAPER_ERROR: f64 = 1.0;
/// Limit of pieces between two data points. With 8, a half turn is drawn as half of a regular
/// polygon with 16 sides. It bounds memory when the eye is close.
const MAX_PIECES: u32 = 8;
/// Size of the pixels for which yarns are subdivided that only cast shadows, radii. Much larger ones
/// would flatten loops so far that the shadow of the nearest, a few radii wide, changes.
const SHADOW_RADII: f32 = 4.0;
/// The same in pixels of the picture at most: yarns many pixels wide cast shadows that are resolved.
const SHADOW_PIXELS: f64 = 2.0;

/// The shade of a yarn that is as light as its look says.
pub(super) const PLAIN_SHADE: u8 = 128;

/// Level of subdivision.
#[derive(Clone, Copy, Debug)]
pub(super) enum Subdivision<'a> {
    /// Adaptive: a chord leaves its curve by less than [`CHORD_ERROR`] pixels, as far as
    /// [`MAX_PIECES`] allows. With [`RenderOptions::lod`], spans shorter than a pixel are merged
    /// where their bend allows.
    Picture(&'a Camera, &'a RenderOptions),
    /// Uniform: St pieces a stitch, evenly in the stitch's parameter, as
    /// [`warpknit_core::yarn::tube`] subdivides it.
    #[cfg_attr(
        not(feature = "gpu"),
        expect(dead_code, reason = "the graphics card alone asks for it")
    )]
    Stitch(u32),
}

/// Consecutive points of yarns.
#[derive(Debug, Default)]
pub(super) struct YarnPaths {
    /// Offset from these coordinates to world coordinates.
    pub(super) centre: DVec3,
    /// Points on the axis. w is the radius of the piece that starts there, or its section's shorter
    /// half-axis: 0 at a strand's end, where no piece starts.
    pub(super) points: Vec<Vec4>,
    /// Unit tangents.
    pub(super) tangents: Vec<PackedUnit>,
    /// For tubes the unit vector across the yarn from which angles around it count, for ribbons the
    /// fabric's normal.
    pub(super) across: Vec<PackedUnit>,
    /// Sections of the pieces that start at points. Empty where all yarns are round.
    pub(super) ovals: Vec<PackedOval>,
    /// Arc length, mm, from an origin that differs from strand to strand.
    pub(super) along: Vec<f32>,
    /// Indices of the yarns' looks.
    pub(super) looks: Vec<u16>,
    /// Factors on the yarns' base colours, in units of 1 / [`PLAIN_SHADE`].
    pub(super) shades: Vec<u8>,
}

impl YarnPaths {
    /// Subdivides the strands `range`. Coordinates are relative to `centre`.
    pub(super) fn new(
        scene: &Scene,
        range: Range<usize>,
        centre: DVec3,
        subdivision: Subdivision<'_>,
    ) -> Self {
        let mut paths = Self { centre, ..Self::default() };
        let mut buffer = PointRun::default();
        for strand in &scene.strands[range] {
            paths.push_strand(scene, strand, subdivision, &mut buffer);
        }
        paths
    }

    /// Appends other paths with the same centre.
    pub(super) fn append(&mut self, other: &Self) {
        self.points.extend_from_slice(&other.points);
        self.tangents.extend_from_slice(&other.tangents);
        self.across.extend_from_slice(&other.across);
        self.ovals.extend_from_slice(&other.ovals);
        self.along.extend_from_slice(&other.along);
        self.looks.extend_from_slice(&other.looks);
        self.shades.extend_from_slice(&other.shades);
    }

    /// Appends one strand, split at points that are not drawable.
    fn push_strand(
        &mut self,
        scene: &Scene,
        strand: &SceneStrand,
        subdivision: Subdivision<'_>,
        buffer: &mut PointRun,
    ) {
        let Some(radius) = scene.radius(strand) else { return };
        let mut along = phase(strand.yarn);
        let mut start = strand.points.start;
        while start < strand.points.end {
            let end = (start..strand.points.end)
                .find(|&point| !drawable(scene.positions[point as usize]))
                .unwrap_or(strand.points.end);
            if start < end {
                buffer.fill(scene, strand, start..end, self.centre);
                let style = PathStyle {
                    radius,
                    look: strand.look,
                    shade: shade(scene, strand),
                    shape: scene.shape,
                    lead: (strand.points.start + strand.lead).saturating_sub(start) as usize,
                    coarsest: if strand.is_shadow { f64::from(SHADOW_RADII * radius) } else { 0.0 },
                };
                along = self.push_run(buffer, style, along, subdivision);
            }
            start = end + 1;
        }
    }

    /// Appends a run of drawable points whose arc length starts at `along`; returns the arc length
    /// at its end.
    fn push_run(
        &mut self,
        run: &PointRun,
        style: PathStyle,
        along: f64,
        subdivision: Subdivision<'_>,
    ) -> f64 {
        let mut builder = PathBuilder::new(self, run, style, along);
        match subdivision {
            Subdivision::Picture(camera, options) => builder.subdivide_spans(camera, options),
            Subdivision::Stitch(st) => builder.subdivide_stitches(st),
        }
        builder.reach(run.points.len() - 1);
        let along = builder.along;
        // A strand that ends within its lead has no points.
        if builder.drawn == 0 {
            return along;
        }
        // A radius of 0 marks the end: no piece starts there.
        if let Some(last) = self.points.last_mut() {
            last.w = 0.0;
        }
        along
    }
}

/// Properties that are constant along a yarn.
#[derive(Clone, Copy)]
struct PathStyle {
    radius: f32,
    look: u16,
    shade: u8,
    shape: Shape,
    /// How many of its first points are not drawn. They tell where plies lie in the others.
    lead: usize,
    /// Size of a pixel for which it is subdivided at least, mm.
    coarsest: f64,
}

/// State while a run is appended to [`YarnPaths`].
struct PathBuilder<'a> {
    paths: &'a mut YarnPaths,
    run: &'a PointRun,
    style: PathStyle,
    /// The span that was computed last, with its index. Consecutive points mostly share a span.
    cached: (usize, Option<Span>),
    /// A point of the run, the arc length up to it and the frame there. Both advance by spans and
    /// not by pieces, so that plies and textures lie where they do at any subdivision. The frame
    /// passes merged spans in one step: no pixel shows their plies.
    reached: usize,
    along: f64,
    frame: TangentFrame,
    /// Number of points that were appended.
    drawn: usize,
}

impl<'a> PathBuilder<'a> {
    /// At the start of a run whose arc length begins with `along`.
    fn new(paths: &'a mut YarnPaths, run: &'a PointRun, style: PathStyle, along: f64) -> Self {
        let (cached, frame) = ((usize::MAX, None), TangentFrame::default());
        let mut builder = Self { paths, run, style, cached, reached: 0, along, frame, drawn: 0 };
        let start = builder.span(0).tangent(0.0);
        builder.advance_frame(0, start);
        builder
    }

    /// Subdivides spans adaptively, and merges those that are shorter than a pixel.
    fn subdivide_spans(&mut self, camera: &Camera, options: &RenderOptions) {
        let eye = camera.eye() - self.paths.centre;
        let coarsest = self.style.coarsest;
        let pixel = |point: DVec3| {
            let pixel = camera.pixel_size(point.distance(eye), options.height);
            pixel.max(coarsest.min(SHADOW_PIXELS * pixel))
        };
        let last = self.run.points.len() - 1;
        let mut index = self.style.lead.min(last);
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
            let count = pieces(&self.span(index), pixel).max(self.tapers(index, pixel));
            for piece in 0..count {
                self.push_point(index, f64::from(piece) / f64::from(count));
            }
            index += 1;
            bulge = DVec3::ZERO;
        }
        self.push_point(last - 1, 1.0);
    }

    /// Number of pieces that keep the steps of a tapering section's width below [`TAPER_ERROR`],
    /// as far as [`MAX_PIECES`] allows, given the size of a pixel at a point. Each piece has one
    /// width.
    fn tapers(&mut self, index: usize, pixel: impl Fn(DVec3) -> f64) -> u32 {
        if self.run.presses.is_empty() {
            return 1;
        }
        let span = self.span(index);
        let widths = [0.0, 0.5, 1.0].map(|t| {
            let tangent = span.tangent(t).as_vec3().normalize_or_zero();
            self.press(index, narrow(t)).map_or(1.0, |press| press.oval(tangent).half_width())
        });
        let step = (widths[1] - widths[0]).abs() + (widths[2] - widths[1]).abs();
        let step = f64::from(self.style.radius * step) / pixel(self.run.points[index]);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
        let count = (step / TAPER_ERROR).ceil().clamp(1.0, f64::from(MAX_PIECES)) as u32;
        count
    }

    /// Appends one piece for merged spans. Its arc length is that of the spans. It is widened by
    /// the ratio of arc to chord, so that it covers the same area. Its start is moved so that on
    /// average it lies on the spans and not inside their bend; `bulge` is that of the piece before.
    fn push_merged(&mut self, index: usize, chord: &MergedSpans, bulge: DVec3) {
        self.push_point(index, 0.0);
        if let Some(start) = self.paths.points.last_mut().filter(|_| self.drawn > 0) {
            let moved = (bulge + chord.bulge).as_vec3() * 0.5;
            #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
            let widening =
                (chord.arc / chord.length.max(f64::MIN_POSITIVE)).clamp(1.0, MAX_WIDENING) as f32;
            // Both the position and the width of the piece change. Without the shift, loops shrink;
            // without the width, the cloth becomes brighter through its gaps.
            *start = (start.truncate() + moved).extend(start.w * widening);
        }
        self.reached += chord.spans;
        self.along += chord.arc;
        self.advance_frame(self.reached, chord.tangent);
    }

    /// Subdivides each stitch into `st` pieces.
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
                // The end of a stitch belongs to its last span.
                let index = (ends[0] + parameter.floor() as usize).min(ends[1] - 1);
                self.push_point(index, parameter - f64::from(index32(index - ends[0])));
            }
        }
    }

    /// The span after point `index`.
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

    /// Advances the arc length and the frame to point `index`.
    fn reach(&mut self, index: usize) {
        while self.reached < index {
            let span = self.span(self.reached);
            self.along += span.length();
            self.reached += 1;
            self.advance_frame(self.reached, span.tangent(1.0));
        }
    }

    /// Advances the frame to point `index`, where the curve has this derivative.
    fn advance_frame(&mut self, index: usize, derivative: DVec3) {
        self.frame.advance(self.run.points[index], derivative);
        if self.style.shape == Shape::Ribbon {
            self.frame.ribbon_normal(self.run.normals[index]);
        }
    }

    /// How the yarn is pressed at parameter `t` of the span after point `index`.
    fn press(&self, index: usize, t: f32) -> Option<Press> {
        let ends = self.run.presses.get(index..index + 2)?;
        Some(ends[0].lerp(ends[1], t))
    }

    /// Appends the point at parameter `t` of the span after point `index`. None is appended in the
    /// lead.
    fn push_point(&mut self, index: usize, t: f64) {
        if index < self.style.lead {
            return;
        }
        self.reach(index);
        let span = self.span(index);
        let position = span.at(t);
        // A last span that was merged has been passed already.
        let is_within = index == self.reached;
        let mut frame = self.frame;
        if is_within && t > 0.0 {
            frame.advance(position, span.tangent(t));
        }
        self.drawn += 1;
        #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
        let share = t as f32;
        let across = match self.style.shape {
            Shape::Tube => frame.across,
            Shape::Ribbon => frame
                .ribbon_normal(self.run.normals[index].lerp(self.run.normals[index + 1], share)),
        };
        let [start, end] = [self.run.thickness[index], self.run.thickness[index + 1]];
        let mut radius = self.style.radius * (start + (end - start) * share);
        if let Some(press) = self.press(index, share) {
            let oval = press.oval(frame.tangent.into());
            radius *= oval.height();
            self.paths.ovals.push(oval.pack());
        }
        self.paths.points.push(position.as_vec3().extend(radius));
        self.paths.tangents.push(PackedUnit::new(frame.tangent.into()));
        self.paths.across.push(PackedUnit::new(across.into()));
        let within = if is_within { span.length_to(t) } else { 0.0 };
        #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
        self.paths.along.push((self.along + within) as f32);
        self.paths.looks.push(self.style.look);
        self.paths.shades.push(self.style.shade);
    }
}

/// Factor on the base colour of a strand, in units of 1 / [`PLAIN_SHADE`].
fn shade(scene: &Scene, strand: &SceneStrand) -> u8 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    let shade = (scene.shade(strand) * f32::from(PLAIN_SHADE)).round() as u8;
    shade
}

/// Number of pieces that keep the chord error of `span` below [`CHORD_ERROR`], given the size of a
/// pixel at a point.
pub(super) fn pieces(span: &Span, pixel: impl Fn(DVec3) -> f64) -> u32 {
    let (start, middle, end) = (span.tangent(0.0), span.tangent(0.5), span.tangent(1.0));
    // The second derivative of a cubic is linear in t, so its norm is largest at an end. A chord of
    // 1/n of the parameter leaves the curve by at most |p''| / (8 n^2), the error bound of linear
    // interpolation.
    let cubic = 2.0 * (start + end) - 4.0 * middle;
    let bend = (end - start - cubic).length().max((end - start + cubic).length());
    let wanted = (bend / (8.0 * CHORD_ERROR * pixel(span.at(0.5)).max(f64::MIN_POSITIVE))).sqrt();
    (1..MAX_PIECES).find(|&count| f64::from(count) >= wanted).unwrap_or(MAX_PIECES)
}

/// Arc length at the start of a strand, mm. A hash spreads it, so that neighbouring yarns do not
/// show the same plies or texels side by side.
pub(super) fn phase(strand: u32) -> f64 {
    f64::from(super::ply::hash(strand) >> 20) * 0.37
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::View;
    use crate::scene::YarnLook;
    use glam::{Vec3, Vec4Swizzles};

    /// A strand that winds about in space.
    fn winding(shape: Shape) -> Scene {
        let mut scene = Scene { shape, ..Scene::default() };
        scene.looks.push(YarnLook::plain(Vec3::ONE, 0.5, 0.1));
        let at = |turn: f32| Vec3::new(turn.cos(), turn.sin() * (0.3 * turn).cos(), 0.1 * turn);
        scene.push_strand((0_u8..60).map(|point| at(0.5 * f32::from(point))), 0);
        let up = |point: u8| Vec3::new(0.3, (0.2 * f32::from(point)).sin(), 1.0).normalize();
        scene.normals = (0..60).map(|point| PackedUnit::new(up(point))).collect();
        scene
    }

    /// Its path in a picture of so many pixels across.
    fn path(scene: &Scene, size: u32) -> YarnPaths {
        let camera = Camera::view(View::Front, &scene.positions, 0.5, 1.0, 1.0);
        let options =
            RenderOptions { width: size, height: size, lod: false, ..RenderOptions::default() };
        YarnPaths::new(scene, 0..1, DVec3::ZERO, Subdivision::Picture(&camera, &options))
    }

    /// Length and frame at a point of a path.
    fn state(path: &YarnPaths, point: usize) -> (f32, [Vec3; 2]) {
        (path.along[point], [path.tangents[point].unpack(), path.across[point].unpack()])
    }

    #[test]
    fn plies_lie_where_they_do_however_spans_are_divided() {
        for shape in [Shape::Tube, Shape::Ribbon] {
            let scene = winding(shape);
            let [coarse, fine] = [20, 2000].map(|size| path(&scene, size));
            assert!(fine.points.len() > 3 * coarse.points.len());
            for position in &scene.positions {
                let [one, other] = [&coarse, &fine].map(|path| {
                    let is_here = |point: &Vec4| point.xyz().distance(*position) < 1e-6;
                    state(path, path.points.iter().position(is_here).unwrap())
                });
                assert_eq!(one, other);
            }
        }
    }

    #[test]
    fn what_is_drawn_behind_a_lead_is_as_in_the_whole() {
        for shape in [Shape::Tube, Shape::Ribbon] {
            let (whole, mut scene) = (path(&winding(shape), 500), winding(shape));
            scene.strands[0].lead = 20;
            let rest = path(&scene, 500);
            let left_out = whole.points.len() - rest.points.len();
            assert!(left_out > 20);
            assert_eq!(rest.points, whole.points[left_out..]);
            for point in 0..rest.points.len() {
                assert_eq!(state(&rest, point), state(&whole, left_out + point));
            }
        }
    }
}

//! Light of a piece of yarn in a cell of the picture.
//!
//! In: a fragment, that is a piece and the places of a cell where it is visible. Out: its mean
//! light. It is lit at up to three places across the yarn, around the mean of the visible places by
//! their standard deviation: Gauss's quadrature. The mean alone makes yarns that show their whole
//! width too bright, because light falls off toward both outlines.

use glam::{Vec2, Vec3};

use super::fit::LightFit;
use super::layers::LayerDepths;
use super::masks::{PLACES, Stroke, places};
use super::pieces::{SplatPiece, SplatPieces};
use super::screen::Screen;
use super::sun::ShadowMap;
use super::tiles::Fragment;
use crate::cpu::lit::{self, ShadingPoint, SkyLight, textured_surface};
use crate::cpu::sample::{SampleDimension, Sampler};
use crate::light::Rig;
use crate::maps::Maps;
use crate::ply;
use crate::scene::{Shape, YarnLook};
use crate::shade::Surface;
use crate::sheen::Sheen;

/// Places from which on a fragment is lit at two places. Fewer are hardly spread.
const SPREAD: u32 = 3;
/// Places from which on it is lit at three. Two places miss where the sun's light ends on a yarn
/// that shows its whole width, and make it 6 % too dark.
const WIDE: u32 = 8;
/// Nodes of Gauss-Legendre quadrature, in standard deviations, and their weights.
const GAUSS_2: [(f32, f32); 2] = [(-1.0, 0.5), (1.0, 0.5)];
const GAUSS_3: [(f32, f32); 3] =
    [(-1.341_641, 5.0 / 18.0), (0.0, 4.0 / 9.0), (1.341_641, 5.0 / 18.0)];
/// Largest distance of a lit place from the axis, radii. At the outline itself a surface is seen
/// edge-on.
const RIM: f32 = 0.99;
/// Share of the light between yarns that comes from any yarn and not from the one that it falls on.
/// With it the mean colour of tricot, locknit, satin and power net is within 1.4 of 255 of the traced
/// one. With a half, locknit and satin are 2.4 too red where they turn from masks to rays.
const OTHERS: f32 = 0.8;
/// Directions in the sun's disc that a penumbra is the mean of.
const SUNS: u32 = 8;

/// Everything that the light depends on besides a piece.
pub(super) struct Lights {
    rig: Rig,
    shadows: ShadowMap,
    /// Directions to points of the sun's disc, spread evenly.
    suns: [Vec3; SUNS as usize],
    /// Estimates that are fitted to the scene.
    fit: LightFit,
    /// Mean base colour of all yarns.
    albedo: Vec3,
    places: [Vec2; PLACES],
}

/// The visible places of a fragment.
struct PlaceSpread {
    /// Their mean in the picture, cells.
    mean: Vec2,
    /// Their standard deviation across the piece, cells.
    deviation: f32,
    count: u32,
}

/// A place on a yarn's surface.
struct SurfacePlace {
    /// From the yarn's axis, mm.
    offset: Vec3,
    /// Unit normal of the smooth yarn.
    outward: Vec3,
}

/// A yarn where a fragment is lit.
struct LitYarn<'a> {
    look: &'a YarnLook,
    maps: Option<&'a Maps>,
    /// Factor on its base colour.
    shade: f32,
    piece: SplatPiece,
    axis: Vec3,
    tangent: Vec3,
    toward_eye: Vec3,
    /// Unit vectors across the yarn, where its section is a circle: across the direction to the
    /// eye, and toward the eye.
    width: Vec3,
    front: Vec3,
    /// Arc length along the yarn, mm.
    along: f32,
    /// Size of a cell, mm.
    footprint: f32,
}

impl LitYarn<'_> {
    /// The place at `side` from -1 to 1 between the outlines.
    fn place(&self, side: f32) -> SurfacePlace {
        let (oval, half) = (self.piece.oval, self.piece.half_height());
        let round = self.width * side + self.front * (1.0 - side * side).sqrt();
        let outward = if oval.is_round() { round } else { oval.shrunk(round).normalize_or(round) };
        SurfacePlace { offset: oval.grown(round) * half, outward }
    }

    /// The surface at a place, and the fraction of the sky's light that its texture lets through.
    fn surface(&self, &SurfacePlace { offset, outward }: &SurfacePlace) -> (Surface, f32) {
        let (mut surface, occlusion) = match self.maps {
            Some(maps) => {
                let point = ShadingPoint {
                    position: self.axis + offset,
                    normal: outward,
                    tangent: self.tangent,
                    top: outward.cross(self.tangent),
                    around: 0.0,
                    along: self.along,
                };
                // The texture is averaged over the yarn's full height. That includes the hidden
                // half, whose mean differs little.
                textured_surface(maps, &point, [1.0, self.footprint / maps.length], Shape::Tube)
            }
            None => {
                let albedo = self.look.albedo * ply::mean_shade(self.look.plies);
                let (roughness, metallic) = (self.look.roughness, self.look.metallic);
                let sheen = Sheen::NONE;
                (Surface { normal: outward, albedo, roughness, metallic, sheen }, 1.0)
            }
        };
        surface.normal = ply::face_eye(surface.normal, self.toward_eye);
        surface.albedo *= self.shade;
        surface.sheen = lit::yarn_sheen(self.look, self.tangent);
        (surface, occlusion)
    }
}

impl Lights {
    pub(super) fn new(rig: Rig, shadows: ShadowMap, fit: LightFit, albedo: Vec3) -> Self {
        let (sampler, mut number) = (Sampler::new(0, 0, 0), 0..);
        let suns = [(); SUNS as usize].map(|()| {
            rig.sun_sample(sampler.pair(SampleDimension::Sun, number.next().unwrap_or(0), SUNS))
        });
        Self { rig, shadows, suns, fit, albedo, places: places() }
    }

    /// Mean light toward the eye of a fragment in the cell whose corner is `corner`.
    pub(super) fn of(
        &self,
        (pieces, screen, layers): (&SplatPieces<'_>, &Screen, &LayerDepths),
        corner: Vec2,
        fragment: &Fragment,
    ) -> Option<Vec3> {
        let (scene, strand) = (pieces.scene, pieces.strand_of(fragment.piece));
        let piece = pieces.piece(strand, fragment.piece)?;
        let stroke = screen.stroke_of(&piece)?;
        let spread = self.spread(&stroke, corner, fragment.mask);
        let share = stroke.share(spread.mean);
        let axis = piece.ends[0].lerp(piece.ends[1], share);
        // The direction of the straight piece, as it hides others and casts shadows. That of the curve
        // would light surfaces that this piece does not have: a quarter too dark on oblique tricot.
        let tangent = piece.tangent();
        let toward_eye = (screen.eye - axis).normalize();
        // A tangent frame for the visible half of the tube.
        let width = tangent.cross(toward_eye).normalize_or(screen.right);
        let front = width.cross(tangent);
        let half_width = piece.half_width(toward_eye);
        let look = &scene.looks[usize::from(scene.strands[strand].look)];
        let [round_width, round_front] = if piece.oval.is_round() {
            [width, front]
        } else {
            let front = piece.oval.shrunk(front).normalize_or(front);
            [tangent.cross(front), front]
        };
        let section = LitYarn {
            look,
            maps: scene.maps_of(look),
            shade: scene.shade(&scene.strands[strand]),
            piece,
            axis,
            tangent,
            toward_eye,
            width: round_width,
            front: round_front,
            along: pieces.along(strand, fragment.piece, share),
            footprint: screen.cell_at(axis),
        };
        let radius = screen.radius(half_width, screen.depth(axis));
        let side = screen.to_world(spread.mean - stroke.at(share)).dot(width) / radius;
        let aside = screen.to_world(stroke.across()).dot(width) * spread.deviation / radius;
        let open = |place: &SurfacePlace| {
            let depth = screen.depth(axis + place.offset);
            let level = layers.sky_level(spread.mean, piece.radius, depth);
            self.fit.open(level, place.outward.dot(toward_eye))
        };
        let nodes: &[(f32, f32)] = match spread.count {
            WIDE.. => &GAUSS_3,
            SPREAD.. => &GAUSS_2,
            _ => &[(0.0, 1.0)],
        };
        let sides = nodes.iter().map(|(offset, weight)| (side + aside * offset, *weight));
        Some(self.over(&section, sides, open))
    }

    /// Mean and deviation of the places of a mask.
    fn spread(&self, stroke: &Stroke, corner: Vec2, mask: u64) -> PlaceSpread {
        let across = stroke.across();
        let (mut sum, mut squares, mut left) = (Vec2::ZERO, 0.0, mask);
        while left != 0 {
            let place = self.places[left.trailing_zeros() as usize % PLACES];
            // Clears the lowest set bit.
            left &= left - 1;
            sum += place;
            squares += place.dot(across).powi(2);
        }
        let count = mask.count_ones();
        let mean = sum / count as f32;
        let variance = squares / count as f32 - mean.dot(across).powi(2);
        PlaceSpread { mean: corner + mean, deviation: variance.max(0.0).sqrt(), count }
    }

    /// Mean light of a section over some places across it, each with its weight. `open` is the fraction of the sky that
    /// other yarns leave visible from a place of its surface.
    fn over(
        &self,
        section: &LitYarn<'_>,
        sides: impl Iterator<Item = (f32, f32)>,
        open: impl Fn(&SurfacePlace) -> f32,
    ) -> Vec3 {
        let mut light = Vec3::ZERO;
        let mut sheen = Vec3::ZERO;
        for (index, (side, weight)) in sides.enumerate() {
            let place = section.place(side.clamp(-RIM, RIM));
            let (surface, occlusion) = section.surface(&place);
            let sky = self.sky_light(&surface, open(&place));
            light += weight
                * (self.base_sunlight(section, &surface, &place)
                    + sky.reflected(&self.rig, &surface, section.toward_eye) * occlusion);
            if index == 0 {
                sheen = self.sheen_sunlight(section, &surface);
            }
        }
        light + sheen
    }

    /// The sun's light reflected toward the eye from a place, without the sheen.
    fn base_sunlight(
        &self,
        section: &LitYarn<'_>,
        surface: &Surface,
        place: &SurfacePlace,
    ) -> Vec3 {
        let toward = self.rig.toward_sun;
        let cosine = surface.normal.dot(toward);
        if cosine <= 0.0 || place.outward.dot(toward) <= 0.0 {
            return Vec3::ZERO;
        }
        let (at, radius) = (section.axis + place.offset, section.piece.radius);
        let lit = self.fit.sunshine() * self.shadows.lit_share(at, radius, &self.suns);
        if lit <= 0.0 {
            return Vec3::ZERO;
        }
        surface.base_brdf(toward, section.toward_eye) * self.rig.sun() * (cosine * lit)
    }

    /// The sun's light reflected by the fibres' sheen, as the mean over the visible width. Its
    /// highlight is narrower than two places across the yarn can tell.
    fn sheen_sunlight(&self, section: &LitYarn<'_>, surface: &Surface) -> Vec3 {
        let (sheen, toward, eye) = (&surface.sheen, self.rig.toward_sun, section.toward_eye);
        if sheen.share <= 0.0 {
            return Vec3::ZERO;
        }
        // The shadow of the brightest line stands for that of the whole highlight.
        let SplatPiece { oval, radius, .. } = section.piece;
        let facing = oval.place_facing(sheen.highlight_normal(toward, eye));
        let brightest = section.axis + facing * section.piece.half_height();
        let lit = self.fit.sunshine() * self.shadows.lit_share(brightest, radius, &self.suns);
        surface.sheen_color() * self.rig.sun() * (sheen.mean_over_width(toward, eye) * lit)
    }

    /// The sky's light at a point where yarns leave the fraction `open` of the sky visible.
    fn sky_light(&self, surface: &Surface, open: f32) -> SkyLight {
        // The sky is linear in the direction's height. So its cosine-weighted mean over the
        // hemisphere is its value two thirds of the way from the horizontal to the normal.
        let above = self.rig.sky(surface.normal * (2.0 / 3.0)) * self.fit.brightness();
        let gaps = self.rig.gap_light(open, surface.normal.dot(self.rig.toward_sun));
        let gaps = gaps * surface.albedo.lerp(self.albedo, OTHERS) * self.fit.gaps();
        SkyLight { light: above * open + gaps * (1.0 - open), open }
    }
}

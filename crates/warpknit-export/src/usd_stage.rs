//! What a stage of yarns says besides its points, the same for `.usda` and `.usdc`: units, names,
//! and for simulation the yarns' physics.
//!
//! In: how curves are written, and a bar's [`StrandStyle`]. Out: names and numbers.
//!
//! A stage of linear curves is one for simulation: metres and kilograms, and the schemas of the
//! curve deformables that Newton reads (`newton.ModelBuilder.add_usd`, 1.8). A yarn's stretch
//! stiffness is that of its fibres in its section. Its fibres slide past each other, so it bends as
//! they bend one by one: `E n π r⁴/4`, with `n π r²` the share of the section that is fibre.

use glam::{DVec3, Vec3};

use super::StrandStyle;
use warpknit_core::drape::Block;
use warpknit_core::drape::strands::Strand;
use warpknit_core::number::narrow;
use warpknit_core::yarn::curve::{self, Span};
use warpknit_core::yarn::fibres::FIBRE_RADIUS;

/// The curves of a `.usda` or `.usdc`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum UsdCurves {
    /// Cubic Bézier curves that are the yarns' own, mm: for pictures.
    #[default]
    Bezier,
    /// Straight lines between data points, metres, with the yarns' physics: for simulation.
    Linear,
}

/// An array beside the points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Array {
    Counts,
    Yarns,
    Courses,
    Wales,
    Lengths,
    Rest,
}

impl Array {
    /// Its type, its name, and its interpolation: a value a curve is `uniform`, one a data point
    /// `varying`.
    pub(super) fn declaration(self) -> (&'static str, &'static str, Option<&'static str>) {
        match self {
            Self::Counts => ("int[]", "curveVertexCounts", None),
            Self::Yarns => ("int[]", "primvars:yarn", Some("uniform")),
            Self::Courses => ("int[]", "primvars:course", Some("varying")),
            Self::Wales => ("int[]", "primvars:wale", Some("varying")),
            Self::Lengths => ("texCoord2f[]", "primvars:st", Some("varying")),
            Self::Rest => ("point3f[]", "physics:restShapePoints", None),
        }
    }
}

/// The bounding box of no points.
pub(super) const EMPTY: [Vec3; 2] = [Vec3::INFINITY, Vec3::NEG_INFINITY];
/// Of fibres, as far as their length goes: they hardly change their volume.
const POISSON: f64 = 0.3;
/// Metres in a mm.
const METRES: f64 = 1e-3;

/// The schemas of a material of yarns.
pub(super) const MATERIAL_SCHEMAS: [&str; 1] = ["PhysicsCurvesDeformableMaterialAPI"];

impl UsdCurves {
    /// Metres in a unit of the stage.
    pub(super) fn metres_per_unit(self) -> f64 {
        match self {
            Self::Bezier => METRES,
            Self::Linear => 1.0,
        }
    }

    /// Units of the stage in a mm.
    pub(super) fn scale(self) -> f64 {
        METRES / self.metres_per_unit()
    }

    /// The schemas of its curves' prims.
    pub(super) fn schemas(self) -> Vec<&'static str> {
        let mut schemas = vec!["MaterialBindingAPI"];
        if self == Self::Linear {
            schemas.extend(["PhysicsCurvesDeformableSimAPI", "PhysicsCollisionAPI"]);
        }
        schemas
    }

    /// Points of the curve of a strand of so many data points.
    pub(super) fn count(self, data_points: u32) -> u32 {
        match self {
            // A cubic span adds three control points to the first one.
            Self::Bezier => 3 * data_points - 2,
            Self::Linear => data_points,
        }
    }
}

/// The attributes of a yarn's physics, in SI units.
pub(super) fn physics(style: &StrandStyle) -> [(&'static str, f32); 5] {
    let radius = style.radius * METRES;
    let section = std::f64::consts::PI * radius * radius;
    let density = style.tex * 1e-6 / section;
    // Pa of the yarn, air between its fibres included.
    let young = style.modulus * 1e9 * style.packing;
    let fibre = (FIBRE_RADIUS * METRES).min(radius);
    let bend = young * section * fibre * fibre / 4.0;
    [
        ("physics:density", density),
        ("physics:youngsModulus", young),
        ("physics:poissonsRatio", POISSON),
        ("physics:curvesBendStiffness", bend),
        ("physics:curvesTwistStiffness", bend / (1.0 + POISSON)),
    ]
    .map(|(name, value)| (name, narrow(value)))
}

/// Consecutive blocks that belong to one prim, without those that have no strand on the panel.
pub(super) fn blocks_by_prim(blocks: &[Block]) -> impl Iterator<Item = &[Block]> {
    let by_prim = blocks.chunk_by(|a, b| (a.panel, a.bar) == (b.panel, b.bar));
    by_prim.filter(|blocks| blocks.iter().any(|block| !block.strands.strands.is_empty()))
}

/// Course and wale of a point. A cut end has those of the data point beside it.
pub(super) fn course_and_wale(block: &Block, point: usize) -> [i32; 2] {
    let tag = block.tag_near(point);
    [tag.course, tag.wale]
}

/// Calls `take` with each point of a strand's curve, in the stage's units.
pub(super) fn each_point(
    block: &Block,
    strand: &Strand,
    curves: UsdCurves,
    mut take: impl FnMut(Vec3),
) {
    each_span(block, strand, curves, &mut take, |_| {});
}

/// The same, and calls `reach` at each data point of a Bézier curve with the span that begins
/// there.
pub(super) fn each_span(
    block: &Block,
    strand: &Strand,
    curves: UsdCurves,
    take: &mut impl FnMut(Vec3),
    mut reach: impl FnMut(Option<&Span>),
) {
    let points = &block.draped.positions[strand.range()];
    if curves == UsdCurves::Linear {
        points.iter().for_each(|point| take(in_metres(*point + block.origin)));
        return;
    }
    take((points[0] + block.origin).as_vec3());
    for span in curve::spans(points) {
        reach(Some(&span));
        for control in &span.bezier()[1..] {
            take((*control + block.origin).as_vec3());
        }
    }
    reach(None);
}

/// The points of a strand in the flat cloth, m: its rest shape. There it has its run-in.
pub(super) fn rest_points<'b>(
    block: &'b Block,
    strand: &Strand,
) -> impl Iterator<Item = Vec3> + use<'b> {
    block.strands.flat[strand.range()].iter().map(|point| in_metres(*point))
}

/// Whether a block's yarns are at rest: whether they lie as in the flat cloth.
pub(super) fn is_at_rest(block: &Block) -> bool {
    let pairs = block.draped.positions.iter().zip(&block.strands.flat);
    // A hundredth of a micrometre, as metres in 32 bits have it.
    pairs.into_iter().all(|(draped, flat)| (*draped + block.origin).distance(*flat) < 1e-5)
}

fn in_metres(point: DVec3) -> Vec3 {
    (point * METRES).as_vec3()
}

/// The bounding box of the curves of a block, without their thickness. A Bézier curve lies in the
/// convex hull of its control points, so the box holds the curves too.
pub(super) fn bounds(block: &Block, curves: UsdCurves) -> [Vec3; 2] {
    let mut extent = EMPTY;
    for strand in &block.strands.strands {
        each_point(block, strand, curves, |point| extent = union(extent, [point; 2]));
    }
    extent
}

/// The bounding box of two.
pub(super) fn union(a: [Vec3; 2], b: [Vec3; 2]) -> [Vec3; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// The bounding box of strands around centre lines.
pub(super) fn widened([low, high]: [Vec3; 2], style: &StrandStyle, curves: UsdCurves) -> [f32; 6] {
    let radius = narrow(style.radius * curves.scale());
    let ([a, b, c], [d, e, f]) = ((low - radius).to_array(), (high + radius).to_array());
    [a, b, c, d, e, f]
}

/// A strand's diameter, in the stage's units.
pub(super) fn width(style: &StrandStyle, curves: UsdCurves) -> f32 {
    narrow(2.0 * style.radius * curves.scale())
}

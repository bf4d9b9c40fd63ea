//! Blocks of fibres in place of blocks of yarns, for files.
//!
//! In: a fabric's yarns, as [`Block`]s. Out: the same with one strand for each fibre and each hair.
//! Cost: linear in the fibres' points.
//!
//! Not promised: data points of fibres. They have none, and their stitches are those of their
//! yarns.

use std::iter::repeat;

use glam::Vec3;

use super::Block;
use super::strands::Strand;
use crate::fabric::Fabric;
use crate::ids::{YarnId, index32};
use crate::yarn::fibres::{Axis, Bundle, MIDDLING_SLOPE, for_each_fibre};
use crate::yarn::hairs::{Hairs, for_each_hair};
use crate::yarn::tube::Section;

/// The fibres of each of a fabric's yarns. `radius` is that of the thickest yarn, mm. `fibre` is
/// the radius of a fibre, mm, of the cloth before enlargement.
#[must_use]
pub fn bundles(fabric: &Fabric, radius: f64, fibre: f64) -> Vec<Bundle> {
    let mut bundles = Vec::with_capacity(fabric.yarn_systems());
    for (yarn, thickness) in fabric.yarns().zip(fabric.thickness()) {
        let slope = yarn.twist_slope().unwrap_or_else(|| MIDDLING_SLOPE.into());
        let (radius, times) = (radius * thickness, fabric.enlargement);
        let hairs = yarn.hairiness.filter(|hairiness| *hairiness > 0.0);
        let bundle = Bundle::filling(radius, yarn.packing, fibre * times, slope);
        let hairs = hairs.map(|hairiness| Hairs::of(hairiness, &bundle, times));
        bundles.push(Bundle { hairs, ..bundle });
    }
    bundles
}

/// A block of fibres in place of a block of yarns, with tubes if a `surface` is given. A yarn's
/// fibres have its number. Their positions on the flat panel are unknown.
#[must_use]
pub fn block(yarns: &Block, bundle: &Bundle, surface: Option<&Section>) -> Block {
    let mut fibres = Block {
        panel: yarns.panel,
        bar: yarns.bar,
        origin: yarns.origin,
        knitted: yarns.knitted.clone(),
        ..Block::default()
    };
    for strand in &yarns.strands.strands {
        let range = strand.range();
        let controls = &yarns.draped.positions[range.clone()];
        let axis = Axis::through(controls, bundle.points_per_mm());
        let spans = 0..controls.len() - 1;
        // The yarn's point that each sample follows: fibres take their normals and tags from it.
        let followed: Vec<usize> =
            axis.spans_of(spans.clone()).map(|span| range.start + span).collect();
        // The seed is that of the strand, so that its fibres don't depend on how yarns are divided
        // into blocks.
        let seed = u64::from(strand.yarn.0) << 32 | u64::from(strand.points.start);
        for_each_fibre(bundle, &axis, spans.clone(), seed, &mut |points| {
            add_fibre(&mut fibres, yarns, strand.yarn, points, followed.iter().copied());
        });
        let Some(hairs) = &bundle.hairs else { continue };
        for (span, number) in spans.zip(yarns.first_along(strand)..) {
            let at = repeat(range.start + span);
            for_each_hair(hairs, controls, span, (strand.yarn.0, number), 1.0, &mut |points| {
                add_fibre(&mut fibres, yarns, strand.yarn, points, at.clone());
            });
        }
    }
    if let Some(section) = surface {
        fibres.add_tubes(&Section { radius: bundle.fibre, ..*section }, 1.0, None);
    }
    fibres
}

/// Appends a fibre of a yarn. `followed` has the point of the yarn that each of its points follows.
fn add_fibre(
    fibres: &mut Block,
    yarns: &Block,
    yarn: YarnId,
    points: &[Vec3],
    followed: impl Iterator<Item = usize>,
) {
    let (first, first_piece) =
        (index32(fibres.draped.positions.len()), index32(fibres.strands.pieces.len()));
    for (point, at) in points.iter().zip(followed) {
        fibres.draped.positions.push(point.as_dvec3());
        fibres.draped.normals.push(yarns.draped.normals[at]);
        // Beside a cut end of the yarn there may be many points of a fibre, and each needs a data point.
        fibres.strands.sources.push(yarns.strands.source_near(at));
    }
    let end = index32(fibres.draped.positions.len());
    // Each span of a fibre is a piece of its own: a tube gets St segments a piece.
    fibres.strands.pieces.extend(first..end - 1);
    let pieces = first_piece..index32(fibres.strands.pieces.len());
    fibres.strands.strands.push(Strand { yarn, points: first..end, pieces });
}

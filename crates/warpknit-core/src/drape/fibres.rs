//! Blocks of fibres in place of blocks of yarns, for files.
//!
//! In: a fabric's yarns as [`Block`]s hold them. Out: the same with a strand for each fibre. Not promised: data points of fibres; they have none, and
//! their stitches are those of their yarns.

use super::Block;
use super::strands::Strand;
use crate::fabric::Fabric;
use crate::ids::index32;
use crate::yarn::fibres::{Axis, Bundle, MIDDLING_SLOPE, spin};
use crate::yarn::tube::Section;

/// The fibres of each of a fabric's yarns, the thickest of which has that radius; fibres are
/// `fibre` mm thick, were the cloth not enlarged.
#[must_use]
pub fn bundles(fabric: &Fabric, radius: f64, fibre: f64) -> Vec<Bundle> {
    let bundle = |(bar, thickness): (&crate::fabric::Bar, f64)| {
        let slope = bar.yarn.twist_slope().unwrap_or_else(|| MIDDLING_SLOPE.into());
        Bundle::filling(radius * thickness, bar.yarn.packing, fibre * fabric.enlargement, slope)
    };
    fabric.bars.iter().zip(fabric.thickness()).map(bundle).collect()
}

/// A block of fibres in place of a block of yarns, with surfaces if they are asked for; a yarn's
/// fibres have its number. Where they lie on the flat panel isn't known.
#[must_use]
pub fn block(yarns: &Block, bundle: &Bundle, surface: Option<&Section>) -> Block {
    let mut spun = Block {
        panel: yarns.panel,
        bar: yarns.bar,
        knitted: yarns.knitted.clone(),
        ..Block::default()
    };
    for strand in &yarns.strands.strands {
        let range = strand.range();
        let controls = &yarns.draped.positions[range.clone()];
        let axis = Axis::through(controls, bundle.points_per_mm());
        let spans = 0..controls.len() - 1;
        let of_points: Vec<usize> =
            axis.spans_of(spans.clone()).map(|span| range.start + span).collect();
        let seed = u64::from(strand.yarn.0) << 32 | u64::from(strand.points.start);
        spin(bundle, &axis, spans, seed, &mut |points| {
            let (first, first_piece) =
                (index32(spun.draped.positions.len()), index32(spun.strands.pieces.len()));
            spun.draped.positions.extend(points.iter().map(|point| point.as_dvec3()));
            spun.draped.normals.extend(of_points.iter().map(|&at| yarns.draped.normals[at]));
            spun.strands.sources.extend(of_points.iter().map(|&at| yarns.strands.sources[at]));
            let end = index32(spun.draped.positions.len());
            spun.strands.pieces.extend(first..end - 1);
            let pieces = first_piece..index32(spun.strands.pieces.len());
            spun.strands.strands.push(Strand { yarn: strand.yarn, points: first..end, pieces });
        });
    }
    if let Some(section) = surface {
        spun.add_tubes(&Section { radius: bundle.fibre, ..*section }, 1.0);
    }
    spun
}

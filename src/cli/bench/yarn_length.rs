//! How much yarn each stitch gains or loses on the body, by mapping.
//!
//! In: the shipped garments, or the user's own. Out: a table of the shares of stitches whose yarn
//! would be stretched or pressed by more than some per cent, and a plot for each garment. Yarn of
//! real cloth gives under 2 %, so a mapping that is true to it has hardly a stitch beyond that.
//!
//! Method: the arc length of a stitch's curve on the body over that on the flat fabric. A stitch at
//! an edge, of which a part is cut off, does not count.

use std::convert::Infallible;

use anyhow::Result;
use warpknit::drape::strands::{CUT, Strand};
use warpknit::drape::{self, Block, Cloth, DrapeOptions};
use warpknit::fabric::Fabric;
use warpknit::garment::Garment;
use warpknit::map::Mapping;
use warpknit::yarn::curve;

use super::super::args::{Bench, DEFAULT_FABRIC};
use super::super::choice::named_fabric;
use super::garments::{Garments, Shipped, fitted};
use super::measure::FLAT_YARN;
use super::plot::{Plot, Series};
use super::table::{Table, TableCell};

/// The garments, with the stitches that each is knitted with. Both are pulled over a body.
const LINES: [(Shipped, f64); 2] = [(Shipped::Tube, 8480.0), (Shipped::Skirt, 26_180.0)];
/// The mappings that are compared.
const MAPPINGS: [(&str, Mapping); 2] = [("smooth", Mapping::Smooth), ("relaxed", Mapping::Relaxed)];
/// Changes of length in the table, per cent.
const LIMITS: [f64; 3] = [1.0, 2.0, 5.0];
/// Changes of length in the plot, per cent: so many between the first and the last, each larger than
/// the one before by the same factor.
const PLOTTED: u32 = 32;
const FIRST: f64 = 0.1;
const LAST: f64 = 20.0;

/// Measures the table, on the user's garment if there is one.
pub(super) fn yarn_length(
    arguments: &Bench,
    garments: &Garments,
    progress: &mut dyn FnMut(f64),
) -> Result<Table> {
    let fabric = named_fabric(arguments.fabric.as_deref().unwrap_or(DEFAULT_FABRIC))?;
    let mut table = Table::new(
        "yarn-length",
        "Yarn on the body: shares of stitches whose yarn is longer or shorter than flat",
        &["Lengths are those of whole stitches, on the body over flat."],
        [("cloth", "cloth"), ("fabric", "fabric"), ("stitches", "stitches"), ("map", "mapping")],
    );
    table.add_columns([
        ("over_1", "by over\n1 %"),
        ("over_2", "by over\n2 %"),
        ("over_5", "by over\n5 %"),
    ]);
    for (at, (shipped, stitches)) in LINES.into_iter().enumerate() {
        progress(at as f64 / LINES.len() as f64);
        let (name, garment) = garments.get(shipped)?;
        let (fabric, _) = fitted(&fabric, &garment, stitches)?;
        push(&mut table, &name, &garment, &fabric)?;
    }
    Ok(table)
}

/// Adds the rows and the plot of a garment.
fn push(table: &mut Table, name: &str, garment: &Garment, fabric: &Fabric) -> Result<()> {
    let mut plot = Plot::new(
        &format!("Yarn length on {name}"),
        "longer or shorter by more than, %",
        "stitches, %",
        MAPPINGS.map(|(mapping, _)| Series::ours(mapping)),
    );
    let cloth = Cloth::cover(garment, fabric)?;
    let changes = MAPPINGS.map(|(_, mapping)| changes(&cloth, mapping));
    for ((mapping, _), changes) in MAPPINGS.into_iter().zip(&changes) {
        let labels = [
            TableCell::text(name),
            TableCell::text(&fabric.name),
            TableCell::Count(changes.len()),
            TableCell::text(mapping),
        ];
        let shares = LIMITS.map(|limit| TableCell::Number(share_over(changes, limit), 2));
        table.push(labels.into_iter().chain(shares));
    }
    for step in 0..=PLOTTED {
        let limit = FIRST * (LAST / FIRST).powf(f64::from(step) / f64::from(PLOTTED));
        plot.push(limit, changes.each_ref().map(|changes| share_over(changes, limit)));
    }
    table.plots.push(plot);
    Ok(())
}

/// The share of values over a limit, per cent.
fn share_over(changes: &[f64], limit: f64) -> f64 {
    let over = changes.iter().filter(|change| **change > limit).count();
    100.0 * over as f64 / changes.len().max(1) as f64
}

/// By how much each whole stitch is longer or shorter than flat, per cent.
fn changes(cloth: &Cloth<'_>, mapping: Mapping) -> Vec<f64> {
    let mut changes = Vec::new();
    let options = DrapeOptions { mapping, ..FLAT_YARN };
    let deliver = &mut |blocks: &[Block]| {
        for block in blocks {
            for strand in &block.strands.strands {
                add_strand(block, strand, &mut changes);
            }
        }
        Ok::<_, Infallible>(())
    };
    let Ok(_) = drape::run(cloth, &options, &mut |_, _| {}, deliver);
    changes
}

/// Adds the changes of a strand's whole stitches.
fn add_strand(block: &Block, strand: &Strand, changes: &mut Vec<f64>) {
    let sources = &block.strands.sources[strand.range()];
    let [flat, draped] =
        [&block.strands.flat, &block.draped.positions].map(|all| &all[strand.range()]);
    let pieces: Vec<_> = block.strands.pieces_of(strand).collect();
    // The first and the last piece may be parts of stitches.
    for piece in pieces.iter().take(pieces.len().saturating_sub(1)).skip(1) {
        if sources[piece.clone()].contains(&CUT) {
            continue;
        }
        let [flat, draped] = [flat, draped].map(|points| {
            let spans = piece.start..piece.end - 1;
            spans.map(|span| curve::span(points, span).precise_length()).sum::<f64>()
        });
        changes.push(100.0 * (draped / flat - 1.0).abs());
    }
}

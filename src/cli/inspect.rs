//! `warpknit inspect`: what meshes hold and whether they pair, and what a fabric's lapping is.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::Result;
use glam::DVec3;
use warpknit::export::Output;
use warpknit::garment::stretch::stretch;
use warpknit::garment::{Garment, read};

use super::args::{DEFAULT_FABRIC, Inspect};
use super::choice::named_fabric;
use super::sheet::{diagrams, sheet};
use super::{print, tell};

/// Prints what was asked for: a fabric, then one section a garment. Pictures appear under their names only when nothing failed.
pub(crate) fn inspect(arguments: &Inspect) -> Result<()> {
    let mut pictures = Vec::new();
    let Inspect { fabric: asked, chains, .. } = arguments;
    if asked.is_some() || !chains.lapping.is_empty() {
        let asked = asked.as_deref().unwrap_or(DEFAULT_FABRIC);
        let fabric = chains.on(named_fabric(asked)?)?;
        let name = chains.label(asked, &fabric);
        let (drawn, notes) = diagrams(&fabric, &arguments.outputs)?;
        notes.iter().for_each(|note| tell(false, &format!("note: {name}: {note}")));
        print(&sheet(&fabric)?)?;
        pictures = drawn;
    }
    inspect_meshes(arguments)?;
    Ok(pictures.into_iter().try_for_each(Output::publish)?)
}

/// One section a garment: a lone file with its vt, or the first file as the flat mesh of each other one.
fn inspect_meshes(arguments: &Inspect) -> Result<()> {
    let options = arguments.reading.options();
    let Some((first, others)) = arguments.meshes.split_first() else { return Ok(()) };
    if others.is_empty() {
        return print(&section(&first.display().to_string(), &read(first, None, &options)?)?);
    }
    for draped in others {
        print(&section(&pair(first, draped), &read(first, Some(draped), &options)?)?)?;
    }
    Ok(())
}

fn pair(flat: &Path, draped: &Path) -> String {
    format!("{} + {}", flat.display(), draped.display())
}

fn section(name: &str, garment: &Garment) -> Result<String, std::fmt::Error> {
    let facts = &garment.facts;
    let mut text = String::new();
    writeln!(text, "{name}")?;
    let guessed = if facts.unit_guessed { " (guessed)" } else { "" };
    writeln!(text, "  triangles {}, unit {}{guessed}, flat unit {:.6} mm", facts.triangles, facts.unit, facts.uv_scale_mm)?;
    writeln!(text, "  left out: {} flipped, {} degenerate, {} without vt", facts.flipped, facts.degenerate, facts.untextured)?;
    let points = || garment.panels.iter().flat_map(|panel| panel.draped.iter().copied());
    let (low, high) = (points().fold(DVec3::INFINITY, DVec3::min), points().fold(DVec3::NEG_INFINITY, DVec3::max));
    let vector = |v: DVec3| format!("{:.1},{:.1},{:.1}", v.x, v.y, v.z);
    writeln!(text, "  draped from {} to {} mm, {} mm large", vector(low), vector(high), vector(high - low))?;
    let (warp, weft) = stretch(garment);
    let percentiles = |p: [f64; 3]| format!("{:.3} {:.3} {:.3}", p[0], p[1], p[2]);
    writeln!(text, "  stretch 5/50/95 %: warp {}, weft {}", percentiles(warp), percentiles(weft))?;
    writeln!(text, "  panel  triangles   width mm  height mm   area cm²  mirrored  flipped  non-manifold edges")?;
    for (number, panel) in garment.panels.iter().enumerate() {
        let size = panel.size();
        writeln!(
            text,
            "  {number:5}  {:9}  {:9.1}  {:9.1}  {:9.1}  {:>8}  {:7}  {:18}",
            panel.triangles.len(),
            size.x,
            size.y,
            panel.area() / 100.0,
            if panel.mirrored { "yes" } else { "no" },
            panel.flipped.len(),
            panel.non_manifold_edges()
        )?;
    }
    for warning in &facts.warnings {
        writeln!(text, "  warning: {warning}")?;
    }
    Ok(text)
}

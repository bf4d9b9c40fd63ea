//! `warpknit inspect`: facts about meshes and whether they match, a sheet of each garment, and the
//! lapping of a fabric.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Result, anyhow};
use glam::DVec3;
use warpknit::chart::Drawing;
use warpknit::drape::Cloth;
use warpknit::export::Output;
use warpknit::fabric::Fabric;
use warpknit::garment::stretch::{Percentiles, isometry, stretch};
use warpknit::garment::{Garment, GarmentError, GarmentSummary, ReadOptions};
use warpknit::locate::overlap::{Overlaps, overlaps};
use warpknit::pipeline::{read_garment, turn_panels};

use super::args::{DEFAULT_FABRIC, Inspect};
use super::choice::named_fabric;
use super::drapes::expanded;
use super::facts::facts;
use super::sheet::{diagrams, drawn, sheet};
use super::terminal::{print, tell};
use super::values::FactsFormat;
use warpknit::pipeline::{Densities, check_distinct, numbered};

/// The most overlaps that are listed. The largest ones come first.
const NAMED: usize = 6;

/// Prints the fabric, if one is named, then one section for each garment. Pictures appear under their
/// names only if nothing failed.
pub(crate) fn inspect(arguments: &Inspect) -> Result<()> {
    let (mut pictures, mut shown) = (Vec::new(), None);
    let Inspect { fabric: asked, chains, .. } = arguments;
    if arguments.has_fabric() {
        let asked = asked.as_deref().unwrap_or(DEFAULT_FABRIC);
        let (fabric, _) = chains.on(named_fabric(asked)?, Densities::default())?;
        let name = chains.label(asked, &fabric);
        let mut charts = Vec::new();
        for (path, format) in &arguments.outputs {
            let FactsFormat::Chart(chart) = format else {
                let why = "a .json has facts of garments; name .svg or .png for a lapping";
                return Err(anyhow!("{}: {why}", path.display()));
            };
            charts.push((path.clone(), *chart));
        }
        let (whole, notes) = diagrams(&fabric, &charts)?;
        notes.iter().for_each(|note| tell(false, &format!("note: {name}: {note}")));
        print(&sheet(&fabric)?)?;
        pictures = whole;
        shown = Some(fabric);
    }
    pictures.extend(inspect_meshes(arguments, shown.as_ref())?);
    Ok(pictures.into_iter().try_for_each(Output::publish)?)
}

/// Prints one section for each garment and draws its sheets. A single file has its flat mesh in its
/// vt. With several files, the first is the flat mesh of all others. Folders and patterns stand for
/// their files. Panels are turned as the fabric, if one is named, says.
///
/// The section of a garment that can't be read has the error. The other garments follow, and the
/// command fails at the end.
fn inspect_meshes(arguments: &Inspect, fabric: Option<&Fabric>) -> Result<Vec<Output>> {
    let meshes =
        arguments.meshes.iter().map(|path| expanded(path)).collect::<Result<Vec<_>>>()?.concat();
    let Some((first, others)) = meshes.split_first() else { return Ok(Vec::new()) };
    let garments: Vec<Option<&Path>> = if others.is_empty() {
        vec![None]
    } else {
        others.iter().map(|path| Some(path.as_path())).collect()
    };
    let targets = sheets_of_each(arguments, &meshes, garments.len())?;
    // A garment that loses much of its cloth is what is to be inspected.
    let options = ReadOptions { allow_loss: true, ..arguments.reading.options() };
    let (mut whole, mut failed) = (Vec::new(), Vec::new());
    for (number, draped) in garments.iter().enumerate() {
        let name = draped.map_or_else(|| first.display().to_string(), |draped| pair(first, draped));
        match read_garment(first, *draped, &options) {
            Ok(mut garment) => {
                if let Some(fabric) = fabric {
                    Cloth::check_panels(&garment, fabric)?;
                    turn_panels(&mut garment, fabric);
                }
                print(&section(&name, &garment)?)?;
                whole.extend(draw(&name, &garment, &targets[number])?);
            }
            // A wrong option is the same error for every file.
            Err(error @ GarmentError::Option { .. }) => return Err(error.into()),
            Err(error) => {
                print(&format!("{name}\n  pairs: no: {error}\n"))?;
                failed.push(error);
            }
        }
    }
    let sheets = if arguments.outputs.is_empty() || garments.len() == 1 {
        ""
    } else {
        "; no sheet is written"
    };
    let more = failed.len().saturating_sub(1);
    match failed.into_iter().next() {
        None => Ok(whole),
        Some(error) if more == 0 => Err(anyhow!("{error}{sheets}")),
        Some(error) => Err(anyhow!(
            "{error}; {more} more of {} garments can't be read, their sections say why{sheets}",
            garments.len()
        )),
    }
}

/// The files of each garment's sheet. They are checked: none overwrites an input or another sheet,
/// and their folders can be written to.
fn sheets_of_each(
    arguments: &Inspect,
    meshes: &[PathBuf],
    garments: usize,
) -> Result<Vec<Vec<(PathBuf, FactsFormat)>>> {
    let mut each = vec![Vec::new(); garments];
    // With a fabric, the outputs are its diagrams, which are drawn already.
    if arguments.has_fabric() {
        return Ok(each);
    }
    let count = u32::try_from(garments)?;
    for (path, format) in &arguments.outputs {
        let paths =
            if count > 1 { numbered(path, format.ending(), count) } else { vec![path.clone()] };
        for (files, path) in each.iter_mut().zip(paths) {
            files.push((path, *format));
        }
    }
    let paths: Vec<_> = each.iter().flatten().map(|(path, _)| path.as_path()).collect();
    check_distinct(meshes.iter().map(PathBuf::as_path), paths.iter().copied())?;
    paths.into_iter().try_for_each(Output::check)?;
    Ok(each)
}

/// Draws a garment's sheet and writes its facts into complete files, still under their temporary names.
fn draw(name: &str, garment: &Garment, targets: &[(PathBuf, FactsFormat)]) -> Result<Vec<Output>> {
    let mut drawing = None;
    let mut whole = Vec::with_capacity(targets.len());
    for (path, format) in targets {
        whole.push(match format {
            FactsFormat::Json => Output::create_whole(path, facts(name, garment)?.as_bytes())?,
            FactsFormat::Chart(format) => {
                let drawing = drawing.get_or_insert_with(|| Drawing::from_garment(name, garment));
                drawn(drawing, path, *format)?
            }
        });
    }
    Ok(whole)
}

/// The name of a garment of two files.
fn pair(flat: &Path, draped: &Path) -> String {
    format!("{} + {}", flat.display(), draped.display())
}

/// The section of a garment.
fn section(name: &str, garment: &Garment) -> Result<String, std::fmt::Error> {
    let facts = &garment.summary;
    let mut text = String::new();
    writeln!(text, "{name}")?;
    let GarmentSummary { triangles, unit, untextured, .. } = facts;
    writeln!(text, "  pairs: yes ({} of {triangles} triangles)", triangles - untextured)?;
    let guessed = if facts.unit_guessed { " (guessed)" } else { "" };
    writeln!(
        text,
        "  triangles {triangles}, unit {unit}{guessed}, flat unit {:.6} mm",
        facts.uv_scale_mm
    )?;
    writeln!(
        text,
        "  left out: {} flipped, {} degenerate, {untextured} without vt",
        facts.flipped, facts.degenerate
    )?;
    // The bounding box of the drape. `--eye` and `--look-at` take points written like these.
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for point in garment.panels.iter().flat_map(|panel| &panel.draped) {
        (low, high) = (low.min(*point), high.max(*point));
    }
    let [low, high] = [low, high].map(|corner| corner + facts.origin);
    writeln!(
        text,
        "  draped from {} to {} mm, {} mm large",
        vector(low),
        vector(high),
        vector(high - low)
    )?;
    let (warp, weft) = stretch(&garment.panels);
    writeln!(text, "  stretch 5/50/95 %: warp {}, weft {}", percentiles(warp), percentiles(weft))?;
    let whole = isometry(&garment.panels);
    let [smallest, largest, area] = [whole.smallest, whole.largest, whole.area].map(percentiles);
    writeln!(
        text,
        "  isometry 5/50/95 %: smallest stretch {smallest}, largest stretch {largest}, area {area}"
    )?;
    text += &overlap_lines(&overlaps(garment));
    panel_table(&mut text, garment)?;
    for note in facts.all_notes() {
        writeln!(text, "  note: {note}")?;
    }
    for warning in &facts.warnings {
        writeln!(text, "  warning: {warning}")?;
    }
    Ok(text)
}

/// A vector's numbers with commas between them.
fn vector(v: DVec3) -> String {
    format!("{:.1},{:.1},{:.1}", v.x, v.y, v.z)
}

/// Three percentiles with spaces between them.
fn percentiles(p: Percentiles) -> String {
    format!("{:.3} {:.3} {:.3}", p[0], p[1], p[2])
}

/// One row for each panel. `smallest 5 %` is the 5th percentile of the smallest stretch, and
/// `largest 95 %` the 95th percentile of the largest.
fn panel_table(text: &mut String, garment: &Garment) -> std::fmt::Result {
    writeln!(
        text,
        "  panel  triangles   width mm  height mm   area cm²  flat unit mm  smallest 5 %  \
         largest 95 %  mirrored  flipped  non-manifold edges"
    )?;
    for (number, panel) in garment.panels.iter().enumerate() {
        let size = panel.size();
        let own = isometry(std::slice::from_ref(panel));
        write!(
            text,
            "  {number:5}  {:9}  {:9.1}  {:9.1}  {:9.1}  {:12.4}  {:12.3}  {:12.3}  {:>8}  {:7}  \
             {:18}",
            panel.triangles.len(),
            size.x,
            size.y,
            panel.area() / 100.0,
            garment.summary.panels[number].scale_mm,
            own.smallest[0],
            own.largest[2],
            if panel.mirrored { "yes" } else { "no" },
            panel.flipped.len(),
            panel.non_manifold_edges()
        )?;
        match &garment.summary.panels[number].name {
            Some(name) => writeln!(text, "  {name}")?,
            None => writeln!(text)?,
        }
    }
    Ok(())
}

/// The overlaps of panels in the flat layout, the largest ones by name.
fn overlap_lines(found: &Overlaps) -> String {
    // A search that ended early gives lower bounds.
    let least = if found.complete { "" } else { "at least " };
    let mut text = String::new();
    if !found.between.is_empty() {
        let pairs =
            found.between.iter().map(|([a, b], area)| (format!("{a} and {b}"), *area)).collect();
        let count = found.between.len();
        let plural = if count == 1 { "" } else { "s" };
        text += &format!(
            "  panels over each other in the flat file: {least}{count} pair{plural}, {}\n",
            largest_overlaps(pairs, least)
        );
    }
    if !found.within.is_empty() {
        let panels =
            found.within.iter().map(|(panel, area)| (format!("panel {panel}"), *area)).collect();
        text += &format!(
            "  panels over themselves in the flat file: {}\n",
            largest_overlaps(panels, least)
        );
    }
    if text.is_empty() {
        text += &format!(
            "  overlaps: none{}\n",
            if found.complete {
                ""
            } else {
                " found, but there is more to look at than there is time for"
            }
        );
    }
    text
}

/// The largest overlaps with their areas, and the number of the others.
fn largest_overlaps(mut all: Vec<(String, f64)>, least: &str) -> String {
    // A stable sort: equal ones stay in the panels' order.
    all.sort_by(|a, b| b.1.total_cmp(&a.1));
    let more = all.len().saturating_sub(NAMED);
    let list: Vec<_> = all
        .iter()
        .take(NAMED)
        .map(|(name, size)| format!("{name} ({least}{})", area_text(*size)))
        .collect();
    list.join(", ") + &if more > 0 { format!(" and {more} more") } else { String::new() }
}

/// An area, given in mm², with its unit. A fold of one triangle is too small for cm².
fn area_text(area: f64) -> String {
    if area < 100.0 { format!("{area:.2} mm²") } else { format!("{:.1} cm²", area / 100.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_overlaps_are_named_first() {
        let between = (1..=8_u8).map(|b| ([0, usize::from(b)], f64::from(b) * 50.0)).collect();
        let found = Overlaps { within: Vec::new(), between, complete: true };
        assert_eq!(
            overlap_lines(&found),
            "  panels over each other in the flat file: 8 pairs, 0 and 8 (4.0 cm²), 0 and 7 (3.5 cm²), 0 and 6 (3.0 cm²), 0 and 5 (2.5 cm²), \
             0 and 4 (2.0 cm²), 0 and 3 (1.5 cm²) and 2 more\n"
        );
    }

    #[test]
    fn no_overlap_and_a_search_that_ended_early() {
        let none = Overlaps { within: Vec::new(), between: Vec::new(), complete: true };
        assert_eq!(overlap_lines(&none), "  overlaps: none\n");
        let early = overlap_lines(&Overlaps { within: vec![(3, 2.5)], complete: false, ..none });
        assert!(
            early.starts_with("  panels over themselves")
                && early.ends_with(": panel 3 (at least 2.50 mm²)\n"),
            "{early}"
        );
    }
}

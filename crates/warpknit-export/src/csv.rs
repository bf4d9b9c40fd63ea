//! Data points as text, one row a point.
//!
//! Columns as the specification's cli page has them; panels, yarns, courses, wales and triangles
//! are counted from 0, bars from 1 (front bar), points from 1. Numbers are the shortest that read
//! back as the same `f64`. Cut ends are no data points and have no row.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use glam::{DAffine3, DVec3};

use super::buffer::{Buffer, Conveyor};
use super::{ExportError, Output, Sink};
use warpknit_core::drape::Block;
use warpknit_core::drape::strands::{CUT, Strand};
use warpknit_core::garment::{Garment, Panel};
use warpknit_core::knit::PointKind;

/// The first row.
pub const HEADER: &str = "panel,bar,yarn,course,wale,kind,point,triangle,flat_x,flat_y,flat_z,draped_x,draped_y,draped_z,\
                          normal_x,normal_y,normal_z\n";

/// Writes data points.
#[derive(Debug)]
pub struct CsvWriter<'a> {
    output: Output,
    garment: &'a Garment,
    conveyor: Conveyor,
}

impl<'a> CsvWriter<'a> {
    /// Starts the file.
    ///
    /// # Errors
    /// What the disk says.
    pub fn create(target: &Path, garment: &'a Garment) -> Result<Self, ExportError> {
        let mut output = Output::create(target)?;
        output.write_with(|file| file.write_all(HEADER.as_bytes()))?;
        Ok(Self { output, garment, conveyor: Conveyor::default() })
    }
}

impl Sink for CsvWriter<'_> {
    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        let Self { output, garment, conveyor } = self;
        conveyor.carry(
            blocks,
            |block, text| rows(block, &garment.panels[block.panel], text),
            |text| output.write_with(|file| file.write_all(text)),
        )
    }

    fn finish(self: Box<Self>) -> Result<Vec<Output>, ExportError> {
        Ok(vec![self.output.seal()?])
    }
}

fn rows(block: &Block, panel: &Panel, text: &mut Buffer) {
    for strand in &block.strands.strands {
        for at in strand.points.start as usize..strand.points.end as usize {
            if block.strands.sources[at] != CUT {
                row(block, strand, at, panel, text).expect("memory takes all text");
            }
        }
    }
}

fn row(
    block: &Block,
    strand: &Strand,
    at: usize,
    panel: &Panel,
    text: &mut Buffer,
) -> std::fmt::Result {
    let tag = block.knitted.tags[block.strands.sources[at] as usize];
    let kind = match tag.kind {
        PointKind::WarpLoop | PointKind::WeftLoop => "loop",
        PointKind::Inlay => "inlay",
        PointKind::Underlap => "turn",
    };
    let face = panel.faces[block.strands.located[at].triangle as usize];
    let (panel_number, bar, yarn) = (block.panel, block.bar + 1, strand.yarn.0);
    write!(
        text,
        "{panel_number},{bar},{yarn},{},{},{kind},{},{}",
        tag.course, tag.wale, tag.point, face.0
    )?;
    let flat = in_own_axes(&panel.flat_from_panel, block.strands.flat[at]);
    for v in [flat, block.draped.positions[at], block.draped.normals[at]] {
        write!(text, ",{},{},{}", v.x, v.y, v.z)?;
    }
    text.write_char('\n')
}

/// A flat point in the flat mesh's own axes.
fn in_own_axes(flat_from_panel: &DAffine3, flat: DVec3) -> DVec3 {
    flat_from_panel.transform_point3(flat)
}

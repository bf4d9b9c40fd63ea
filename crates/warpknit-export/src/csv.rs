//! Data points as comma-separated values (RFC 4180), one row a point.
//!
//! The columns are [`HEADER`]'s. Panels, yarns, courses, wales and triangles are counted from 0;
//! bars from 1, which is the front bar; points of a stitch from 1. Coordinates are mm, flat ones in
//! the axes of the flat mesh. Numbers are the shortest that read back as the same `f64`. Ends that
//! the panel's edge cut are no data points and have no row.

use std::fmt::Write as _;
use std::io::{Seek, Write};

use super::buffer::{Buffer, BufferPool};
use super::{ClothInfo, Destination, ExportError, Sink};
use warpknit_core::drape::Block;
use warpknit_core::drape::strands::{CUT, Strand};
use warpknit_core::garment::Panel;
use warpknit_core::knit::PointKind;

/// The first row.
pub const HEADER: &str = "panel,bar,yarn,course,wale,kind,point,triangle,\
                          flat_x,flat_y,flat_z,draped_x,draped_y,draped_z,\
                          normal_x,normal_y,normal_z\n";

/// Writes data points.
#[derive(Debug)]
pub struct CsvWriter<'a, W> {
    target: Destination<W>,
    panels: &'a [Panel],
    buffers: BufferPool,
}

impl<'a, W: Write + Seek + Send> CsvWriter<'a, W> {
    /// Starts the file of yarns on the cloth's panels.
    ///
    /// # Errors
    /// [`ExportError::Io`].
    pub fn create(mut target: Destination<W>, cloth: &ClothInfo<'a>) -> Result<Self, ExportError> {
        target.write(HEADER.as_bytes())?;
        Ok(Self { target, panels: cloth.panels, buffers: BufferPool::default() })
    }
}

impl<W: Write + Seek + Send> Sink<W> for CsvWriter<'_, W> {
    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        let Self { target, panels, buffers } = self;
        check_panels(blocks, panels, target)?;
        buffers.write_each(
            blocks,
            |block, text| add_rows(block, &panels[block.panel], text),
            |text| target.write(text),
        )
    }

    fn finish(self: Box<Self>) -> Result<W, ExportError> {
        self.target.finish()
    }
}

/// Refuses blocks of panels that aren't known.
pub(super) fn check_panels<W>(
    blocks: &[Block],
    panels: &[Panel],
    target: &Destination<W>,
) -> Result<(), ExportError> {
    match blocks.iter().find(|block| block.panel >= panels.len()) {
        None => Ok(()),
        Some(block) => Err(ExportError::NoPanel {
            path: target.error_path(),
            panel: block.panel,
            panels: panels.len(),
        }),
    }
}

/// The rows of a block.
fn add_rows(block: &Block, panel: &Panel, text: &mut Buffer) {
    for strand in &block.strands.strands {
        for at in strand.points.start as usize..strand.points.end as usize {
            if block.strands.sources[at] != CUT {
                add_row(block, strand, at, panel, text).expect("memory takes all text");
            }
        }
    }
}

/// The row of the point at index `at` of its block.
fn add_row(
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
    let flat = panel.flat_from_panel.transform_point3(block.strands.flat[at]);
    for v in [flat, block.draped.positions[at] + block.origin, block.draped.normals[at]] {
        write!(text, ",{},{},{}", v.x, v.y, v.z)?;
    }
    text.write_char('\n')
}

//! Yarns as USD text (`.usda`): cubic Bézier curves, one `BasisCurves` for each bar of each panel,
//! a material a bar; mm, y up.
//!
//! The curves are the tubes' own ([`warpknit_core::yarn::curve`]), to four decimals of a millimetre. Each
//! data point has its course and wale (`primvars:course`, `primvars:wale`; -1 where the panel's
//! edge cut the yarn off before its first data point), and the yarn's length up to it in mm
//! (`primvars:st`, second number); each curve the number of its yarn. One pass: a prim's points go
//! to the file as they come, and what follows them waits on the disk.

use std::fmt::Write as _;
use std::io::{self, Write as _};
use std::path::Path;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::buffer::{Buffer, Conveyor};
use super::digits::numbers;
use super::spool::Spill;
use super::{ExportError, Output, Sink};
use warpknit_core::drape::Block;
use warpknit_core::drape::strands::{CUT, Strand};
use warpknit_core::fabric::Fabric;
use warpknit_core::ids::index32;
use warpknit_core::number::narrow;
use warpknit_core::yarn::curve;
use warpknit_core::yarn::tube::Section;
use warpknit_render::cloth::ROUGHNESS;

/// The box of nothing.
pub(super) const EMPTY: [Vec3; 2] = [Vec3::INFINITY, Vec3::NEG_INFINITY];
/// A course and a wale that are not known.
const UNKNOWN: i32 = -1;

/// Writes yarns as USD curves.
#[derive(Debug)]
pub struct UsdaWriter {
    output: Output,
    /// Each bar's colour, linear, and radius, mm.
    bars: Vec<([f32; 3], f32)>,
    group: Option<Group>,
    later: Attributes,
    conveyor: Conveyor,
}

/// The prim that is being written.
#[derive(Debug)]
struct Group {
    panel: usize,
    bar: usize,
    /// Lowest and highest control point so far, mm.
    extent: [Vec3; 2],
}

/// The arrays that come after the points, in their order in the file.
#[derive(Debug)]
pub(super) struct Attributes([(Attribute, Spill); 5]);

/// An array beside the points.
#[derive(Clone, Copy, Debug)]
enum Attribute {
    Counts,
    Yarns,
    Courses,
    Wales,
    Lengths,
}

impl UsdaWriter {
    /// Starts the file of a fabric's yarns, as thick as their tubes.
    ///
    /// # Errors
    /// What the disk says.
    pub fn create(target: &Path, fabric: &Fabric, section: &Section) -> Result<Self, ExportError> {
        let mut output = Output::create(target)?;
        let bars = bars(fabric, section);
        output.write_with(|file| file.write_all(head(&bars, "").as_bytes()))?;
        Ok(Self {
            output,
            bars,
            group: None,
            later: Attributes::create(target)?,
            conveyor: Conveyor::default(),
        })
    }

    /// Adds blocks of one bar of one panel.
    fn add(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        let (panel, bar) = (blocks[0].panel, blocks[0].bar);
        if self.group.as_ref().is_none_or(|group| (group.panel, group.bar) != (panel, bar)) {
            self.end_group()?;
            let text = prim(panel, bar, self.bars[bar]);
            self.output.write_with(|file| write!(file, "{text}        point3f[] points = ["))?;
            self.group = Some(Group { panel, bar, extent: EMPTY });
        }
        let Self { output, group, later, conveyor, .. } = self;
        if let Some(Group { extent, .. }) = group {
            *extent = blocks.par_iter().map(bounds).reduce(|| *extent, union);
        }
        conveyor.carry(blocks, points, |text| output.write_with(|file| file.write_all(text)))?;
        later.add(blocks, conveyor, output)
    }

    /// Closes the prim that is being written, if there is one.
    fn end_group(&mut self) -> Result<(), ExportError> {
        let Some(Group { bar, extent, .. }) = self.group.take() else { return Ok(()) };
        let Self { output, bars, later, .. } = self;
        output.write_with(|file| {
            file.write_all(b"]\n")?;
            later.pour(file)?;
            writeln!(file, "        float3[] extent = {}\n    }}", boxed(extent, bars[bar].1))
        })
    }
}

/// Blocks in a row that belong to one prim, where anything of them is on the panel.
pub(super) fn groups(blocks: &[Block]) -> impl Iterator<Item = &[Block]> {
    let groups = blocks.chunk_by(|a, b| (a.panel, a.bar) == (b.panel, b.bar));
    groups.filter(|blocks| blocks.iter().any(|block| !block.strands.strands.is_empty()))
}

impl Sink for UsdaWriter {
    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        groups(blocks).try_for_each(|blocks| self.add(blocks))
    }

    fn finish(mut self: Box<Self>) -> Result<Vec<Output>, ExportError> {
        self.end_group()?;
        self.output.write_with(|file| file.write_all(b"}\n"))?;
        Ok(vec![self.output.seal()?])
    }
}

impl Attributes {
    pub(super) fn create(target: &Path) -> Result<Self, ExportError> {
        let spill = |attribute| Spill::create(target).map(|spill| (attribute, spill));
        Ok(Self([
            spill(Attribute::Counts)?,
            spill(Attribute::Yarns)?,
            spill(Attribute::Courses)?,
            spill(Attribute::Wales)?,
            spill(Attribute::Lengths)?,
        ]))
    }

    /// Appends those of blocks of one prim; errors are told with the output's name.
    pub(super) fn add(
        &mut self,
        blocks: &[Block],
        conveyor: &mut Conveyor,
        output: &mut Output,
    ) -> Result<(), ExportError> {
        for (attribute, spill) in &mut self.0 {
            conveyor.carry(
                blocks,
                |block, text| attribute.add(block, text),
                |text| output.write_with(|_| spill.write_all(text)),
            )?;
        }
        Ok(())
    }

    /// Writes what there is of the prim, and forgets it.
    pub(super) fn pour(&mut self, file: &mut impl io::Write) -> io::Result<()> {
        for (attribute, spill) in &mut self.0 {
            let (declared, interpolation) = attribute.declared();
            write!(file, "        {declared} = [")?;
            spill.pour(file)?;
            let metadata = interpolation
                .map_or(String::new(), |name| format!(" (interpolation = \"{name}\")"));
            writeln!(file, "]{metadata}")?;
        }
        Ok(())
    }
}

impl Attribute {
    /// Its type and name, and how its values are spread.
    fn declared(self) -> (&'static str, Option<&'static str>) {
        match self {
            Self::Counts => ("int[] curveVertexCounts", None),
            Self::Yarns => ("int[] primvars:yarn", Some("uniform")),
            Self::Courses => ("int[] primvars:course", Some("varying")),
            Self::Wales => ("int[] primvars:wale", Some("varying")),
            Self::Lengths => ("texCoord2f[] primvars:st", Some("varying")),
        }
    }

    /// Appends a block's values.
    fn add(self, block: &Block, text: &mut Buffer) {
        for strand in &block.strands.strands {
            let points = strand.points.clone();
            match self {
                // Three for each span, and the first.
                Self::Counts => item(text, format_args!("{}", 3 * (points.end - points.start) - 2)),
                Self::Yarns => item(text, format_args!("{}", strand.yarn.0)),
                Self::Courses => points
                    .for_each(|at| item(text, format_args!("{}", place(block, strand, at)[0]))),
                Self::Wales => points
                    .for_each(|at| item(text, format_args!("{}", place(block, strand, at)[1]))),
                Self::Lengths => lengths(&block.draped.positions[strand.range()], text),
            }
        }
    }
}

/// An entry of an array; the format allows a comma behind the last one too.
fn item(text: &mut Buffer, value: std::fmt::Arguments<'_>) {
    write!(text, "{value}, ").expect("memory takes all text");
}

/// Course and wale of a point. An end that was cut has those of the data point beside it.
fn place(block: &Block, strand: &Strand, at: u32) -> [i32; 2] {
    let sources = &block.strands.sources;
    let inner = if at == strand.points.start { at + 1 } else { at.saturating_sub(1) };
    let source =
        [at, inner].map(|at| sources[at as usize]).into_iter().find(|&source| source != CUT);
    source.map_or([UNKNOWN; 2], |source| {
        let tag = block.knitted.tags[source as usize];
        [tag.course, tag.wale]
    })
}

/// The yarn's length up to each of its points, as a texture coordinate along it.
fn lengths(points: &[DVec3], text: &mut Buffer) {
    let mut length = 0.0;
    for index in 0..points.len() {
        text.write_str("(0, ").expect("memory takes all text");
        numbers(text, [narrow(length)], b' ');
        text.write_str("), ").expect("memory takes all text");
        if index + 1 < points.len() {
            length += curve::span(points, index).length();
        }
    }
}

/// Control points of a block's strands, strand after strand.
fn controls(block: &Block) -> impl Iterator<Item = Vec3> {
    block.strands.strands.iter().flat_map(|strand| {
        let points = &block.draped.positions[strand.range()];
        let spans = (0..points.len() - 1)
            .flat_map(|index| curve::span(points, index).bezier().into_iter().skip(1));
        points.first().copied().into_iter().chain(spans).map(|point| point.as_vec3())
    })
}

/// The box of a block's control points, which hold its curves.
pub(super) fn bounds(block: &Block) -> [Vec3; 2] {
    controls(block).fold(EMPTY, |extent, control| union(extent, [control; 2]))
}

pub(super) fn union(a: [Vec3; 2], b: [Vec3; 2]) -> [Vec3; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// A box that is wider by a radius, as the format has it.
pub(super) fn boxed([low, high]: [Vec3; 2], radius: f32) -> String {
    let ([a, b, c], [d, e, f]) = ((low - radius).to_array(), (high + radius).to_array());
    format!("[({a}, {b}, {c}), ({d}, {e}, {f})]")
}

/// Each bar's colour, linear, and radius, mm.
pub(super) fn bars(fabric: &Fabric, section: &Section) -> Vec<([f32; 3], f32)> {
    fabric.yarns().map(|yarn| yarn.color.linear()).zip(super::radii(fabric, section)).collect()
}

/// Appends a block's control points.
pub(super) fn points(block: &Block, text: &mut Buffer) {
    for control in controls(block) {
        text.write_char('(').expect("memory takes all text");
        numbers(text, control.to_array(), b',');
        text.write_str("), ").expect("memory takes all text");
    }
}

/// What stands before the first prim: units, what is to be said of time (lines), and the materials.
pub(super) fn head(bars: &[([f32; 3], f32)], time: &str) -> String {
    let mut text = format!(
        "#usda 1.0\n(\n    defaultPrim = \"cloth\"\n    doc = \"yarns by warpknit\"\n{time}    metersPerUnit = 0.001\n    upAxis = \"Y\"\n)\n\n\
         def Xform \"cloth\" (\n    kind = \"component\"\n)\n{{\n    def Scope \"looks\"\n    {{\n",
    );
    for (([r, g, b], _), number) in bars.iter().zip(1..) {
        text += &format!(
            "        def Material \"bar_{number}\"\n        {{\n            \
             token outputs:surface.connect = </cloth/looks/bar_{number}/preview.outputs:surface>\n\n            \
             def Shader \"preview\"\n            {{\n                \
             uniform token info:id = \"UsdPreviewSurface\"\n                \
             color3f inputs:diffuseColor = ({r}, {g}, {b})\n                \
             float inputs:roughness = {ROUGHNESS}\n                \
             token outputs:surface\n            }}\n        }}\n"
        );
    }
    text + "    }\n"
}

/// The beginning of a prim, up to its points.
pub(super) fn prim(panel: usize, bar: usize, ([r, g, b], radius): ([f32; 3], f32)) -> String {
    let number = index32(bar) + 1;
    format!(
        "\n    def BasisCurves \"panel_{panel}_bar_{number}\" (\n        prepend apiSchemas = [\"MaterialBindingAPI\"]\n    )\n    {{\n        \
         rel material:binding = </cloth/looks/bar_{number}>\n        \
         uniform token type = \"cubic\"\n        uniform token basis = \"bezier\"\n        uniform token wrap = \"nonperiodic\"\n        \
         float[] widths = [{}] (interpolation = \"constant\")\n        \
         color3f[] primvars:displayColor = [({r}, {g}, {b})] (interpolation = \"constant\")\n        \
         int primvars:bar = {number}\n",
        2.0 * radius
    )
}

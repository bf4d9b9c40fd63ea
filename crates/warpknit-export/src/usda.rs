//! Yarns as USD text (`.usda`; Alliance for OpenUSD, "OpenUSD documentation", UsdGeom's
//! `BasisCurves`): cubic Bézier curves, one prim for each bar of each panel, a material a bar; mm,
//! y up.
//!
//! The curves are the tubes' own ([`warpknit_core::yarn::curve`]), to four decimals of a
//! millimetre. Each data point has its course and wale (`primvars:course`, `primvars:wale`; -1
//! where the panel's edge cut the yarn off before its first data point), and the yarn's length up
//! to it in mm (`primvars:st`, second number). Each curve has the number of its yarn. The file is
//! written in one pass: a prim's points go to the file as they come, and its other arrays wait in
//! spools.

use std::fmt::Write as _;
use std::io::{self, Seek, Write};

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::buffer::{Buffer, Conveyor};
use super::digits::numbers;
use super::spool::Spool;
use super::{ClothInfo, Destination, ExportError, Sink, StrandStyle};
use warpknit_core::drape::Block;
use warpknit_core::drape::strands::{CUT, Strand};
use warpknit_core::ids::index32;
use warpknit_core::number::narrow;
use warpknit_core::yarn::curve;
use warpknit_render::cloth::ROUGHNESS;

/// The bounding box of no points.
pub(super) const EMPTY: [Vec3; 2] = [Vec3::INFINITY, Vec3::NEG_INFINITY];
/// The course and the wale of a point that has none.
const UNKNOWN: i32 = -1;

/// Writes yarns as USD curves.
#[derive(Debug)]
pub struct UsdaWriter<W> {
    target: Destination<W>,
    styles: Vec<StrandStyle>,
    current: Option<CurrentPrim>,
    attributes: Attributes,
    conveyor: Conveyor,
}

/// The prim that is being written.
#[derive(Debug)]
struct CurrentPrim {
    panel: usize,
    bar: usize,
    /// Lowest and highest control point so far, mm.
    extent: [Vec3; 2],
}

/// The arrays that come after the points, in their order in the file.
#[derive(Debug)]
pub(super) struct Attributes([(Attribute, Spool); 5]);

/// An array beside the points.
#[derive(Clone, Copy, Debug)]
enum Attribute {
    Counts,
    Yarns,
    Courses,
    Wales,
    Lengths,
}

impl<W: Write + Seek + Send> UsdaWriter<W> {
    /// Starts the file.
    ///
    /// # Errors
    /// [`ExportError::Io`].
    pub fn create(mut target: Destination<W>, cloth: &ClothInfo<'_>) -> Result<Self, ExportError> {
        let styles = cloth.strands.clone();
        target.write(beginning(&styles, "").as_bytes())?;
        let attributes = Attributes::create(&target)?;
        Ok(Self { target, styles, current: None, attributes, conveyor: Conveyor::default() })
    }

    /// Adds blocks of one bar of one panel.
    fn add(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        let (panel, bar) = (blocks[0].panel, blocks[0].bar);
        if self.current.as_ref().is_none_or(|prim| (prim.panel, prim.bar) != (panel, bar)) {
            self.end_prim()?;
            let text = prim_beginning(panel, bar, &self.styles[bar]);
            self.target.write_with(|file| write!(file, "{text}        point3f[] points = ["))?;
            self.current = Some(CurrentPrim { panel, bar, extent: EMPTY });
        }
        let Self { target, current, attributes, conveyor, .. } = self;
        // The extent comes after the points in the file, so it needs no second pass.
        if let Some(CurrentPrim { extent, .. }) = current {
            *extent = blocks.par_iter().map(bounds).reduce(|| *extent, union);
        }
        conveyor.carry(blocks, add_points, |text| target.write(text))?;
        attributes.add(blocks, conveyor, target)
    }

    /// Closes the prim that is being written, if there is one.
    fn end_prim(&mut self) -> Result<(), ExportError> {
        let Some(CurrentPrim { bar, extent, .. }) = self.current.take() else { return Ok(()) };
        let Self { target, styles, attributes, .. } = self;
        target.write_with(|file| {
            file.write_all(b"]\n")?;
            attributes.drain(file)?;
            let extent = extent_text(extent, &styles[bar]);
            writeln!(file, "        float3[] extent = {extent}\n    }}")
        })
    }
}

/// Consecutive blocks that belong to one prim, without those that have no strand on the panel.
pub(super) fn blocks_by_prim(blocks: &[Block]) -> impl Iterator<Item = &[Block]> {
    let by_prim = blocks.chunk_by(|a, b| (a.panel, a.bar) == (b.panel, b.bar));
    by_prim.filter(|blocks| blocks.iter().any(|block| !block.strands.strands.is_empty()))
}

impl<W: Write + Seek + Send> Sink<W> for UsdaWriter<W> {
    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        blocks_by_prim(blocks).try_for_each(|blocks| self.add(blocks))
    }

    fn finish(mut self: Box<Self>) -> Result<W, ExportError> {
        self.end_prim()?;
        self.target.write(b"}\n")?;
        self.target.finish()
    }
}

impl Attributes {
    /// Empty arrays of a file.
    pub(super) fn create<W>(target: &Destination<W>) -> Result<Self, ExportError> {
        Ok(Self([
            (Attribute::Counts, target.spool()?),
            (Attribute::Yarns, target.spool()?),
            (Attribute::Courses, target.spool()?),
            (Attribute::Wales, target.spool()?),
            (Attribute::Lengths, target.spool()?),
        ]))
    }

    /// Appends those of blocks of one prim; errors name the target.
    pub(super) fn add<W: Write + Seek + Send>(
        &mut self,
        blocks: &[Block],
        conveyor: &mut Conveyor,
        target: &mut Destination<W>,
    ) -> Result<(), ExportError> {
        for (attribute, spool) in &mut self.0 {
            conveyor.carry(
                blocks,
                |block, text| attribute.add(block, text),
                |text| target.write_with(|_| spool.write_all(text)),
            )?;
        }
        Ok(())
    }

    /// Writes the prim's arrays and empties them.
    pub(super) fn drain(&mut self, file: &mut impl io::Write) -> io::Result<()> {
        for (attribute, spool) in &mut self.0 {
            let (declared, interpolation) = attribute.declaration();
            write!(file, "        {declared} = [")?;
            spool.drain(file)?;
            let metadata = interpolation
                .map_or(String::new(), |name| format!(" (interpolation = \"{name}\")"));
            writeln!(file, "]{metadata}")?;
        }
        Ok(())
    }
}

impl Attribute {
    /// Its type and name, and its interpolation: a value a curve is `uniform`, one a data point
    /// `varying`.
    fn declaration(self) -> (&'static str, Option<&'static str>) {
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
                // A cubic span adds three control points to the first one.
                Self::Counts => {
                    add_value(text, format_args!("{}", 3 * (points.end - points.start) - 2));
                }
                Self::Yarns => add_value(text, format_args!("{}", strand.yarn.0)),
                Self::Courses => {
                    for at in points {
                        add_value(text, format_args!("{}", course_and_wale(block, strand, at)[0]));
                    }
                }
                Self::Wales => {
                    for at in points {
                        add_value(text, format_args!("{}", course_and_wale(block, strand, at)[1]));
                    }
                }
                Self::Lengths => add_lengths(&block.draped.positions[strand.range()], text),
            }
        }
    }
}

/// Appends a value of an array; the format allows a comma behind the last one too.
fn add_value(text: &mut Buffer, value: std::fmt::Arguments<'_>) {
    write!(text, "{value}, ").expect("memory takes all text");
}

/// Course and wale of a point. A cut end has those of the data point beside it.
fn course_and_wale(block: &Block, strand: &Strand, at: u32) -> [i32; 2] {
    let sources = &block.strands.sources;
    // Only a strand's first and last point can be cut, and the point next to it is a data point.
    let inner = if at == strand.points.start { at + 1 } else { at.saturating_sub(1) };
    let source =
        [at, inner].map(|at| sources[at as usize]).into_iter().find(|&source| source != CUT);
    source.map_or([UNKNOWN; 2], |source| {
        let tag = block.knitted.tags[source as usize];
        [tag.course, tag.wale]
    })
}

/// The yarn's length up to each of its points, as a texture coordinate along it.
fn add_lengths(points: &[DVec3], text: &mut Buffer) {
    let mut length = 0.0;
    for index in 0..points.len() {
        text.write_str("(0, ").expect("memory takes all text");
        numbers(text, [narrow(length)], b' ');
        text.write_str("), ").expect("memory takes all text");
        // The arc length of the curve, not of its chord: textures don't stretch in bends.
        if index + 1 < points.len() {
            length += curve::span(points, index).length();
        }
    }
}

/// Control points of a block's strands, strand after strand. Spans share their ends.
fn controls(block: &Block) -> impl Iterator<Item = Vec3> {
    block.strands.strands.iter().flat_map(|strand| {
        let points = &block.draped.positions[strand.range()];
        let spans = (0..points.len() - 1)
            .flat_map(|index| curve::span(points, index).bezier().into_iter().skip(1));
        points
            .first()
            .copied()
            .into_iter()
            .chain(spans)
            .map(|point| (point + block.origin).as_vec3())
    })
}

/// The bounding box of a block's control points. A Bézier curve lies in the convex hull of its
/// control points, so the box holds the curves too.
pub(super) fn bounds(block: &Block) -> [Vec3; 2] {
    controls(block).fold(EMPTY, |extent, control| union(extent, [control; 2]))
}

/// The bounding box of two.
pub(super) fn union(a: [Vec3; 2], b: [Vec3; 2]) -> [Vec3; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// The bounding box of strands around centre lines, as text.
pub(super) fn extent_text([low, high]: [Vec3; 2], style: &StrandStyle) -> String {
    let radius = style.radius_f32();
    let ([a, b, c], [d, e, f]) = ((low - radius).to_array(), (high + radius).to_array());
    format!("[({a}, {b}, {c}), ({d}, {e}, {f})]")
}

/// Appends a block's control points.
pub(super) fn add_points(block: &Block, text: &mut Buffer) {
    for control in controls(block) {
        text.write_char('(').expect("memory takes all text");
        numbers(text, control.to_array(), b',');
        text.write_str("), ").expect("memory takes all text");
    }
}

/// The file up to its first prim: units, lines that say how time runs, and the materials.
pub(super) fn beginning(styles: &[StrandStyle], time: &str) -> String {
    let mut text = format!(
        "#usda 1.0\n(\n    defaultPrim = \"cloth\"\n    doc = \"yarns by warpknit\"\n{time}    \
         metersPerUnit = 0.001\n    upAxis = \"Y\"\n)\n\n\
         def Xform \"cloth\" (\n    kind = \"component\"\n)\n{{\n    \
         def Scope \"looks\"\n    {{\n",
    );
    for (style, number) in styles.iter().zip(1..) {
        let [r, g, b] = style.color.linear();
        text += &format!(
            "        def Material \"bar_{number}\"\n        {{\n            \
             token outputs:surface.connect = \
             </cloth/looks/bar_{number}/preview.outputs:surface>\n\n            \
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
pub(super) fn prim_beginning(panel: usize, bar: usize, style: &StrandStyle) -> String {
    let number = index32(bar) + 1;
    let [r, g, b] = style.color.linear();
    let width = 2.0 * style.radius_f32();
    format!(
        "\n    def BasisCurves \"panel_{panel}_bar_{number}\" (\n        \
         prepend apiSchemas = [\"MaterialBindingAPI\"]\n    )\n    {{\n        \
         rel material:binding = </cloth/looks/bar_{number}>\n        \
         uniform token type = \"cubic\"\n        \
         uniform token basis = \"bezier\"\n        \
         uniform token wrap = \"nonperiodic\"\n        \
         float[] widths = [{width}] (interpolation = \"constant\")\n        \
         color3f[] primvars:displayColor = [({r}, {g}, {b})] \
         (interpolation = \"constant\")\n        \
         int primvars:bar = {number}\n"
    )
}

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

use super::buffer::{Buffer, BufferPool};
use super::digits::numbers;
use super::spool::Spool;
use super::usd_stage::{
    Array, EMPTY, MATERIAL_SCHEMAS, UsdCurves, blocks_by_prim, bounds, course_and_wale, each_point,
    is_at_rest, physics, rest_points, union, widened, width,
};
use super::{ClothInfo, Destination, ExportError, Sink, StrandStyle};
use warpknit_core::drape::Block;
use warpknit_core::ids::index32;
use warpknit_core::number::narrow;
use warpknit_core::yarn::curve;
use warpknit_render::cloth::ROUGHNESS;

/// Writes yarns as USD curves.
#[derive(Debug)]
pub struct UsdaWriter<W> {
    target: Destination<W>,
    styles: Vec<StrandStyle>,
    curves: UsdCurves,
    current: Option<CurrentPrim>,
    attributes: Attributes,
    buffers: BufferPool,
}

/// The prim that is being written.
#[derive(Debug)]
struct CurrentPrim {
    panel: usize,
    bar: usize,
    /// Lowest and highest control point so far, in the stage's units.
    extent: [Vec3; 2],
}

/// The arrays that come after the points, in their order in the file.
#[derive(Debug)]
pub(super) struct Attributes {
    curves: UsdCurves,
    arrays: Vec<(Array, Spool)>,
    /// Whether the yarns lie as in the flat cloth so far: then their rest shape is left out.
    are_at_rest: bool,
}

impl<W: Write + Seek + Send> UsdaWriter<W> {
    /// Starts the file.
    ///
    /// # Errors
    /// [`ExportError::Io`].
    pub fn create(mut target: Destination<W>, cloth: &ClothInfo<'_>) -> Result<Self, ExportError> {
        let (styles, curves) = (cloth.strands.clone(), cloth.usd_curves);
        target.write(beginning(&styles, curves, "").as_bytes())?;
        let attributes = Attributes::create(&target, curves)?;
        let buffers = BufferPool::default();
        Ok(Self { target, styles, curves, current: None, attributes, buffers })
    }

    /// Adds blocks of one bar of one panel.
    fn add(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        let (panel, bar) = (blocks[0].panel, blocks[0].bar);
        if self.current.as_ref().is_none_or(|prim| (prim.panel, prim.bar) != (panel, bar)) {
            self.end_prim()?;
            let text = prim_beginning(panel, bar, &self.styles[bar], self.curves);
            self.target.write_with(|file| write!(file, "{text}        point3f[] points = ["))?;
            self.current = Some(CurrentPrim { panel, bar, extent: EMPTY });
        }
        let Self { target, curves, current, attributes, buffers, .. } = self;
        let curves = *curves;
        // The extent comes after the points in the file, so it needs no second pass.
        if let Some(CurrentPrim { extent, .. }) = current {
            *extent =
                blocks.par_iter().map(|block| bounds(block, curves)).reduce(|| *extent, union);
        }
        buffers.write_each(
            blocks,
            |block, text| add_points(block, curves, text),
            |text| target.write(text),
        )?;
        attributes.add(blocks, buffers, target)
    }

    /// Closes the prim that is being written, if there is one.
    fn end_prim(&mut self) -> Result<(), ExportError> {
        let Some(CurrentPrim { bar, extent, .. }) = self.current.take() else { return Ok(()) };
        let Self { target, styles, curves, attributes, .. } = self;
        target.write_with(|file| {
            file.write_all(b"]\n")?;
            attributes.drain(file)?;
            let extent = extent_text(extent, &styles[bar], *curves);
            writeln!(file, "        float3[] extent = {extent}\n    }}")
        })
    }
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
    pub(super) fn create<W>(
        target: &Destination<W>,
        curves: UsdCurves,
    ) -> Result<Self, ExportError> {
        let last = match curves {
            UsdCurves::Bezier => Array::Lengths,
            UsdCurves::Linear => Array::Rest,
        };
        let all = [Array::Counts, Array::Yarns, Array::Courses, Array::Wales, last];
        let arrays = all.map(|array| Ok((array, target.spool()?)));
        let arrays = arrays.into_iter().collect::<Result<_, ExportError>>()?;
        Ok(Self { curves, arrays, are_at_rest: true })
    }

    /// Appends those of blocks of one prim; errors name the target.
    pub(super) fn add<W: Write + Seek + Send>(
        &mut self,
        blocks: &[Block],
        buffers: &mut BufferPool,
        target: &mut Destination<W>,
    ) -> Result<(), ExportError> {
        let curves = self.curves;
        self.are_at_rest &= curves == UsdCurves::Linear && blocks.par_iter().all(is_at_rest);
        for (array, spool) in &mut self.arrays {
            buffers.write_each(
                blocks,
                |block, text| add(*array, block, curves, text),
                |text| target.write_with(|_| spool.write_all(text)),
            )?;
        }
        Ok(())
    }

    /// Writes the prim's arrays and empties them.
    pub(super) fn drain(&mut self, file: &mut impl io::Write) -> io::Result<()> {
        let are_at_rest = std::mem::replace(&mut self.are_at_rest, true);
        for (array, spool) in &mut self.arrays {
            if are_at_rest && *array == Array::Rest {
                spool.drain(&mut io::sink())?;
                continue;
            }
            let (type_name, name, interpolation) = array.declaration();
            write!(file, "        {type_name} {name} = [")?;
            spool.drain(file)?;
            let metadata = interpolation
                .map_or(String::new(), |name| format!(" (interpolation = \"{name}\")"));
            writeln!(file, "]{metadata}")?;
        }
        Ok(())
    }
}

/// Appends a block's values of an array.
fn add(array: Array, block: &Block, curves: UsdCurves, text: &mut Buffer) {
    for strand in &block.strands.strands {
        let points = strand.range();
        match array {
            Array::Counts => {
                let count = curves.count(index32(points.len()));
                add_value(text, format_args!("{count}"));
            }
            Array::Yarns => add_value(text, format_args!("{}", strand.yarn.0)),
            Array::Courses => {
                for at in points {
                    add_value(text, format_args!("{}", course_and_wale(block, at)[0]));
                }
            }
            Array::Wales => {
                for at in points {
                    add_value(text, format_args!("{}", course_and_wale(block, at)[1]));
                }
            }
            Array::Lengths => add_lengths(&block.draped.positions[strand.range()], text),
            Array::Rest => {
                for point in rest_points(block, strand) {
                    add_point(point, curves, text);
                }
            }
        }
    }
}

/// Appends a value of an array; the format allows a comma behind the last one too.
fn add_value(text: &mut Buffer, value: std::fmt::Arguments<'_>) {
    write!(text, "{value}, ").expect("memory takes all text");
}

/// The yarn's length up to each of its points, as a texture coordinate along it.
fn add_lengths(points: &[DVec3], text: &mut Buffer) {
    let mut spans = curve::spans(points);
    let mut length = 0.0;
    for _ in points {
        text.write_str("(0, ").expect("memory takes all text");
        numbers(text, [narrow(length)], b' ');
        text.write_str("), ").expect("memory takes all text");
        // The arc length of the curve, not of its chord: textures don't stretch in bends.
        length += spans.next().map_or(0.0, |span| span.length());
    }
}

/// The bounding box of strands around centre lines, as text.
pub(super) fn extent_text(extent: [Vec3; 2], style: &StrandStyle, curves: UsdCurves) -> String {
    let [a, b, c, d, e, f] = widened(extent, style, curves);
    format!("[({a}, {b}, {c}), ({d}, {e}, {f})]")
}

/// Appends the points of a block's curves.
pub(super) fn add_points(block: &Block, curves: UsdCurves, text: &mut Buffer) {
    for strand in &block.strands.strands {
        each_point(block, strand, curves, |point| add_point(point, curves, text));
    }
}

fn add_point(point: Vec3, curves: UsdCurves, text: &mut Buffer) {
    text.write_char('(').expect("memory takes all text");
    match curves {
        UsdCurves::Bezier => numbers(text, point.to_array(), b','),
        // Four decimals of a metre would be too few.
        UsdCurves::Linear => {
            write!(text, "{},{},{}", point.x, point.y, point.z).expect("memory takes all text");
        }
    }
    text.write_str("), ").expect("memory takes all text");
}

/// The file up to its first prim: units, lines that say how time runs, and the materials.
pub(super) fn beginning(styles: &[StrandStyle], curves: UsdCurves, time: &str) -> String {
    let kilograms = match curves {
        UsdCurves::Bezier => "",
        UsdCurves::Linear => "    kilogramsPerUnit = 1\n",
    };
    let metres = curves.metres_per_unit();
    let mut text = format!(
        "#usda 1.0\n(\n    defaultPrim = \"cloth\"\n    doc = \"yarns by warpknit\"\n{time}    \
         metersPerUnit = {metres}\n{kilograms}    upAxis = \"Y\"\n)\n\n\
         def Xform \"cloth\" (\n    kind = \"component\"\n)\n{{\n    \
         def Scope \"looks\"\n    {{\n",
    );
    for (style, number) in styles.iter().zip(1..) {
        let [r, g, b] = style.color.linear();
        let (schemas, physics) = material_physics(style, curves);
        text += &format!(
            "        def Material \"bar_{number}\"{schemas}\n        {{\n{physics}            \
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

/// The schemas of a bar's material and its attributes, as text.
fn material_physics(style: &StrandStyle, curves: UsdCurves) -> (String, String) {
    if curves == UsdCurves::Bezier {
        return (String::new(), String::new());
    }
    let attributes = physics(style);
    let lines =
        attributes.iter().map(|(name, value)| format!("            float {name} = {value:e}\n"));
    (schemas_text(&MATERIAL_SCHEMAS, "        "), lines.collect())
}

/// The schemas of a prim, behind its name.
fn schemas_text(schemas: &[&str], indent: &str) -> String {
    let list: Vec<_> = schemas.iter().map(|schema| format!("\"{schema}\"")).collect();
    format!(" (\n{indent}    prepend apiSchemas = [{}]\n{indent})", list.join(", "))
}

/// The beginning of a prim, up to its points.
pub(super) fn prim_beginning(
    panel: usize,
    bar: usize,
    style: &StrandStyle,
    curves: UsdCurves,
) -> String {
    let number = index32(bar) + 1;
    let [r, g, b] = style.color.linear();
    let width = width(style, curves);
    let schemas = schemas_text(&curves.schemas(), "    ");
    let kind = match curves {
        UsdCurves::Bezier => "        uniform token type = \"cubic\"\n        \
             uniform token basis = \"bezier\"\n"
            .to_owned(),
        UsdCurves::Linear => format!(
            "        rel material:binding:physics = </cloth/looks/bar_{number}>\n        \
             uniform token type = \"linear\"\n        \
             float[] physics:thicknesses = [{width}]\n        \
             uniform token physics:thicknesses:elementType = \"constant\"\n"
        ),
    };
    format!(
        "\n    def BasisCurves \"panel_{panel}_bar_{number}\"{schemas}\n    {{\n        \
         rel material:binding = </cloth/looks/bar_{number}>\n{kind}        \
         uniform token wrap = \"nonperiodic\"\n        \
         float[] widths = [{width}] (interpolation = \"constant\")\n        \
         color3f[] primvars:displayColor = [({r}, {g}, {b})] \
         (interpolation = \"constant\")\n        \
         int primvars:bar = {number}\n"
    )
}

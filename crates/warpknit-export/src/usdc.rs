//! Yarns as a USD crate (`.usdc`): the stage of [`super::usda`] in binary form, which opens at once
//! however large it is. A drape sequence has time samples of points and boxes, as in
//! [`super::usda_frames`].
//!
//! Points go to the file as they come, 12 bytes each. The other arrays wait in spools until the
//! prim's points are there; of a sequence they are the first frame's. Courses, wales, yarns and
//! counts are coded, in about 0.4 bytes a point. A data point of a Bézier curve has three points
//! and its length along the yarn, so it takes 45 bytes; one of a line takes 13, or 25 where its
//! cloth is not at rest.

use std::io::{self, Seek, Write};

use glam::Vec3;

use super::buffer::{Buffer, BufferPool};
use super::crate_file::CrateFile;
use super::crate_ints::WaitingNumbers;
use super::crate_spec::{CrateType, Spec, Value, Word};
use super::spool::Spool;
use super::usd_stage::{
    Array, EMPTY, MATERIAL_SCHEMAS, UsdCurves, blocks_by_prim, course_and_wale, each_span,
    is_at_rest, physics, rest_points, union, widened, width,
};
use super::{ClothInfo, Destination, ExportError, Sink, StrandStyle};
use warpknit_core::drape::Block;
use warpknit_core::drape::strands::Strand;
use warpknit_core::ids::index32;
use warpknit_core::number::narrow;
use warpknit_render::cloth::ROUGHNESS;

/// Writes yarns as USD curves in a crate file.
#[derive(Debug)]
pub struct UsdcWriter<W> {
    file: CrateFile<W>,
    styles: Vec<StrandStyle>,
    curves: UsdCurves,
    /// Frames per second of a sequence.
    frames_per_second: Option<f64>,
    /// Time codes of the frames so far; none where nothing moves.
    codes: Vec<u32>,
    prims: Vec<WrittenPrim>,
    current: Option<Current>,
    waiting: WaitingArrays,
    buffers: BufferPool,
}

/// A prim, as far as it is written.
#[derive(Debug)]
struct WrittenPrim {
    panel: usize,
    bar: usize,
    /// Points and box of each frame.
    frames: Vec<[Word; 2]>,
    /// The other arrays.
    arrays: Vec<(Array, Word)>,
}

/// The prim that is being written.
#[derive(Debug)]
struct Current {
    place: usize,
    /// Where its points begin in the file.
    points_at: u64,
    points: u64,
    /// Lowest and highest point so far, in the stage's units.
    extent: [Vec3; 2],
    is_at_rest: bool,
}

/// The arrays of a prim that wait for its points to end.
#[derive(Debug)]
struct WaitingArrays {
    numbers: [(Array, WaitingNumbers); 4],
    /// Lengths along the yarn of Bézier curves, the rest shape of lines; with how many there are.
    vectors: Spool,
    count: u64,
}

/// What a block's bytes begin with. Arrays follow in this order.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Head {
    /// Bytes of points, vectors, courses, wales, yarns and counts.
    sizes: [u32; 6],
    low: [f32; 3],
    high: [f32; 3],
    is_at_rest: u32,
}

const HEAD: usize = size_of::<Head>();

impl<W: Write + Seek + Send> UsdcWriter<W> {
    /// Starts the file.
    ///
    /// # Errors
    /// [`ExportError::Io`].
    pub fn create(target: Destination<W>, cloth: &ClothInfo<'_>) -> Result<Self, ExportError> {
        let waiting = WaitingArrays::create(&target)?;
        Ok(Self {
            file: CrateFile::create(target)?,
            styles: cloth.strands.clone(),
            curves: cloth.usd_curves,
            frames_per_second: None,
            codes: Vec::new(),
            prims: Vec::new(),
            current: None,
            waiting,
            buffers: BufferPool::default(),
        })
    }

    /// Starts the file of a sequence.
    ///
    /// # Errors
    /// [`ExportError::Io`].
    pub fn create_moving(
        target: Destination<W>,
        cloth: &ClothInfo<'_>,
        frames_per_second: f64,
    ) -> Result<Self, ExportError> {
        let still = Self::create(target, cloth)?;
        Ok(Self { frames_per_second: Some(frames_per_second), ..still })
    }

    /// Begins the frame with this time code, which is higher than the last one's. The blocks to
    /// come are that frame's.
    ///
    /// # Errors
    /// [`ExportError::Io`].
    pub fn begin_frame(&mut self, code: u32) -> Result<(), ExportError> {
        self.end_prim()?;
        self.codes.push(code);
        Ok(())
    }

    /// Whether the other arrays are still to be written.
    fn is_first(&self) -> bool {
        self.codes.len() <= 1
    }

    /// Adds blocks of one bar of one panel.
    fn add(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        self.find_prim(blocks[0].panel, blocks[0].bar)?;
        let (is_first, curves) = (self.is_first(), self.curves);
        let Self { file, current, waiting, buffers, .. } = self;
        let current = current.as_mut().expect("found above");
        buffers.write_each(
            blocks,
            |block, bytes| add_block(block, curves, is_first, bytes),
            |bytes| {
                let (head, arrays) = bytes.split_at(HEAD);
                let head: Head = bytemuck::pod_read_unaligned(head);
                let points = head.sizes[0] as usize;
                current.extent = union(current.extent, [head.low.into(), head.high.into()]);
                current.is_at_rest &= head.is_at_rest != 0;
                current.points += points as u64 / size_of::<Vec3>() as u64;
                file.write(&arrays[..points])?;
                file.name_error(waiting.add(&head, &arrays[points..], curves))
            },
        )
    }

    /// Makes the prim of a panel's bar the current one, with a sample of this frame.
    fn find_prim(&mut self, panel: usize, bar: usize) -> Result<(), ExportError> {
        let place = self.prims.iter().position(|prim| (prim.panel, prim.bar) == (panel, bar));
        if place.is_some() && self.current.as_ref().map(|current| current.place) == place {
            return Ok(());
        }
        self.end_prim()?;
        let place = place.unwrap_or(self.prims.len());
        if place == self.prims.len() {
            self.prims.push(WrittenPrim { panel, bar, frames: Vec::new(), arrays: Vec::new() });
        }
        let points_at = self.file.begin_array()?;
        self.current =
            Some(Current { place, points_at, points: 0, extent: EMPTY, is_at_rest: true });
        Ok(())
    }

    /// Ends the points of the current prim, and writes its other arrays behind them.
    fn end_prim(&mut self) -> Result<(), ExportError> {
        let Some(current) = self.current.take() else { return Ok(()) };
        let is_first = self.is_first();
        let Self { file, prims, waiting, styles, curves, .. } = self;
        let prim = &mut prims[current.place];
        let points = file.end_array(CrateType::Vec3f, current.points_at, current.points)?;
        let extent = widened(current.extent, &styles[prim.bar], *curves);
        prim.frames.push([points, file.floats(CrateType::Vec3f, &extent)?]);
        if is_first {
            prim.arrays = waiting.drain(file, *curves, current.is_at_rest)?;
        }
        Ok(())
    }

    /// What the stage says of itself.
    fn metadata(&self) -> Vec<(&'static str, Value)> {
        let mut fields = vec![
            ("defaultPrim", Value::Token("cloth".to_owned())),
            ("documentation", Value::String("yarns by warpknit".to_owned())),
            ("metersPerUnit", Value::Double(self.curves.metres_per_unit())),
            ("upAxis", Value::Token("Y".to_owned())),
        ];
        if self.curves == UsdCurves::Linear {
            fields.push(("kilogramsPerUnit", Value::Double(1.0)));
        }
        if let Some(speed) = self.frames_per_second {
            let code = |code: Option<&u32>| Value::Double(code.copied().unwrap_or(1).into());
            fields.extend([
                ("startTimeCode", code(self.codes.first())),
                ("endTimeCode", code(self.codes.last())),
                ("timeCodesPerSecond", Value::Double(speed)),
                ("framesPerSecond", Value::Double(speed)),
            ]);
        }
        fields
    }

    /// A prim of curves.
    fn curves_prim(&mut self, prim: &WrittenPrim) -> Result<Spec, ExportError> {
        let Self { file, styles, curves, .. } = self;
        let (style, number) = (&styles[prim.bar], index32(prim.bar) + 1);
        let look = format!("/cloth/looks/bar_{number}");
        let width = width(style, *curves);
        let widths = Value::Array(file.floats(CrateType::Float, &[width])?);
        let color = Value::Array(file.floats(CrateType::Vec3f, &style.color.linear())?);
        let mut children = vec![Spec::relationship("material:binding", look.clone())];
        match curves {
            UsdCurves::Bezier => {
                children.push(Spec::uniform("type", "cubic"));
                children.push(Spec::uniform("basis", "bezier"));
            }
            UsdCurves::Linear => {
                children.push(Spec::relationship("material:binding:physics", look));
                children.push(Spec::uniform("type", "linear"));
                children.push(Spec::attribute(
                    "physics:thicknesses",
                    "float[]",
                    Some(widths.clone()),
                ));
                children.push(Spec::uniform("physics:thicknesses:elementType", "constant"));
            }
        }
        children.extend([
            Spec::uniform("wrap", "nonperiodic"),
            Spec::attribute("widths", "float[]", Some(widths)).interpolated("constant"),
            Spec::attribute("primvars:displayColor", "color3f[]", Some(color))
                .interpolated("constant"),
            Spec::attribute("primvars:bar", "int", Some(Value::Int(number.cast_signed()))),
        ]);
        for (index, (name, type_name)) in
            [("points", "point3f[]"), ("extent", "float3[]")].into_iter().enumerate()
        {
            let value = if self.frames_per_second.is_some() {
                let frames = self.codes.iter().zip(&prim.frames);
                Value::Samples(frames.map(|(code, at)| (f64::from(*code), at[index])).collect())
            } else {
                Value::Array(prim.frames[0][index])
            };
            children.push(Spec::attribute(name, type_name, Some(value)));
        }
        children.extend(prim.arrays.iter().map(|(array, word)| attribute(*array, *word)));
        let name = format!("panel_{}_bar_{number}", prim.panel);
        Ok(Spec::prim(name, "BasisCurves", self.curves.schemas(), children))
    }
}

impl<W: Write + Seek + Send> Sink<W> for UsdcWriter<W> {
    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        blocks_by_prim(blocks).try_for_each(|blocks| self.add(blocks))
    }

    fn finish(mut self: Box<Self>) -> Result<W, ExportError> {
        self.end_prim()?;
        let materials = self.styles.iter().zip(1..);
        let materials = materials.map(|(style, number)| material(style, number, self.curves));
        let mut children = vec![Spec::prim("looks", "Scope", Vec::new(), materials.collect())];
        for prim in std::mem::take(&mut self.prims) {
            children.push(self.curves_prim(&prim)?);
        }
        let cloth = Spec::prim("cloth", "Xform", Vec::new(), children)
            .with("kind", Value::Token("component".to_owned()));
        let root = Spec::root(self.metadata(), vec![cloth]);
        self.file.finish(&root)
    }
}

impl WaitingArrays {
    fn create<W>(target: &Destination<W>) -> Result<Self, ExportError> {
        let numbers = |array, common| {
            let coder = WaitingNumbers::new(common, target.spool()?, target.spool()?);
            Ok::<_, ExportError>((array, coder))
        };
        Ok(Self {
            numbers: [
                numbers(Array::Courses, 0)?,
                numbers(Array::Wales, 0)?,
                numbers(Array::Yarns, 1)?,
                numbers(Array::Counts, 0)?,
            ],
            vectors: target.spool()?,
            count: 0,
        })
    }

    /// Adds a block's arrays.
    fn add(&mut self, head: &Head, arrays: &[u8], curves: UsdCurves) -> io::Result<()> {
        let sizes = head.sizes.map(|size| size as usize);
        let (vectors, mut arrays) = arrays.split_at(sizes[1]);
        self.vectors.write_all(vectors)?;
        self.count += (sizes[1] / vector(curves).2) as u64;
        for ((_, numbers), size) in self.numbers.iter_mut().zip(&sizes[2..]) {
            let (own, rest) = arrays.split_at(*size);
            numbers.add(own)?;
            arrays = rest;
        }
        Ok(())
    }

    /// Writes the arrays and empties them. A rest shape is left out where it is the shape.
    fn drain<W: Write + Seek>(
        &mut self,
        file: &mut CrateFile<W>,
        curves: UsdCurves,
        is_at_rest: bool,
    ) -> Result<Vec<(Array, Word)>, ExportError> {
        let mut written = Vec::new();
        for (array, numbers) in &mut self.numbers {
            let at = file.align()?;
            let is_coded = file.write_with(|file| numbers.drain(file))?;
            written.push((*array, Word::array(CrateType::Int, Some(at), is_coded)));
        }
        let (array, kind, _) = vector(curves);
        if array == Array::Rest && is_at_rest {
            file.name_error(self.vectors.drain(&mut io::sink()))?;
        } else {
            let at = file.begin_array()?;
            file.write_with(|mut file| {
                let bytes = self.vectors.length();
                self.vectors.drain(&mut file).map(|()| (bytes, false))
            })?;
            written.push((array, file.end_array(kind, at, self.count)?));
        }
        self.count = 0;
        Ok(written)
    }
}

/// The array of vectors beside the points, with its kind and the bytes of a vector.
fn vector(curves: UsdCurves) -> (Array, CrateType, usize) {
    match curves {
        UsdCurves::Bezier => (Array::Lengths, CrateType::Vec2f, size_of::<[f32; 2]>()),
        UsdCurves::Linear => (Array::Rest, CrateType::Vec3f, size_of::<Vec3>()),
    }
}

/// The attribute of an array.
fn attribute(array: Array, at: Word) -> Spec {
    let (type_name, name, interpolation) = array.declaration();
    let attribute = Spec::attribute(name, type_name, Some(Value::Array(at)));
    match interpolation {
        Some(interpolation) => attribute.interpolated(interpolation),
        None => attribute,
    }
}

/// Puts a block's bytes into an empty buffer: a [`Head`] and the arrays. `is_first` tells whether
/// more than the points are wanted.
fn add_block(block: &Block, curves: UsdCurves, is_first: bool, bytes: &mut Buffer) {
    let mut head = Head {
        sizes: [0; 6],
        low: EMPTY[0].to_array(),
        high: EMPTY[1].to_array(),
        is_at_rest: u32::from(curves == UsdCurves::Linear && is_at_rest(block)),
    };
    bytes.grow(HEAD);
    let strands = &block.strands.strands;
    let [mut low, mut high] = EMPTY;
    let points: u32 = strands.iter().map(|strand| curves.count(data_points(strand))).sum();
    let data: u32 = strands.iter().map(data_points).sum();
    head.sizes[0] = points * 12;
    // Points and the vectors beside them come from the same spans, so they are made together. The
    // bytes of both are there before they are overwritten.
    let vectors = if is_first { data * index32(vector(curves).2) } else { 0 };
    head.sizes[1] = vectors;
    let both = bytes.grow((head.sizes[0] + vectors) as usize);
    let (points, vectors) = both.split_at_mut(head.sizes[0] as usize);
    let (mut points, mut vectors) =
        (points.as_chunks_mut::<12>().0.iter_mut(), vectors.as_chunks_mut::<4>().0.iter_mut());
    let mut take = |point: Vec3| {
        (low, high) = (low.min(point), high.max(point));
        let place = points.next().expect("they were counted above");
        place.copy_from_slice(bytemuck::bytes_of(&point));
    };
    for strand in strands {
        let mut length = 0.0;
        each_span(block, strand, curves, &mut take, |of_span| {
            if is_first {
                for number in [0.0, narrow(length)] {
                    *vectors.next().expect("they were counted above") = number.to_le_bytes();
                }
                length += of_span.map_or(0.0, |span| span.length());
            }
        });
        if is_first && curves == UsdCurves::Linear {
            let numbers = rest_points(block, strand).flat_map(|point| point.to_array());
            for (place, number) in vectors.by_ref().zip(numbers) {
                *place = number.to_le_bytes();
            }
        }
    }
    (head.low, head.high) = (low.to_array(), high.to_array());
    if is_first {
        for which in 0..2 {
            head.sizes[2 + which] = 4 * data;
            for strand in strands {
                for at in strand.range() {
                    let number = course_and_wale(block, at)[which];
                    bytes.grow(4).copy_from_slice(&number.to_le_bytes());
                }
            }
        }
        (head.sizes[4], head.sizes[5]) = (4 * index32(strands.len()), 4 * index32(strands.len()));
        for strand in strands {
            bytes.grow(4).copy_from_slice(&strand.yarn.0.to_le_bytes());
        }
        for strand in strands {
            bytes.grow(4).copy_from_slice(&curves.count(data_points(strand)).to_le_bytes());
        }
    }
    bytes.start(HEAD).copy_from_slice(bytemuck::bytes_of(&head));
}

fn data_points(strand: &Strand) -> u32 {
    strand.points.end - strand.points.start
}

/// A bar's material: how it looks, and for simulation what it is made of.
fn material(style: &StrandStyle, number: u32, curves: UsdCurves) -> Spec {
    let preview = format!("/cloth/looks/bar_{number}/preview.outputs:surface");
    let shader = Spec::prim(
        "preview",
        "Shader",
        Vec::new(),
        vec![
            Spec::uniform("info:id", "UsdPreviewSurface"),
            Spec::attribute(
                "inputs:diffuseColor",
                "color3f",
                Some(Value::Vec3f(style.color.linear())),
            ),
            Spec::attribute("inputs:roughness", "float", Some(Value::Float(ROUGHNESS))),
            Spec::attribute("outputs:surface", "token", None),
        ],
    );
    let mut children = vec![
        Spec::attribute("outputs:surface", "token", None)
            .with("connectionPaths", Value::Paths(vec![preview])),
    ];
    let mut schemas = Vec::new();
    if curves == UsdCurves::Linear {
        schemas.extend(MATERIAL_SCHEMAS);
        children.extend(
            physics(style)
                .map(|(name, value)| Spec::attribute(name, "float", Some(Value::Float(value)))),
        );
    }
    children.push(shader);
    Spec::prim(format!("bar_{number}"), "Material", schemas, children)
}

//! Tubes as Wavefront OBJ: one object a strand, with texture coordinates and normals, mm.

use std::fmt::Write as _;
use std::io::Write as _;
use std::ops::Range;
use std::path::Path;

use rayon::prelude::*;

use super::{ExportError, Output, Sink};
use crate::drape::Block;

/// Writes tubes as text.
#[derive(Debug)]
pub struct ObjWriter {
    output: Output,
    /// Vertices written so far.
    vertices: usize,
}

impl ObjWriter {
    /// Starts the file.
    ///
    /// # Errors
    /// What the disk says.
    pub fn create(target: &Path) -> Result<Self, ExportError> {
        let mut output = Output::create(target)?;
        output.write_with(|file| file.write_all(b"# yarns by warpknit, mm\n"))?;
        Ok(Self { output, vertices: 0 })
    }
}

impl Sink for ObjWriter {
    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        let firsts = blocks.iter().scan(self.vertices, |next, block| {
            let first = *next;
            *next += block.tubes.positions.len();
            Some(first)
        });
        let numbered: Vec<_> = blocks.iter().zip(firsts).collect();
        let texts: Vec<String> = numbered.into_par_iter().map(|(block, first)| objects(block, first)).collect();
        self.vertices += blocks.iter().map(|block| block.tubes.positions.len()).sum::<usize>();
        self.output.write_with(|file| texts.iter().try_for_each(|text| file.write_all(text.as_bytes())))
    }

    fn finish(self: Box<Self>) -> Result<Output, ExportError> {
        self.output.seal()
    }
}

/// The objects of a block whose first vertex is the file's `first`, counted from 0.
fn objects(block: &Block, first: usize) -> String {
    let mut text = String::with_capacity(100 * block.tubes.positions.len());
    for (strand, tube) in block.strands.strands.iter().zip(&block.tubes.strands) {
        let (panel, bar, yarn) = (block.panel, block.bar + 1, strand.yarn.0);
        writeln!(text, "o panel{panel}_bar{bar}_yarn{yarn}").expect("a String takes all text");
        object(block, tube, first, &mut text).expect("a String takes all text");
    }
    text
}

fn object(block: &Block, (vertices, triangles): &(Range<u32>, Range<u32>), first: usize, text: &mut String) -> std::fmt::Result {
    let tubes = &block.tubes;
    let vertices = vertices.start as usize..vertices.end as usize;
    for p in &tubes.positions[vertices.clone()] {
        writeln!(text, "v {} {} {}", p.x, p.y, p.z)?;
    }
    for uv in &tubes.uvs[vertices.clone()] {
        writeln!(text, "vt {} {}", uv.x, uv.y)?;
    }
    for n in &tubes.normals[vertices] {
        writeln!(text, "vn {} {} {}", n.x, n.y, n.z)?;
    }
    for t in &tubes.triangles[triangles.start as usize..triangles.end as usize] {
        let [a, b, c] = t.map(|v| v as usize + first + 1);
        writeln!(text, "f {a}/{a}/{a} {b}/{b}/{b} {c}/{c}/{c}")?;
    }
    Ok(())
}

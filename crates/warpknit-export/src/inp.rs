//! Yarns as Abaqus input (Dassault Systèmes, "Abaqus Keywords Guide"): two-node beams (B31) along
//! the centre lines, a section and a material a bar, contact pairs between the bars; mm, tonnes, N,
//! MPa.
//!
//! Each bar of each panel has an element set, such as `PANEL_0_BAR_1`. A fabric knows nothing of
//! Young's modulus and friction: the file holds values to be replaced, with a comment. Density is
//! that of the yarn, fibre and air together. The file is written in one pass. Nodes come first.
//! Elements follow from the strands' numbers of nodes, 4 bytes a strand, and are made at the end.

use std::fmt::Write as _;
use std::io::{Seek, Write};

use super::buffer::{Buffer, Conveyor};
use super::digits::numbers;
use super::{ClothInfo, Destination, ExportError, Sink, StrandStyle, lines};
use warpknit_core::drape::Block;

/// Young's modulus, MPa, and Poisson's ratio: of soft fibres, for a first run.
const ELASTIC: (f64, f64) = (1000.0, 0.3);
const FRICTION: f64 = 0.3;
/// Tonnes per mm³ in a g/cm³.
const DENSITY: f64 = 1e-9;
/// The first axis of a beam's section. A round section may have any but the beam's own direction,
/// and along this one no yarn runs.
const FIRST_AXIS: &str = "0.3713, 0.5571, 0.7428";
/// Strands whose elements are made at a time by one thread.
const STRANDS: usize = 64;

/// The elements of one bar of a panel.
#[derive(Debug)]
struct ElementSet {
    panel: usize,
    bar: usize,
    /// Nodes of each strand.
    strands: Vec<u32>,
}

/// Some strands with the numbers of their first node and their first element.
struct NumberedStrands<'a> {
    /// Nodes of each strand.
    strands: &'a [u32],
    node: u64,
    element: u64,
}

/// Writes beams as Abaqus input.
#[derive(Debug)]
pub struct InpWriter<W> {
    target: Destination<W>,
    st: u32,
    styles: Vec<StrandStyle>,
    sets: Vec<ElementSet>,
    /// Nodes so far.
    nodes: u64,
    conveyor: Conveyor,
}

impl<W: Write + Seek + Send> InpWriter<W> {
    /// Starts the file of the cloth's strands, with as many beams a stitch as tubes have segments.
    ///
    /// # Errors
    /// [`ExportError::Io`].
    pub fn create(mut target: Destination<W>, cloth: &ClothInfo<'_>) -> Result<Self, ExportError> {
        let name = &cloth.name;
        target.write_with(|file| {
            writeln!(
                file,
                "*HEADING\nyarns of {name} by warpknit; mm, tonnes, N, MPa\n*NODE, NSET=YARNS"
            )
        })?;
        Ok(Self {
            target,
            st: cloth.section.st,
            styles: cloth.strands.clone(),
            sets: Vec::new(),
            nodes: 0,
            conveyor: Conveyor::default(),
        })
    }

    /// Writes the elements of all sets, each set under its name.
    fn write_elements(&mut self) -> Result<(), ExportError> {
        let Self { target, sets, conveyor, .. } = self;
        let (mut node, mut element) = (1, 1);
        for set in sets {
            let name = set.name();
            target.write_with(|file| writeln!(file, "*ELEMENT, TYPE=B31, ELSET={name}"))?;
            let mut numbered = Vec::new();
            for strands in set.strands.chunks(STRANDS) {
                numbered.push(NumberedStrands { strands, node, element });
                for &nodes in strands {
                    node += u64::from(nodes);
                    element += u64::from(nodes) - 1;
                }
            }
            conveyor.carry(&numbered, add_elements, |text| target.write(text))?;
        }
        Ok(())
    }

    /// Sections and materials.
    fn materials(&self) -> String {
        let mut text = String::new();
        for set in &self.sets {
            let (name, number) = (set.name(), set.bar + 1);
            let radius = self.styles[set.bar].radius_f32();
            text += &format!(
                "*BEAM SECTION, ELSET={name}, MATERIAL=YARN_{number}, SECTION=CIRC\n\
                 {radius}\n{FIRST_AXIS}\n"
            );
        }
        for (style, number) in self.styles.iter().zip(1..) {
            let density = style.density * DENSITY;
            let (young, poisson) = ELASTIC;
            text += &format!(
                "*MATERIAL, NAME=YARN_{number}\n*DENSITY\n{density:e}\n\
                 ** A fabric file does not know Young's modulus and Poisson's ratio: \
                 put your yarn's here.\n\
                 *ELASTIC\n{young:?}, {poisson:?}\n"
            );
        }
        text
    }

    /// Contact: a surface a bar, and a pair for each two bars and for each bar with itself.
    fn contact(&self) -> String {
        let mut text = String::new();
        let laid: Vec<usize> = (0..self.styles.len())
            .filter(|bar| self.sets.iter().any(|set| set.bar == *bar))
            .collect();
        for bar in &laid {
            text += &format!("*SURFACE, TYPE=ELEMENT, NAME=SURFACE_{}\n", bar + 1);
            for set in self.sets.iter().filter(|set| set.bar == *bar) {
                text += &format!("{},\n", set.name());
            }
        }
        text += "*SURFACE INTERACTION, NAME=YARN_ON_YARN\n** Friction is not known either.\n";
        text += &format!("*FRICTION\n{FRICTION:?}\n");
        for (at, bar) in laid.iter().enumerate() {
            for other in &laid[at..] {
                let (number, other) = (bar + 1, other + 1);
                text += &format!(
                    "*CONTACT PAIR, INTERACTION=YARN_ON_YARN\n\
                     SURFACE_{number}, SURFACE_{other}\n"
                );
            }
        }
        text
    }
}

impl<W: Write + Seek + Send> Sink<W> for InpWriter<W> {
    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        let Self { target, st, sets, nodes, conveyor, .. } = self;
        let mut numbered = Vec::new();
        for block in blocks.iter().filter(|block| !block.strands.strands.is_empty()) {
            let (panel, bar) = (block.panel, block.bar);
            if sets.last().is_none_or(|set| (set.panel, set.bar) != (panel, bar)) {
                sets.push(ElementSet { panel, bar, strands: Vec::new() });
            }
            // The format counts from 1.
            numbered.push((block, *nodes + 1));
            *nodes += lines::count_all(block, *st);
            let counts = block.strands.strands.iter().map(|strand| lines::count(strand, *st));
            sets.last_mut().expect("pushed above").strands.extend(counts);
        }
        conveyor.carry(
            &numbered,
            |(block, first), text| add_nodes(block, *st, *first, text),
            |text| target.write(text),
        )
    }

    fn finish(mut self: Box<Self>) -> Result<W, ExportError> {
        self.write_elements()?;
        let properties = self.materials() + &self.contact();
        self.target.write(properties.as_bytes())?;
        self.target.finish()
    }
}

impl ElementSet {
    fn name(&self) -> String {
        format!("PANEL_{}_BAR_{}", self.panel, self.bar + 1)
    }
}

/// A line a node, the first with this number.
fn add_nodes(block: &Block, st: u32, mut number: u64, text: &mut Buffer) {
    lines::each(block, st, |line| {
        for point in line {
            write!(text, "{number},").expect("memory takes all text");
            numbers(text, point.to_array(), b',');
            text.write_char('\n').expect("memory takes all text");
            number += 1;
        }
    });
}

/// A line an element: its number, and its two nodes.
fn add_elements(numbered: &NumberedStrands<'_>, text: &mut Buffer) {
    let NumberedStrands { strands, mut node, mut element } = *numbered;
    for &nodes in strands {
        for _ in 1..nodes {
            writeln!(text, "{element},{node},{}", node + 1).expect("memory takes all text");
            node += 1;
            element += 1;
        }
        // The next strand begins with a node of its own.
        node += 1;
    }
}

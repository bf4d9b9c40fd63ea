//! Yarns as finite elements: beams along the centre lines, sections and a material a bar; mm,
//! tonnes, N, MPa. Keywords are those of CalculiX (Dhondt, "CalculiX CrunchiX User's Manual") or of
//! Abaqus (Dassault Systèmes, "Abaqus Keywords Guide").
//!
//! Beams have two nodes (B31).
//!
//! - CalculiX has no round ones, so the section is the square of the same area, 5 % stiffer in
//!   bending. (Its round beams have three nodes, and turn inside out in narrow bends.) The file ends
//!   with a step that runs as it is: yarns hang in their own weight, clamped at their ends. One
//!   attempt at its contact diverged, so there is none.
//! - Abaqus gets round beams, and contact pairs between the bars.
//!
//! Each bar of each panel has an element set, such as `PANEL_0_BAR_1`, and in it a set for each
//! first axis of a section: that axis of x, y and z from which the beam leans most, so no beam runs
//! along it. Young's modulus is that of the yarn's fibres in its section. Friction is not known:
//! the file holds a value to be replaced, with a comment. The file is written in one pass. Nodes
//! come first. Elements follow from the strands' numbers of nodes, 4 bytes a strand and one a beam,
//! and are made at the end.

use std::fmt::Write as _;
use std::io::{Seek, Write};

use super::buffer::{Buffer, BufferPool};
use super::digits::numbers;
use super::{ClothInfo, Destination, ExportError, Sink, StrandStyle, lines};
use glam::Vec3;
use warpknit_core::drape::Block;
use warpknit_core::number::narrow;

const POISSON: f64 = 0.3;
/// MPa in a GPa.
const MPA: f64 = 1e3;
/// Gravity, mm/s².
const GRAVITY: f64 = 9810.0;
const FRICTION: f64 = 0.3;
/// Tonnes per mm³ in a g/cm³.
const DENSITY: f64 = 1e-9;
/// The first axes of sections, with the names of their sets.
const AXES: [(&str, &str); 3] = [("X", "1.,0.,0."), ("Y", "0.,1.,0."), ("Z", "0.,0.,1.")];
/// Numbers on a line of a set.
const ON_A_LINE: usize = 16;
/// Strands whose elements are made at a time by one thread.
const STRANDS: usize = 64;

/// Whose keywords an `.inp` has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum InpDialect {
    /// CalculiX: with a step that runs.
    #[default]
    Calculix,
    /// Abaqus: with contact pairs.
    Abaqus,
}

/// The elements of one bar of a panel.
#[derive(Debug)]
struct ElementSet {
    panel: usize,
    bar: usize,
    /// Nodes of each strand.
    strands: Vec<u32>,
    /// The section's first axis of each beam, in [`AXES`].
    axes: Vec<u8>,
}

/// Some strands with the numbers of their first node and their first element.
struct NumberedStrands<'a> {
    /// Nodes of each strand.
    strands: &'a [u32],
    node: u64,
    element: u64,
}

/// Writes beams.
#[derive(Debug)]
pub struct InpWriter<W> {
    target: Destination<W>,
    st: u32,
    dialect: InpDialect,
    styles: Vec<StrandStyle>,
    sets: Vec<ElementSet>,
    /// Nodes so far.
    nodes: u64,
    buffers: BufferPool,
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
            dialect: cloth.inp,
            styles: cloth.strands.clone(),
            sets: Vec::new(),
            nodes: 0,
            buffers: BufferPool::default(),
        })
    }

    /// Writes the elements of all sets, each set under its name.
    fn write_elements(&mut self) -> Result<(), ExportError> {
        let Self { target, sets, buffers, .. } = self;
        let (mut node, mut element) = (1, 1);
        let mut ends = String::new();
        for set in sets {
            let (name, first) = (set.name(), element);
            target.write_with(|file| writeln!(file, "*ELEMENT, TYPE=B31, ELSET={name}"))?;
            let mut numbered = Vec::new();
            for strands in set.strands.chunks(STRANDS) {
                numbered.push(NumberedStrands { strands, node, element });
                for &nodes in strands {
                    ends += &format!("{node},{}\n", node + u64::from(nodes) - 1);
                    node += u64::from(nodes);
                    element += u64::from(nodes) - 1;
                }
            }
            buffers.write_each(&numbered, add_elements, |text| target.write(text))?;
            target.write(set.axis_sets(first).as_bytes())?;
        }
        target.write_with(|file| write!(file, "*NSET, NSET=ENDS\n{ends}"))
    }

    /// Sections and materials.
    fn materials(&self) -> String {
        let mut text = String::new();
        for set in &self.sets {
            let (name, number) = (set.name(), set.bar + 1);
            let radius = self.styles[set.bar].radius;
            let section = match self.dialect {
                // The square of the circle's area.
                InpDialect::Calculix => {
                    let side = narrow(radius * std::f64::consts::PI.sqrt());
                    format!("RECT\n{side},{side}")
                }
                InpDialect::Abaqus => format!("CIRC\n{}", narrow(radius)),
            };
            for (_, (axis, vector)) in set.used_axes() {
                text += &format!(
                    "*BEAM SECTION, ELSET={name}_{axis}, MATERIAL=YARN_{number}, SECTION={section}\n\
                     {vector}\n"
                );
            }
        }
        for (style, number) in self.styles.iter().zip(1..) {
            let density = style.density * DENSITY;
            let young = style.modulus * style.packing * MPA;
            text += &format!(
                "*MATERIAL, NAME=YARN_{number}\n*DENSITY\n{density:e}\n\
                 ** Young's modulus is that of the fibres, by the yarn's modulus or density in the \
                 fabric file: put your yarn's here.\n\
                 *ELASTIC\n{young:?}, {POISSON:?}\n"
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
                    "*CONTACT PAIR, INTERACTION=YARN_ON_YARN, TYPE=NODE TO SURFACE\n\
                     SURFACE_{number}, SURFACE_{other}\n"
                );
            }
        }
        text
    }
}

/// A step of CalculiX: all yarns in their own weight, clamped at their ends.
fn step(sets: &[ElementSet]) -> String {
    let loads = sets.iter().map(|set| format!("{},GRAV,{GRAVITY:?},0.,-1.,0.\n", set.name()));
    format!(
        "*STEP\n*STATIC\n*BOUNDARY\nENDS,1,6\n*DLOAD\n{}*NODE FILE\nU\n*END STEP\n",
        loads.collect::<String>()
    )
}

impl<W: Write + Seek + Send> Sink<W> for InpWriter<W> {
    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        let Self { target, st, sets, nodes, buffers, .. } = self;
        let mut numbered = Vec::new();
        for block in blocks.iter().filter(|block| !block.strands.strands.is_empty()) {
            let (panel, bar) = (block.panel, block.bar);
            if sets.last().is_none_or(|set| (set.panel, set.bar) != (panel, bar)) {
                sets.push(ElementSet { panel, bar, strands: Vec::new(), axes: Vec::new() });
            }
            // The format counts from 1.
            numbered.push((block, *nodes + 1));
            *nodes += lines::count_all(block, *st);
            let counts = block.strands.strands.iter().map(|strand| lines::count(strand, *st));
            let set = sets.last_mut().expect("pushed above");
            set.strands.extend(counts);
            lines::each(block, *st, |line| set.axes.extend(line.windows(2).map(first_axis)));
        }
        buffers.write_each(
            &numbered,
            |(block, first), text| add_nodes(block, *st, *first, text),
            |text| target.write(text),
        )
    }

    fn finish(mut self: Box<Self>) -> Result<W, ExportError> {
        self.write_elements()?;
        let properties = self.materials()
            + &match self.dialect {
                InpDialect::Calculix => step(&self.sets),
                InpDialect::Abaqus => self.contact(),
            };
        self.target.write(properties.as_bytes())?;
        self.target.finish()
    }
}

impl ElementSet {
    fn name(&self) -> String {
        format!("PANEL_{}_BAR_{}", self.panel, self.bar + 1)
    }

    /// The first axes that its beams have.
    fn used_axes(&self) -> impl Iterator<Item = (u8, (&'static str, &'static str))> {
        (0..).zip(AXES).filter(|(axis, _)| self.axes.contains(axis))
    }

    /// A set of elements for each first axis, where the first element has this number.
    fn axis_sets(&self, first: u64) -> String {
        let mut text = String::new();
        for (axis, (name, _)) in self.used_axes() {
            text += &format!("*ELSET, ELSET={}_{name}\n", self.name());
            let own = (first..).zip(&self.axes).filter(|(_, own)| **own == axis);
            for (index, (element, _)) in own.enumerate() {
                if index > 0 {
                    text += if index % ON_A_LINE == 0 { ",\n" } else { "," };
                }
                text += &element.to_string();
            }
            text += "\n";
        }
        text
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

/// The axis from which a beam leans most.
fn first_axis(nodes: &[Vec3]) -> u8 {
    let along = (nodes[nodes.len() - 1] - nodes[0]).abs();
    let [x, y, z] = along.to_array();
    if x <= y && x <= z {
        0
    } else if y <= z {
        1
    } else {
        2
    }
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

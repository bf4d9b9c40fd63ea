//! Yarns as Abaqus input: two-node beams (B31) along the centre lines, a section and a material a
//! bar, contact pairs between the bars; mm, tonnes, N, MPa.
//!
//! An element set a bar of a panel, `PANEL_0_BAR_1`. What a fabric does not say stands in the file
//! as a value to be replaced, with a comment: Young's modulus and friction. Density is that of the
//! yarn, fibre and air. One pass: nodes come first, and the elements follow from the strands'
//! lengths, 4 bytes a strand.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use super::buffer::{Buffer, Conveyor};
use super::digits::numbers;
use super::{ExportError, Output, Sink, lines};
use warpknit_core::drape::Block;
use warpknit_core::fabric::Fabric;
use warpknit_core::fabric::yarn::Yarn;
use warpknit_core::yarn::tube::Section;

/// MPa, and Poisson's ratio: of soft fibres, for a first run.
const ELASTIC: (f64, f64) = (1000.0, 0.3);
const FRICTION: f64 = 0.3;
/// Tonnes per mm³ in a g/cm³.
const DENSITY: f64 = 1e-9;
/// A direction along which no yarn runs: the first axis of each beam's section must not be the
/// beam's own, and of a round section it is no matter which.
const FIRST_AXIS: &str = "0.3713, 0.5571, 0.7428";
/// Strands whose elements are made at a time by one thread.
const STRANDS: usize = 64;

/// Strands of one bar of a panel.
#[derive(Debug)]
struct Group {
    panel: usize,
    bar: usize,
    /// Nodes of each.
    strands: Vec<u32>,
}

/// Writes beams as Abaqus input.
#[derive(Debug)]
pub struct InpWriter {
    output: Output,
    st: u32,
    yarns: Vec<Yarn>,
    radii: Vec<f32>,
    groups: Vec<Group>,
    /// Nodes so far.
    nodes: u64,
    conveyor: Conveyor,
}

impl InpWriter {
    /// Starts the file of a fabric's yarns, as thick and with as many segments a stitch as their
    /// tubes.
    ///
    /// # Errors
    /// What the disk says.
    pub fn create(target: &Path, fabric: &Fabric, section: &Section) -> Result<Self, ExportError> {
        let mut output = Output::create(target)?;
        let name = &fabric.name;
        output.write_with(|file| {
            writeln!(
                file,
                "*HEADING\nyarns of {name} by warpknit; mm, tonnes, N, MPa\n*NODE, NSET=YARNS"
            )
        })?;
        let radii = super::radii(fabric, section);
        let (groups, conveyor) = (Vec::new(), Conveyor::default());
        Ok(Self {
            output,
            st: section.st,
            yarns: fabric.yarns().cloned().collect(),
            radii,
            groups,
            nodes: 0,
            conveyor,
        })
    }

    /// Elements of all groups, each under its set's name.
    fn write_elements(&mut self) -> Result<(), ExportError> {
        let Self { output, groups, conveyor, .. } = self;
        let (mut node, mut element) = (1, 1);
        for group in groups {
            let name = set(group.panel, group.bar);
            output.write_with(|file| writeln!(file, "*ELEMENT, TYPE=B31, ELSET={name}"))?;
            let number = |strands| {
                let first = (strands, node, element);
                for &nodes in strands {
                    node += u64::from(nodes);
                    element += u64::from(nodes) - 1;
                }
                first
            };
            let numbered: Vec<_> = group.strands.chunks(STRANDS).map(number).collect();
            let make = |(strands, node, element): &(&[u32], u64, u64), text: &mut Buffer| {
                elements(strands, *node, *element, text);
            };
            conveyor
                .carry(&numbered, make, |text| output.write_with(|file| file.write_all(text)))?;
        }
        Ok(())
    }

    /// Sections, materials and contact.
    fn properties(&self) -> String {
        let mut text = String::new();
        let mut add = |line: &str| {
            text.push_str(line);
            text.push('\n');
        };
        for Group { panel, bar, .. } in &self.groups {
            add(&format!(
                "*BEAM SECTION, ELSET={}, MATERIAL=YARN_{}, SECTION=CIRC",
                set(*panel, *bar),
                bar + 1
            ));
            add(&format!("{}\n{FIRST_AXIS}", self.radii[*bar]));
        }
        for (yarn, number) in self.yarns.iter().zip(1..) {
            add(&format!("*MATERIAL, NAME=YARN_{number}"));
            add(&format!("*DENSITY\n{:e}", yarn.density * yarn.packing * DENSITY));
            add(
                "** A fabric file does not know Young's modulus and Poisson's ratio: put your yarn's here.",
            );
            add(&format!("*ELASTIC\n{:?}, {:?}", ELASTIC.0, ELASTIC.1));
        }
        let laid: Vec<usize> = (0..self.yarns.len())
            .filter(|bar| self.groups.iter().any(|group| group.bar == *bar))
            .collect();
        for bar in &laid {
            add(&format!("*SURFACE, TYPE=ELEMENT, NAME=SURFACE_{}", bar + 1));
            self.groups
                .iter()
                .filter(|group| group.bar == *bar)
                .for_each(|group| add(&format!("{},", set(group.panel, *bar))));
        }
        add("*SURFACE INTERACTION, NAME=YARN_ON_YARN");
        add("** Friction is not known either.");
        add(&format!("*FRICTION\n{FRICTION:?}"));
        for (at, bar) in laid.iter().enumerate() {
            for other in &laid[at..] {
                add(&format!(
                    "*CONTACT PAIR, INTERACTION=YARN_ON_YARN\nSURFACE_{}, SURFACE_{}",
                    bar + 1,
                    other + 1
                ));
            }
        }
        text
    }
}

impl Sink for InpWriter {
    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        let Self { output, st, groups, nodes, conveyor, .. } = self;
        let mut numbered = Vec::new();
        for block in blocks.iter().filter(|block| !block.strands.strands.is_empty()) {
            if groups
                .last()
                .is_none_or(|group| (group.panel, group.bar) != (block.panel, block.bar))
            {
                groups.push(Group { panel: block.panel, bar: block.bar, strands: Vec::new() });
            }
            numbered.push((block, *nodes + 1));
            let counts = block.strands.strands.iter().map(|strand| lines::count(strand, *st));
            *nodes += counts.clone().map(u64::from).sum::<u64>();
            groups.last_mut().expect("pushed above").strands.extend(counts);
        }
        let make =
            |(block, first): &(&Block, u64), text: &mut Buffer| add_nodes(block, *st, *first, text);
        conveyor.carry(&numbered, make, |text| output.write_with(|file| file.write_all(text)))
    }

    fn finish(mut self: Box<Self>) -> Result<Vec<Output>, ExportError> {
        self.write_elements()?;
        let properties = self.properties();
        self.output.write_with(|file| file.write_all(properties.as_bytes()))?;
        Ok(vec![self.output.seal()?])
    }
}

/// The set of a panel's bar.
fn set(panel: usize, bar: usize) -> String {
    format!("PANEL_{panel}_BAR_{}", bar + 1)
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
fn elements(strands: &[u32], mut node: u64, mut element: u64, text: &mut Buffer) {
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

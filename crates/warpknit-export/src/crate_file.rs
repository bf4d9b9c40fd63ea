//! The container of a USD crate file (`.usdc`, version 0.8.0; OpenUSD 24.08,
//! `pxr/usd/usd/crateFile.cpp`).
//!
//! In: arrays as they come, and at the end the [`Spec`]s of the stage. Out: the file. Arrays go
//! straight into it, and their counts are put in front of them afterwards. Names, paths and fields
//! follow in sections behind them, then a table of contents, and its place is put into the header.
//! So memory grows with the prims and not with the points.
//!
//! Version 0.8.0 is what usd-core writes today; from older ones it warns that it will drop them.

use std::collections::HashMap;
use std::io::{self, Seek, Write};

use super::crate_ints::{block, numbers_block};
use super::crate_spec::{CrateType, INLINED, Spec, SpecKind, Value, Word};
use super::patched_header::PatchedHeader;
use super::{Destination, ExportError};
use warpknit_core::ids::index32;

/// Bytes of the header.
const HEADER: usize = 88;
const VERSION: [u8; 3] = [0, 8, 0];
/// Large arrays are read in place where they are aligned so.
const ALIGNED: u64 = 8;
/// Ends a set of fields.
const END_OF_SET: u32 = u32::MAX;

/// Names and numbers of the file's sections.
#[derive(Debug)]
struct Tables {
    tokens: Vec<String>,
    token_places: HashMap<String, u32>,
    /// Tokens that are strings.
    strings: Vec<u32>,
    /// Names and values, each pair once.
    fields: Vec<(u32, Word)>,
    field_places: HashMap<(u32, Word), u32>,
    sets: Vec<u32>,
    /// Numbers of paths, in the order in which specs are walked.
    paths: HashMap<String, u32>,
    /// Element and jump of each path.
    elements: Vec<(i32, i32)>,
    /// First entry of its set and kind of each spec; its path has its own number.
    specs: Vec<(u32, u32)>,
}

impl Tables {
    fn new() -> Self {
        let mut tables = Self {
            tokens: Vec::new(),
            token_places: HashMap::new(),
            strings: Vec::new(),
            fields: Vec::new(),
            field_places: HashMap::new(),
            sets: Vec::new(),
            paths: HashMap::new(),
            elements: Vec::new(),
            specs: Vec::new(),
        };
        // A property's token is stored negated, so none may have the number 0.
        tables.token("");
        tables
    }

    fn token(&mut self, text: &str) -> u32 {
        if let Some(&place) = self.token_places.get(text) {
            return place;
        }
        let place = index32(self.tokens.len());
        self.tokens.push(text.to_owned());
        self.token_places.insert(text.to_owned(), place);
        place
    }

    fn string(&mut self, text: &str) -> u32 {
        let token = self.token(text);
        let place = self.strings.iter().position(|string| *string == token);
        index32(place.unwrap_or_else(|| {
            self.strings.push(token);
            self.strings.len() - 1
        }))
    }

    /// Numbers a spec and what it contains, depth first.
    fn number(&mut self, spec: &Spec, path: String, has_sibling: bool) {
        let own = self.elements.len();
        let token = self.token(&spec.name).cast_signed();
        self.elements.push((if spec.is_property() { -token } else { token }, 0));
        for (index, child) in spec.children.iter().enumerate() {
            let is_last = index + 1 == spec.children.len();
            self.number(child, Spec::child_path(&path, child), !is_last);
        }
        self.paths.insert(path, index32(own));
        let beyond = index32(self.elements.len() - own).cast_signed();
        self.elements[own].1 = match (spec.children.is_empty(), has_sibling) {
            (true, false) => -2,
            (false, false) => -1,
            (true, true) => 0,
            (false, true) => beyond,
        };
    }

    fn end_set(&mut self, fields: &[(u32, Word)], kind: SpecKind) {
        self.specs.push((index32(self.sets.len()), kind as u32));
        for field in fields {
            let next = index32(self.fields.len());
            let place = *self.field_places.entry(*field).or_insert(next);
            if place == next {
                self.fields.push(*field);
            }
            self.sets.push(place);
        }
        self.sets.push(END_OF_SET);
    }
}

/// A crate file that is being written.
#[derive(Debug)]
pub(super) struct CrateFile<W> {
    file: PatchedHeader<W>,
    /// Bytes so far, with the header.
    length: u64,
}

impl<W: Write + Seek> CrateFile<W> {
    /// Starts the file.
    pub(super) fn create(target: Destination<W>) -> Result<Self, ExportError> {
        let file = PatchedHeader::create(target, Some(HEADER))?;
        Ok(Self { file, length: HEADER as u64 })
    }

    /// Appends bytes.
    pub(super) fn write(&mut self, bytes: &[u8]) -> Result<(), ExportError> {
        self.length += bytes.len() as u64;
        self.file.write(bytes)
    }

    /// Appends what `write` writes. It returns its number of bytes, and something for the caller.
    pub(super) fn write_with<T>(
        &mut self,
        write: impl FnOnce(&mut dyn Write) -> io::Result<(u64, T)>,
    ) -> Result<T, ExportError> {
        let (bytes, result) = self.file.write_with(write)?;
        self.length += bytes;
        Ok(result)
    }

    /// The result with the target's name in its error.
    pub(super) fn name_error<T>(&self, result: io::Result<T>) -> Result<T, ExportError> {
        self.file.name_error(result)
    }

    /// Where the next array begins.
    pub(super) fn align(&mut self) -> Result<u64, ExportError> {
        while !self.length.is_multiple_of(ALIGNED) {
            self.write(&[0])?;
        }
        Ok(self.length)
    }

    /// Starts an array whose count comes later. Returns its place, for [`Self::end_array`].
    pub(super) fn begin_array(&mut self) -> Result<u64, ExportError> {
        let at = self.align()?;
        self.write(&0_u64.to_le_bytes())?;
        Ok(at)
    }

    /// Ends the array at that place.
    pub(super) fn end_array(
        &mut self,
        kind: CrateType,
        at: u64,
        count: u64,
    ) -> Result<Word, ExportError> {
        self.file.patch(at, &count.to_le_bytes())?;
        Ok(Word::array(kind, (count > 0).then_some(at), false))
    }

    /// Writes a short array of floats or of vectors.
    pub(super) fn floats(&mut self, kind: CrateType, floats: &[f32]) -> Result<Word, ExportError> {
        let at = self.align()?;
        let width = match kind {
            CrateType::Vec3f => 3,
            CrateType::Vec2f => 2,
            _ => 1,
        };
        self.write(&((floats.len() / width) as u64).to_le_bytes())?;
        self.write(bytemuck::cast_slice(floats))?;
        Ok(Word::array(kind, Some(at), false))
    }

    /// Writes the specs and everything behind the arrays.
    ///
    /// # Errors
    /// [`ExportError::Io`].
    pub(super) fn finish(mut self, root: &Spec) -> Result<W, ExportError> {
        let mut tables = Tables::new();
        tables.number(root, "/".to_owned(), false);
        self.specs(root, &mut tables)?;
        let sections = self.sections(&tables)?;
        let contents = self.length;
        self.write(&(sections.len() as u64).to_le_bytes())?;
        for (name, start, size) in sections {
            let mut padded = [0; 16];
            padded[..name.len()].copy_from_slice(name.as_bytes());
            self.write(&padded)?;
            self.write(&start.to_le_bytes())?;
            self.write(&size.to_le_bytes())?;
        }
        let mut header = [0; HEADER];
        header[..8].copy_from_slice(b"PXR-USDC");
        header[8..11].copy_from_slice(&VERSION);
        header[16..24].copy_from_slice(&contents.to_le_bytes());
        self.file.finish(&header)
    }

    /// Writes the fields of a spec and of what it contains, in the order of their numbers.
    fn specs(&mut self, spec: &Spec, tables: &mut Tables) -> Result<(), ExportError> {
        let mut fields = Vec::new();
        for (name, value) in &spec.fields {
            fields.push((tables.token(name), self.value(value, tables)?));
        }
        for (name, of_properties) in [("primChildren", false), ("properties", true)] {
            let children = spec.children.iter().filter(|c| c.is_property() == of_properties);
            let names: Vec<_> = children.map(|child| tables.token(&child.name)).collect();
            if !names.is_empty() {
                let word = self.indices(CrateType::TokenVector, None, &names)?;
                fields.push((tables.token(name), word));
            }
        }
        tables.end_set(&fields, spec.kind);
        spec.children.iter().try_for_each(|child| self.specs(child, tables))
    }

    /// A count and indices, behind a byte if there is one.
    fn indices(
        &mut self,
        kind: CrateType,
        first: Option<u8>,
        indices: &[u32],
    ) -> Result<Word, ExportError> {
        let at = self.length;
        self.write(first.as_slice())?;
        self.write(&(indices.len() as u64).to_le_bytes())?;
        self.write(bytemuck::cast_slice(indices))?;
        Ok(Word::new(kind, at, 0))
    }

    /// A value's word. What doesn't fit into it is written.
    fn value(&mut self, value: &Value, tables: &mut Tables) -> Result<Word, ExportError> {
        /// Bits of a list: prepended, and explicit with items.
        const PREPENDED: u8 = 0x20;
        const EXPLICIT: u8 = 3;
        Ok(match value {
            Value::Array(word) => *word,
            Value::Samples(samples) => self.samples(samples)?,
            Value::Double(number) => {
                let at = self.length;
                self.write(&number.to_le_bytes())?;
                Word::new(CrateType::Double, at, 0)
            }
            Value::Float(number) => Word::new(CrateType::Float, number.to_bits().into(), INLINED),
            Value::Int(number) => Word::new(CrateType::Int, number.cast_unsigned().into(), INLINED),
            Value::Vec3f(numbers) => {
                let at = self.length;
                self.write(bytemuck::cast_slice(numbers))?;
                Word::new(CrateType::Vec3f, at, 0)
            }
            Value::Token(text) => Word::new(CrateType::Token, tables.token(text).into(), INLINED),
            Value::String(text) => {
                Word::new(CrateType::String, tables.string(text).into(), INLINED)
            }
            Value::Prepended(names) => {
                let names: Vec<_> = names.iter().map(|name| tables.token(name)).collect();
                self.indices(CrateType::TokenListOp, Some(PREPENDED), &names)?
            }
            Value::Paths(paths) => {
                let places: Vec<_> = paths.iter().map(|path| tables.paths[path]).collect();
                self.indices(CrateType::PathListOp, Some(EXPLICIT), &places)?
            }
            Value::Defined => Word::new(CrateType::Specifier, 0, INLINED),
            Value::Uniform => Word::new(CrateType::Variability, 1, INLINED),
        })
    }

    /// Times and the arrays at them. A jump of 8 leads to the word behind it.
    fn samples(&mut self, samples: &[(f64, Word)]) -> Result<Word, ExportError> {
        const NEXT: u64 = 8;
        let count = samples.len() as u64;
        let times = self.length;
        self.write(&count.to_le_bytes())?;
        samples.iter().try_for_each(|(time, _)| self.write(&time.to_le_bytes()))?;
        let at = self.length;
        for word in [NEXT, Word::new(CrateType::DoubleVector, times, 0).0, NEXT, count] {
            self.write(&word.to_le_bytes())?;
        }
        samples.iter().try_for_each(|(_, word)| self.write(&word.0.to_le_bytes()))?;
        Ok(Word::new(CrateType::TimeSamples, at, 0))
    }

    /// Writes all sections. Returns their names, places and sizes.
    fn sections(&mut self, tables: &Tables) -> Result<Vec<(&'static str, u64, u64)>, ExportError> {
        let Tables { tokens, strings, fields, sets, elements, specs, .. } = tables;
        let paths: Vec<_> = (0..index32(elements.len())).collect();
        let text: Vec<u8> =
            tokens.iter().flat_map(|token| token.bytes().chain(std::iter::once(0))).collect();
        let words: Vec<_> = fields.iter().flat_map(|(_, Word(word))| word.to_le_bytes()).collect();
        let count = |length: usize| length as u64;
        let column = |numbers: &mut dyn Iterator<Item = u32>| numbers.collect::<Vec<_>>();
        let mut sections = Vec::new();
        let mut start = self.length;
        let mut end = |name, file: &mut Self| {
            sections.push((name, start, file.length - start));
            start = file.length;
        };
        self.counts(&[count(tokens.len()), count(text.len())])?;
        self.packed(&text)?;
        end("TOKENS", self);
        self.counts(&[count(strings.len())])?;
        self.write(bytemuck::cast_slice(strings))?;
        end("STRINGS", self);
        self.counts(&[count(fields.len())])?;
        self.numbers(&column(&mut fields.iter().map(|(token, _)| *token)))?;
        self.packed(&words)?;
        end("FIELDS", self);
        self.counts(&[count(sets.len())])?;
        self.numbers(sets)?;
        end("FIELDSETS", self);
        self.counts(&[count(elements.len()); 2])?;
        self.numbers(&paths)?;
        self.numbers(&column(&mut elements.iter().map(|(token, _)| token.cast_unsigned())))?;
        self.numbers(&column(&mut elements.iter().map(|(_, jump)| jump.cast_unsigned())))?;
        end("PATHS", self);
        self.counts(&[count(specs.len())])?;
        self.numbers(&paths)?;
        self.numbers(&column(&mut specs.iter().map(|(set, _)| *set)))?;
        self.numbers(&column(&mut specs.iter().map(|(_, kind)| *kind)))?;
        end("SPECS", self);
        Ok(sections)
    }

    fn counts(&mut self, counts: &[u64]) -> Result<(), ExportError> {
        counts.iter().try_for_each(|count| self.write(&count.to_le_bytes()))
    }

    /// The size of a block and the block.
    fn packed(&mut self, bytes: &[u8]) -> Result<(), ExportError> {
        let block = self.file.name_error(block(bytes))?;
        self.counts(&[block.len() as u64])?;
        self.write(&block)
    }

    /// The same of coded numbers.
    fn numbers(&mut self, numbers: &[u32]) -> Result<(), ExportError> {
        let block = self.file.name_error(numbers_block(numbers))?;
        self.counts(&[block.len() as u64])?;
        self.write(&block)
    }
}

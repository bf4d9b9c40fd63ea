//! A USD crate file (`.usdc`) to a [`UsdStage`] (OpenUSD 24.08, `pxr/usd/usd/crateFile.cpp`).
//!
//! In: bytes. Out: prims with the attributes that meshes need; no other value is read. Versions
//! 0.4 and newer, which all programs have written since 2016. Cost: linear in the sections and in
//! the arrays that are needed.

use std::collections::HashMap;

use super::packed::{numbers, unpacked};
use super::samples::is_smooth;
use super::values::Values;
use super::{Attribute, CONVERT, DEEPEST, Prim, UsdStage, UsdValue, is_needed};
use crate::cursor::Cursor;

/// The oldest version whose sections are in blocks.
const OLDEST: u8 = 4;
/// Bytes in front of the place of the table of contents.
const BEFORE_CONTENTS: u64 = 16;
/// Ends a set of fields.
const END_OF_SET: i32 = -1;
/// Numbers of kinds of specs: attributes, prims and the root.
const ATTRIBUTE: i32 = 1;
const PRIM: i32 = 6;
const ROOT: i32 = 7;

/// Reads a whole file.
///
/// # Errors
/// What is wrong with it.
pub(super) fn stage(bytes: &[u8], time: Option<f64>) -> Result<UsdStage, String> {
    let minor = match bytes.get(8..10) {
        Some([0, minor]) => *minor,
        Some([major, _]) => return Err(format!("is a crate file of version {major}: {CONVERT}")),
        _ => return Err(format!("is cut off: {CONVERT}")),
    };
    if minor < OLDEST {
        return Err(format!("is a crate file of version 0.{minor}, which isn't read: {CONVERT}"));
    }
    let part = |name: &str| format!("is cut off or damaged in its {name}: {CONVERT}");
    let sections = sections(bytes).ok_or_else(|| part("table of contents"))?;
    let section = |name: &str| {
        let place = sections.iter().find(|(own, _)| own == name);
        place.map(|(_, bytes)| Cursor::new(bytes)).ok_or_else(|| part(name))
    };
    let tokens = tokens(section("TOKENS")?).ok_or_else(|| part("TOKENS"))?;
    let tokens = tokens_of(&tokens).ok_or_else(|| part("TOKENS"))?;
    let strings = strings(section("STRINGS")?).ok_or_else(|| part("STRINGS"))?;
    let file = File {
        values: Values { bytes, minor, time, tokens, strings },
        fields: fields(section("FIELDS")?).ok_or_else(|| part("FIELDS"))?,
        sets: column(section("FIELDSETS")?).ok_or_else(|| part("FIELDSETS"))?,
        paths: paths(section("PATHS")?).ok_or_else(|| part("PATHS"))?,
        specs: specs(section("SPECS")?).ok_or_else(|| part("SPECS"))?,
    };
    file.stage().ok_or_else(|| part("prims"))
}

/// Names and bytes of the sections.
fn sections(bytes: &[u8]) -> Option<Vec<(String, &[u8])>> {
    let place = Cursor::at(bytes, BEFORE_CONTENTS)?.u64()?;
    let mut contents = Cursor::at(bytes, place)?;
    let count = contents.u64()?;
    let mut sections = Vec::new();
    for _ in 0..count {
        let name: [u8; 16] = contents.take()?;
        let name = String::from_utf8_lossy(&name).trim_end_matches('\0').to_owned();
        let (start, size) = (contents.u64()?, contents.u64()?);
        sections.push((name, Cursor::at(bytes, start)?.slice(size)?));
    }
    Some(sections)
}

/// The text of all tokens.
fn tokens(mut section: Cursor<'_>) -> Option<(u64, Vec<u8>)> {
    let (count, _bytes, packed) = (section.u64()?, section.u64()?, section.u64()?);
    Some((count, unpacked(section.slice(packed)?)?))
}

/// The tokens, each of which ends with a zero.
fn tokens_of((count, text): &(u64, Vec<u8>)) -> Option<Vec<&str>> {
    let text = text.strip_suffix(&[0]).unwrap_or(text);
    let tokens: Vec<_> =
        text.split(|byte| *byte == 0).map(std::str::from_utf8).collect::<Result<_, _>>().ok()?;
    (tokens.len() as u64 >= *count).then_some(tokens)
}

fn strings(mut section: Cursor<'_>) -> Option<Vec<u32>> {
    let count = section.u64()?;
    let mut own = Cursor::new(section.slice(count.checked_mul(4)?)?);
    Some(std::iter::from_fn(|| own.u32()).collect())
}

/// Names and words of the fields.
fn fields(mut section: Cursor<'_>) -> Option<Vec<(i32, u64)>> {
    let count = section.u64()?;
    let names = packed_numbers(&mut section, count)?;
    let size = section.u64()?;
    let words = unpacked(section.slice(size)?)?;
    let words = words.as_chunks().0.iter().map(|word| u64::from_le_bytes(*word));
    let fields: Vec<_> = names.into_iter().zip(words).collect();
    (fields.len() as u64 == count).then_some(fields)
}

fn packed_numbers(section: &mut Cursor<'_>, count: u64) -> Option<Vec<i32>> {
    let size = section.u64()?;
    numbers(section.slice(size)?, count)
}

fn column(mut section: Cursor<'_>) -> Option<Vec<i32>> {
    let count = section.u64()?;
    packed_numbers(&mut section, count)
}

/// Path, set of fields and kind of each spec.
fn specs(mut section: Cursor<'_>) -> Option<Vec<[i32; 3]>> {
    let count = section.u64()?;
    let [paths, sets, kinds] = three(&mut section, count)?;
    Some(
        paths
            .into_iter()
            .zip(sets)
            .zip(kinds)
            .map(|((path, set), kind)| [path, set, kind])
            .collect(),
    )
}

fn three(section: &mut Cursor<'_>, count: u64) -> Option<[Vec<i32>; 3]> {
    Some([
        packed_numbers(section, count)?,
        packed_numbers(section, count)?,
        packed_numbers(section, count)?,
    ])
}

/// A path: the one above it, and its last name.
#[derive(Clone, Copy, Debug)]
struct Path {
    number: i32,
    parent: Option<usize>,
    /// A token, negative for a property.
    element: i32,
}

/// The paths, from the root down, as the file walks them.
fn paths(mut section: Cursor<'_>) -> Option<Vec<Path>> {
    let (_places, count) = (section.u64()?, section.u64()?);
    let [numbers, elements, jumps] = three(&mut section, count)?;
    let mut paths: Vec<Path> = Vec::with_capacity(numbers.len());
    // Parents of siblings that come later, by their place.
    let mut later = HashMap::new();
    let mut parent = None;
    for (place, ((number, element), jump)) in
        numbers.into_iter().zip(elements).zip(jumps).enumerate()
    {
        if let Some(own) = later.remove(&place) {
            parent = own;
        }
        paths.push(Path { number, parent, element });
        match jump {
            // Neither child nor sibling: what follows was announced before.
            -2 => {}
            -1 => parent = Some(place),
            // A sibling, which follows.
            0 => {}
            jump => {
                later.insert(place.checked_add(usize::try_from(jump).ok()?)?, parent);
                parent = Some(place);
            }
        }
    }
    Some(paths)
}

/// The sections of a file.
#[derive(Debug)]
struct File<'a> {
    values: Values<'a>,
    fields: Vec<(i32, u64)>,
    sets: Vec<i32>,
    paths: Vec<Path>,
    specs: Vec<[i32; 3]>,
}

/// Specs by the place of their paths, and the places of the paths below each.
struct Places {
    /// Set of fields and kind.
    specs: Vec<Option<(i32, i32)>>,
    below: HashMap<usize, Vec<usize>>,
}

impl File<'_> {
    fn stage(&self) -> Option<UsdStage> {
        let by_number: HashMap<i32, usize> =
            self.paths.iter().enumerate().map(|(place, path)| (path.number, place)).collect();
        let mut specs = vec![None; self.paths.len()];
        for [path, set, kind] in &self.specs {
            specs[*by_number.get(path)?] = Some((*set, *kind));
        }
        let mut below: HashMap<usize, Vec<usize>> = HashMap::new();
        for (place, path) in self.paths.iter().enumerate() {
            if let Some(parent) = path.parent {
                below.entry(parent).or_default().push(place);
            }
        }
        let places = Places { specs, below };
        let root =
            places.specs.iter().position(|spec| spec.is_some_and(|(_, kind)| kind == ROOT))?;
        let set = places.specs[root]?.0;
        let mut stage =
            UsdStage { prims: self.children(root, set, &places, 0)?, ..UsdStage::default() };
        for (name, word) in self.set(set)? {
            match name {
                "upAxis" => stage.up = self.values.value(word)?.texts.first()?.clone(),
                "metersPerUnit" => {
                    stage.metres_per_unit = Some(*self.values.value(word)?.numbers.first()?);
                }
                "subLayers" => {
                    stage.prims.push(Prim { is_composed: true, ..Prim::default() });
                }
                _ => {}
            }
        }
        Some(stage)
    }

    /// Names and words of a set of fields.
    fn set(&self, first: i32) -> Option<Vec<(&str, u64)>> {
        let set = self.sets.get(usize::try_from(first).ok()?..)?;
        let set = set.iter().take_while(|field| **field != END_OF_SET);
        set.map(|field| {
            let (name, word) = *self.fields.get(usize::try_from(*field).ok()?)?;
            Some((*self.values.tokens.get(usize::try_from(name).ok()?)?, word))
        })
        .collect()
    }

    /// The prims below a path whose spec has that set, in the order that it gives.
    fn children(&self, place: usize, set: i32, places: &Places, depth: usize) -> Option<Vec<Prim>> {
        (depth < DEEPEST).then_some(())?;
        let mut order = HashMap::new();
        for (name, word) in self.set(set)? {
            if name == "primChildren" {
                let names = self.values.value(word)?.texts;
                order.extend(names.into_iter().enumerate().map(|(order, name)| (name, order)));
            }
        }
        let mut prims = Vec::new();
        for &child in places.below.get(&place).map_or(&[][..], |below| below) {
            if let Some((set, PRIM)) = places.specs[child] {
                prims.push(self.prim(child, set, places, depth + 1)?);
            }
        }
        prims.sort_by_key(|prim| order.get(&prim.name).copied());
        Some(prims)
    }

    fn prim(&self, place: usize, set: i32, places: &Places, depth: usize) -> Option<Prim> {
        let name = u32::try_from(self.paths[place].element).ok()?;
        let mut prim = Prim { name: self.values.token(name)?, ..Prim::default() };
        let mut is_defined = false;
        for (name, word) in self.set(set)? {
            match name {
                "typeName" => prim.kind = self.values.value(word)?.texts.first()?.clone(),
                "specifier" => is_defined = self.values.value(word)?.numbers == [0.0],
                "active" => prim.is_hidden = self.values.value(word)?.numbers == [0.0],
                "references" | "payload" | "inheritPaths" | "specializes" | "variantSetNames" => {
                    prim.is_composed = true;
                }
                _ => {}
            }
        }
        prim.is_hidden |= !is_defined;
        prim.children = self.children(place, set, places, depth)?;
        for &child in places.below.get(&place).map_or(&[][..], |below| below) {
            if let Some((set, ATTRIBUTE)) = places.specs[child] {
                prim.attributes.extend(self.attribute(child, set)?);
            }
        }
        Some(prim)
    }

    /// The attribute of a path, if a mesh needs it.
    fn attribute(&self, place: usize, set: i32) -> Option<Option<Attribute>> {
        let name = self.values.token(self.paths[place].element.unsigned_abs())?;
        if !is_needed(&name) {
            return Some(None);
        }
        let mut own = Attribute { name, ..Attribute::default() };
        for (name, word) in self.set(set)? {
            let text = |value: UsdValue| value.texts.into_iter().next();
            match name {
                "typeName" => own.kind = text(self.values.value(word)?)?,
                "interpolation" => own.interpolation = text(self.values.value(word)?)?,
                "timeSamples" => {
                    (own.times, own.value) = self.values.sampled(word, is_smooth(&own.name))?;
                }
                // What isn't understood is no primvar of texture coordinates.
                "default" if own.times.is_empty() => {
                    let value = self.values.value(word);
                    let is_geometry = !own.name.starts_with("primvars:");
                    own.value = if is_geometry { value? } else { value.unwrap_or_default() };
                }
                _ => {}
            }
        }
        Some(Some(own))
    }
}

//! The numbers of a glTF file: its buffers, and the accessors that say what lies where in them.
//!
//! In: the file's JSON and what is beside it. Out: the numbers of an accessor, of which each is checked
//! to lie within its buffer. Base64 is that of RFC 4648. Not promised: sparse accessors, which have
//! an error.

use std::borrow::Cow;
use std::path::{Component, Path};

use super::super::json::Json;
use super::missing;
use crate::cursor::{Cursor, Number};

/// The bytes of all buffers, and the JSON that describes them.
pub(super) struct Buffers<'a> {
    root: &'a Json,
    bytes: Vec<Cow<'a, [u8]>>,
}

impl<'a> Buffers<'a> {
    /// Reads all buffers. The first may be the body of the file itself.
    pub(super) fn read(
        root: &'a Json,
        body: Option<&'a [u8]>,
        path: &Path,
    ) -> Result<Self, String> {
        let buffers = root.list("buffers").iter().enumerate();
        let bytes = buffers
            .map(|(number, buffer)| bytes_of(number, buffer, body, path))
            .collect::<Result<_, _>>()?;
        Ok(Self { root, bytes })
    }

    /// The numbers of an accessor with `width` in each element.
    pub(super) fn accessor(&self, number: usize, width: usize) -> Result<Vec<f64>, String> {
        let accessor = self.root.list("accessors").get(number);
        let accessor = accessor.ok_or_else(|| missing("accessor", number))?;
        if accessor.get("sparse").is_some() {
            return Err("has sparse accessors, which aren't read: export it without".to_owned());
        }
        let what = || format!("has an accessor {number} that is wrong or beyond its buffer");
        self.numbers(accessor, width).ok_or_else(what)
    }

    fn numbers(&self, accessor: &Json, width: usize) -> Option<Vec<f64>> {
        let kind = ["SCALAR", "VEC2", "VEC3"][width - 1];
        (accessor.text("type") == Some(kind)).then_some(())?;
        let (kind, largest) = component(accessor.index("componentType")?)?;
        let is_unit = accessor.get("normalized") == Some(&Json::Bool(true));
        let count = accessor.index("count")?;
        let view = self.root.list("bufferViews").get(accessor.index("bufferView")?)?;
        let bytes = self.bytes.get(view.index("buffer")?)?;
        // What is missing has its default; what is there has to be an index.
        let or = |of: &Json, key: &str, default: usize| {
            if of.get(key).is_some() { of.index(key) } else { Some(default) }
        };
        let start = or(view, "byteOffset", 0)?;
        let bytes = bytes.get(start..start.checked_add(view.index("byteLength")?)?)?;
        let bytes = bytes.get(or(accessor, "byteOffset", 0)?..)?;
        let own = width * kind.bytes();
        let stride = or(view, "byteStride", own)?;
        // No count makes more memory than the file has: each element takes a byte at least.
        if stride < own || count == 0 {
            return (count == 0).then(Vec::new);
        }
        (stride.checked_mul(count - 1)?.checked_add(own)? <= bytes.len()).then_some(())?;
        let mut numbers = Vec::with_capacity(count * width);
        for element in bytes.chunks(stride).take(count) {
            let mut element = Cursor::new(element);
            for _ in 0..width {
                let number = element.number(kind)?;
                // Normalised numbers are fractions of the type's largest.
                let unit = largest.filter(|_| is_unit);
                numbers.push(unit.map_or(number, |largest| (number / largest).max(-1.0)));
            }
        }
        Some(numbers)
    }
}

/// The type of an accessor's numbers by its number in the format, which is that of OpenGL, and the
/// largest that it holds, unless it is a float.
fn component(number: usize) -> Option<(Number, Option<f64>)> {
    Some(match number {
        5120 => (Number::I8, Some(i8::MAX.into())),
        5121 => (Number::U8, Some(u8::MAX.into())),
        5122 => (Number::I16, Some(i16::MAX.into())),
        5123 => (Number::U16, Some(u16::MAX.into())),
        5125 => (Number::U32, Some(u32::MAX.into())),
        5126 => (Number::F32, None),
        _ => return None,
    })
}

/// The bytes of a buffer: the file's own, those of a file beside it, or those in its address.
fn bytes_of<'a>(
    number: usize,
    buffer: &Json,
    body: Option<&'a [u8]>,
    path: &Path,
) -> Result<Cow<'a, [u8]>, String> {
    let Some(address) = buffer.text("uri") else {
        let own = body.filter(|_| number == 0);
        return own.map(Cow::Borrowed).ok_or_else(|| format!("its buffer {number} isn't there"));
    };
    if let Some(data) = address.strip_prefix("data:") {
        let (_, code) = data.split_once(";base64,").unwrap_or_default();
        let bytes = base64(code).filter(|bytes| !bytes.is_empty());
        return bytes
            .map(Cow::Owned)
            .ok_or_else(|| format!("its buffer {number} holds no base64: export it again"));
    }
    let name = unescaped(address).filter(|name| !name.contains(':'));
    let Some(name) = name else {
        return Err(format!("its buffer {number} isn't a file beside it: export it as .glb"));
    };
    // A garment from elsewhere must not show what else this machine holds.
    let is_inside = |part| matches!(part, Component::Normal(_) | Component::CurDir);
    if !Path::new(&name).components().all(is_inside) {
        return Err(format!("its buffer {name:?} lies outside its folder: put it beside the file"));
    }
    let beside = path.with_file_name(&name);
    std::fs::read(&beside).map(Cow::Owned).map_err(|reason| {
        format!("its buffer {name:?} cannot be read ({reason}): put it beside, or export .glb")
    })
}

/// An address with its `%20` as the bytes that they stand for.
fn unescaped(address: &str) -> Option<String> {
    let mut bytes = Vec::new();
    let mut parts = address.split('%');
    bytes.extend_from_slice(parts.next()?.as_bytes());
    for part in parts {
        bytes.push(u8::from_str_radix(part.get(..2)?, 16).ok()?);
        bytes.extend_from_slice(&part.as_bytes()[2..]);
    }
    String::from_utf8(bytes).ok()
}

/// The bytes of base64 (RFC 4648), padded or not.
fn base64(code: &str) -> Option<Vec<u8>> {
    let code = code.trim_end_matches('=').as_bytes();
    let mut bytes = Vec::with_capacity(code.len() / 4 * 3 + 3);
    for four in code.chunks(4) {
        let mut bits = 0_u32;
        for (place, letter) in four.iter().enumerate() {
            let digit = match letter {
                b'A'..=b'Z' => letter - b'A',
                b'a'..=b'z' => letter - b'a' + 26,
                b'0'..=b'9' => letter - b'0' + 52,
                b'+' => 62,
                b'/' => 63,
                _ => return None,
            };
            bits |= u32::from(digit) << (26 - 6 * place);
        }
        // Three letters hold two bytes, and two hold one.
        bytes.extend_from_slice(&bits.to_be_bytes()[..four.len() - 1]);
    }
    Some(bytes)
}

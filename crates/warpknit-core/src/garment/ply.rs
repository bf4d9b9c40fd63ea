//! PLY to a triangulated mesh (Greg Turk, "The PLY Polygon File Format", 1994): ASCII, and binary of
//! either byte order.
//!
//! In: a file's bytes. Out: an [`ObjMesh`]. Vertices have `x y z`, and the flat pattern as `s t`,
//! `u v` or `texture_u texture_v`; faces have `vertex_indices` or `vertex_index`. Other elements and
//! properties are read over. Not promised: texture coordinates at the corners of faces.

use glam::{DVec2, DVec3};

use super::obj::ObjMesh;
use super::soup::Soup;
use crate::cursor::{Cursor, Number};

#[derive(Debug)]
struct Property {
    name: String,
    /// The type of a list's length.
    list: Option<Number>,
    number: Number,
}

#[derive(Debug)]
struct Element {
    name: String,
    count: u64,
    properties: Vec<Property>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    Ascii,
    Little,
    Big,
}

/// What is left of the body.
enum PlyBody<'a> {
    Text(&'a [u8]),
    Binary(Cursor<'a>),
}

/// Reads the bytes of a PLY.
///
/// # Errors
/// What is wrong with them.
pub(super) fn parse(bytes: &[u8]) -> Result<ObjMesh, String> {
    let (form, elements, body) = header(bytes)?;
    let mut body = match form {
        Form::Ascii => PlyBody::Text(body),
        Form::Little => PlyBody::Binary(Cursor::new(body)),
        Form::Big => PlyBody::Binary(Cursor::big(body)),
    };
    let (mut places, mut texture) = (Vec::new(), Vec::new());
    let mut soup = Soup::default();
    for element in &elements {
        let column = |names: &[&str]| {
            element.properties.iter().position(|own| names.contains(&own.name.as_str()))
        };
        let xyz = [column(&["x"]), column(&["y"]), column(&["z"])];
        let st = [column(&["s", "u", "texture_u"]), column(&["t", "v", "texture_v"])];
        let corners = column(&["vertex_indices", "vertex_index"]);
        let mut row = Vec::new();
        for number in 0..element.count {
            let what = || {
                format!(
                    "{} {number} is cut off or no number: export the garment again",
                    element.name
                )
            };
            body.row(element, &mut row).ok_or_else(what)?;
            let value = |column: Option<usize>| column.and_then(|at| row[at].first().copied());
            if element.name == "vertex" {
                let [Some(x), Some(y), Some(z)] = xyz.map(value) else {
                    return Err(
                        "its vertices have no x, y and z: export the garment as a mesh".to_owned()
                    );
                };
                places.push(DVec3::new(x, y, z));
                if let [Some(s), Some(t)] = st.map(value) {
                    texture.push(DVec2::new(s, t));
                }
            } else if element.name == "face" {
                let corners = corners.map_or(&[][..], |at| &row[at]);
                add_face(&mut soup, corners, &places, &texture).ok_or_else(|| {
                    format!(
                        "face {number} has an index or a number out of range: \
                         export the garment again"
                    )
                })?;
            }
        }
    }
    soup.into_mesh().ok_or_else(|| "it has no face: export the garment as a mesh".to_owned())
}

/// Adds a face, or tells that it can't.
fn add_face(soup: &mut Soup, corners: &[f64], places: &[DVec3], texture: &[DVec2]) -> Option<()> {
    let index = |corner: &f64| {
        (0..places.len())
            .contains(&crate::number::whole_f64(*corner))
            .then(|| crate::number::whole_f64(*corner))
    };
    let corners = corners.iter().map(index).collect::<Option<Vec<_>>>()?;
    let own: Vec<_> = corners.iter().map(|&at| places[at]).collect();
    let flat: Option<Vec<_>> = corners.iter().map(|&at| texture.get(at).copied()).collect();
    soup.add(&own, flat.as_deref()).then_some(())
}

/// The form, the elements, and the bytes behind the header.
fn header(bytes: &[u8]) -> Result<(Form, Vec<Element>, &[u8]), String> {
    let (mut form, mut elements) = (None, Vec::<Element>::new());
    let mut rest = bytes;
    loop {
        let end = rest.iter().position(|byte| *byte == b'\n');
        let end = end.ok_or("its header has no end_header: export the garment again")?;
        let line = std::str::from_utf8(&rest[..end])
            .map_err(|_text| "its header is no text: export the garment again")?;
        rest = &rest[end + 1..];
        let words: Vec<_> = line.split_whitespace().collect();
        let odd = || {
            format!("its header has the line {line:?}, which no PLY has: export the garment again")
        };
        match words[..] {
            ["format", "ascii", _] => form = Some(Form::Ascii),
            ["format", "binary_little_endian", _] => form = Some(Form::Little),
            ["format", "binary_big_endian", _] => form = Some(Form::Big),
            ["element", name, count] => elements.push(Element {
                name: name.to_owned(),
                count: count.parse().map_err(|_number| odd())?,
                properties: Vec::new(),
            }),
            ["property", ref kind @ .., name] => {
                let (list, number) = match *kind {
                    ["list", length, number] => (Some(length), number),
                    [number] => (None, number),
                    _ => return Err(odd()),
                };
                let list = list.map(|length| named(length).ok_or_else(odd)).transpose()?;
                let number = named(number).ok_or_else(odd)?;
                let element = elements.last_mut().ok_or_else(odd)?;
                element.properties.push(Property { name: name.to_owned(), list, number });
            }
            ["end_header"] => break,
            ["ply"] | ["comment" | "obj_info", ..] | [] => {}
            _ => return Err(odd()),
        }
    }
    Ok((form.ok_or("its header has no format: export the garment again")?, elements, rest))
}

/// The kind of number of that name.
fn named(name: &str) -> Option<Number> {
    Some(match name {
        "char" | "int8" => Number::I8,
        "uchar" | "uint8" => Number::U8,
        "short" | "int16" => Number::I16,
        "ushort" | "uint16" => Number::U16,
        "int" | "int32" => Number::I32,
        "uint" | "uint32" => Number::U32,
        "float" | "float32" => Number::F32,
        "double" | "float64" => Number::F64,
        _ => return None,
    })
}

impl PlyBody<'_> {
    /// Reads an element's properties: each a list, of one number where it is none.
    fn row(&mut self, element: &Element, row: &mut Vec<Vec<f64>>) -> Option<()> {
        row.clear();
        for property in &element.properties {
            let count = match property.list {
                Some(length) => crate::number::whole_f64(self.number(length)?),
                None => 1,
            };
            // A number takes a byte at least, so no count makes more memory than the file has.
            if count > self.rest().len() {
                return None;
            }
            row.push((0..count).map(|_| self.number(property.number)).collect::<Option<_>>()?);
        }
        (!element.properties.is_empty()).then_some(())
    }

    fn rest(&self) -> &[u8] {
        match self {
            Self::Text(rest) => rest,
            Self::Binary(body) => body.rest(),
        }
    }

    fn number(&mut self, number: Number) -> Option<f64> {
        match self {
            Self::Text(rest) => {
                let start = rest.iter().position(|byte| !byte.is_ascii_whitespace())?;
                let word = &rest[start..];
                let end = word.iter().position(u8::is_ascii_whitespace).unwrap_or(word.len());
                *rest = &word[end..];
                std::str::from_utf8(&word[..end]).ok()?.parse().ok()
            }
            Self::Binary(body) => body.number(number),
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const SQUARE: &str = "ply\nformat ascii 1.0\ncomment by hand\nelement vertex 4\n\
        property double x\nproperty double y\nproperty double z\nproperty float s\n\
        property float t\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
        0 0 0 0 0\n1 0 0 1 0\n1 1 0 1 1\n0 1 0 0 1\n4 0 1 2 3\n";

    #[test]
    fn a_square_has_two_triangles_and_cut_short_an_error() {
        let mesh = parse(SQUARE.as_bytes()).unwrap();
        assert_eq!((mesh.positions.len(), mesh.triangles.len(), mesh.untextured), (4, 2, 0));
        for end in 0..SQUARE.len() - 2 {
            let message = parse(&SQUARE.as_bytes()[..end]).unwrap_err();
            assert!(!message.contains('\n'), "{message}");
        }
    }

    proptest! {
        #[test]
        fn anything_is_read_or_refused(body in prop::collection::vec(any::<u8>(), 0..200), form in 0..3) {
            let form = ["ascii", "binary_little_endian", "binary_big_endian"][form as usize];
            let header = SQUARE.split("0 0 0").next().unwrap().replace("ascii", form);
            let _read = parse(&[header.as_bytes(), &body].concat());
            let _read = parse(&body);
        }
    }
}

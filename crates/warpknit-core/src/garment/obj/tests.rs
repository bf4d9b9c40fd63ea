//! The reader against itself and against tobj.

use std::fmt::Write as _;
use std::io::BufReader;

use proptest::prelude::*;

use super::*;

fn parsed(text: &str) -> Result<ObjMesh, String> {
    parse(text.as_bytes(), Path::new("t.obj")).map_err(|error| error.to_string())
}

/// A reader that hands out a few bytes at a time, so that every line is cut somewhere.
fn in_bits(text: &str, size: usize) -> Result<ObjMesh, String> {
    let input = BufReader::with_capacity(size, text.as_bytes());
    parse(input, Path::new("t.obj")).map_err(|error| error.to_string())
}

/// All that a mesh holds, to be compared.
fn contents(mesh: &ObjMesh) -> String {
    format!("{mesh:?}")
}

/// Words that lines are made of: plain ones mostly.
fn word() -> impl Strategy<Value = String> {
    prop_oneof![
        8 => (1_u32..5).prop_map(|index| index.to_string()),
        4 => (1_u32..5, 1_u32..5).prop_map(|(v, vt)| format!("{v}/{vt}")),
        2 => (1_u32..5).prop_map(|v| format!("{v}//{v}")),
        2 => (-3_i32..0).prop_map(|index| index.to_string()),
        4 => (-9.0_f64..9.0).prop_map(|number| number.to_string()),
        1 => prop::sample::select(vec!["\\\n", "\\\r\n", "#", "# x", "1e-3", "+2", "nan", "x"])
            .prop_map(str::to_owned),
    ]
}

fn line() -> impl Strategy<Value = String> {
    let keyword =
        prop::sample::select(vec!["v", "vt", "f", "v", "f", "vn", "o", "g", "#", "", "l"]);
    let end = prop::sample::select(vec!["\n", "\r\n", "\r", " \n", "\n\n"]);
    (keyword, prop::collection::vec(word(), 2..5), end)
        .prop_map(|(keyword, words, end)| format!("{keyword} {}{end}", words.join(" ")))
}

/// Four vertices and four texture coordinates, so that most indices are in range.
const HEAD: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvt 1 1\n";

proptest! {
    /// With a buffer of one byte no line is ever whole, so all are read slowly.
    #[test]
    fn both_ways_read_the_same(lines in prop::collection::vec(line(), 0..12)) {
        let text = format!("{HEAD}{}", lines.concat());
        let slow = in_bits(&text, 1).map(|mesh| contents(&mesh));
        for size in [7, 64, 4096] {
            prop_assert_eq!(&in_bits(&text, size).map(|mesh| contents(&mesh)), &slow, "{}", text);
        }
    }

    /// tobj reads sound text of one group well. Its positions are numbered as faces use them.
    #[test]
    fn sound_text_is_what_tobj_reads(
        points in prop::collection::vec(prop::array::uniform3(-1e3_f64..1e3), 3..30),
        corners in prop::collection::vec(prop::collection::vec(0_usize..30, 3..6), 1..30),
    ) {
        let mut text = String::new();
        for [x, y, z] in &points {
            writeln!(text, "v {x} {y} {z}\nvt {y} {x}").unwrap();
        }
        for face in &corners {
            text += "f";
            for corner in face {
                write!(text, " {0}/{0}", corner % points.len() + 1).unwrap();
            }
            text += "\n";
        }
        let ours = parsed(&text).unwrap();
        let options = tobj::LoadOptions { triangulate: true, ..Default::default() };
        let (models, _) =
            tobj::load_obj_buf(&mut text.as_bytes(), &options, |_| unreachable!("no mtllib")).unwrap();
        let theirs = &models[0].mesh;
        let position = |index: &u32| {
            let at = 3 * *index as usize;
            DVec3::from_slice(&theirs.positions[at..at + 3])
        };
        let texture = |index: &u32| {
            let at = 2 * *index as usize;
            DVec3::new(theirs.texcoords[at], theirs.texcoords[at + 1], 0.0)
        };
        let ours_of = |points: &[DVec3], triangles: &[[u32; 3]]| -> Vec<DVec3> {
            triangles.as_flattened().iter().map(|&index| points[index as usize]).collect()
        };
        prop_assert_eq!(
            ours_of(&ours.positions, &ours.triangles),
            theirs.indices.iter().map(position).collect::<Vec<_>>()
        );
        prop_assert_eq!(
            ours_of(&ours.texture, &ours.texture_triangles),
            theirs.texcoord_indices.iter().map(texture).collect::<Vec<_>>()
        );
    }
}

#[test]
fn faces_know_their_lines_whatever_is_between_them() {
    let text = format!("# a\r\n\n{HEAD}\rf 1 2 3\r\n# b\nf 1 \\\n2 3\nf 1/1 2/2 3/3\n\nf 2 3 4");
    let mesh = parsed(&text).unwrap();
    let lines: Vec<_> = mesh.faces.iter().map(|face| face.line).collect();
    assert_eq!(lines, [12, 14, 16, 18]);
    assert_eq!(mesh.untextured, 3);
    assert!(mesh.has_texture(2) && !mesh.has_texture(1) && !mesh.has_texture(3));
}

#[test]
fn names_are_those_of_their_faces() {
    let text = format!("{HEAD}f 1 2 3\no a  b\ng c\nf 1 2 3\ng d\no x\no a b\nf 1 2 3\nf 2 3 4\n");
    let mesh = parsed(&text).unwrap();
    let name = |index: Option<u32>| index.map_or("", |index| &mesh.names[index as usize]);
    let names: Vec<_> = mesh
        .faces
        .iter()
        .map(|face| mesh.label(face))
        .map(|label| [name(label.object), name(label.group)])
        .collect();
    assert_eq!(names, [["", ""], ["a b", "c"], ["a b", "d"], ["a b", "d"]]);
    assert!(!mesh.names.iter().any(|name| name == "x"), "no face has it");
}

#[test]
fn lines_are_counted() {
    for (text, says) in [
        ("# one", "in 1 line)"),
        ("# one\n", "in 1 line)"),
        ("# one\r\n# two\r\n", "in 2 lines)"),
        ("\n\n#", "in 3 lines)"),
        ("\u{feff}", "in 0 lines)"),
    ] {
        let error = parse(text.as_bytes(), Path::new("a\nb.obj")).unwrap_err().to_string();
        assert!(error.contains(says) && error.starts_with("a\\nb.obj: is no OBJ"), "{error:?}");
    }
}

#[test]
fn utf_16_and_utf_32_are_named() {
    for text in ["\u{feff}v 0 0 0\n", "v 0 0 0\n"] {
        for bytes in [
            text.chars().flat_map(|c| u32::from(c).to_le_bytes()).collect::<Vec<_>>(),
            text.chars().flat_map(|c| u32::from(c).to_be_bytes()).collect(),
        ] {
            let error = parse(&bytes[..], Path::new("t.obj")).unwrap_err();
            assert!(matches!(error, GarmentError::Wide { .. }), "{error}");
        }
        let units: Vec<u16> = text.encode_utf16().collect();
        for bytes in [
            units.iter().flat_map(|unit| unit.to_le_bytes()).collect::<Vec<_>>(),
            units.iter().flat_map(|unit| unit.to_be_bytes()).collect(),
        ] {
            let error = parse(&bytes[..], Path::new("t.obj")).unwrap_err();
            assert!(matches!(error, GarmentError::Wide { .. }), "{error}");
        }
    }
}

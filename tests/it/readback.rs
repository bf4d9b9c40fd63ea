//! Tubes read back from files, by readers that share no code with the writers.

use std::path::Path;

use serde_json::Value;

/// What a file holds; numbers are its own, so a `.glb`'s are metres.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Mesh {
    pub(crate) positions: Vec<[f32; 3]>,
    pub(crate) normals: Vec<[f32; 3]>,
    pub(crate) uvs: Vec<[f32; 2]>,
    /// Of `.ply` alone.
    pub(crate) colors: Vec<[u8; 3]>,
    pub(crate) triangles: Vec<[usize; 3]>,
}

impl Mesh {
    /// Smallest and largest corner, times `scale`.
    pub(crate) fn bounds(&self, scale: f32) -> [[f32; 3]; 2] {
        let fold = |pick: fn(f32, f32) -> f32, start: f32| {
            [0, 1, 2].map(|axis| self.positions.iter().map(|p| p[axis] * scale).fold(start, pick))
        };
        [fold(f32::min, f32::INFINITY), fold(f32::max, f32::NEG_INFINITY)]
    }

    /// Appends another file's mesh.
    pub(crate) fn append(&mut self, other: Self) {
        let first = self.positions.len();
        self.triangles.extend(
            other.triangles.into_iter().map(|triangle| triangle.map(|vertex| vertex + first)),
        );
        self.positions.extend(other.positions);
        self.normals.extend(other.normals);
        self.uvs.extend(other.uvs);
        self.colors.extend(other.colors);
    }
}

/// Reads numbers off the front of bytes.
struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let (front, rest) = self.0.split_at(N);
        self.0 = rest;
        front.try_into().unwrap()
    }

    fn floats<const N: usize>(&mut self) -> [f32; N] {
        std::array::from_fn(|_| f32::from_le_bytes(self.take()))
    }

    fn short_index(&mut self) -> usize {
        usize::from(u16::from_le_bytes(self.take()))
    }

    fn index(&mut self) -> usize {
        u32::from_le_bytes(self.take()) as usize
    }
}

/// A `.ply` with the properties that its header must name, in that order.
pub(crate) fn ply(path: &Path) -> Mesh {
    let file = std::fs::read(path).unwrap();
    let end = file.windows(11).position(|text| text == b"end_header\n").unwrap() + 11;
    let header = std::str::from_utf8(&file[..end]).unwrap();
    let lines: Vec<&str> = header.lines().filter(|line| !line.starts_with("comment")).collect();
    let count =
        |line: &str, element: &str| line.strip_prefix(element).unwrap().parse::<usize>().unwrap();
    let (vertices, faces) = (count(lines[2], "element vertex "), count(lines[14], "element face "));
    assert_eq!(lines[..2], ["ply", "format binary_little_endian 1.0"]);
    let floats =
        ["x", "y", "z", "nx", "ny", "nz", "s", "t"].map(|name| format!("property float {name}"));
    assert_eq!(lines[3..11], floats);
    assert_eq!(
        lines[11..14],
        ["red", "green", "blue"].map(|name| format!("property uchar {name}"))
    );
    assert_eq!(lines[15..], ["property list uchar uint vertex_indices", "end_header"]);
    let (mut mesh, mut body) = (Mesh::default(), Bytes(&file[end..]));
    for _ in 0..vertices {
        mesh.positions.push(body.floats());
        mesh.normals.push(body.floats());
        mesh.uvs.push(body.floats());
        mesh.colors.push(body.take());
    }
    for _ in 0..faces {
        assert_eq!(body.take(), [3]);
        mesh.triangles.push(std::array::from_fn(|_| body.index()));
    }
    assert!(body.0.is_empty());
    mesh
}

/// An `.obj` of triangles whose corners have one number for all.
pub(crate) fn obj(path: &Path) -> Mesh {
    let text = std::fs::read_to_string(path).unwrap();
    let mut mesh = Mesh::default();
    for line in text.lines() {
        let (key, rest) = line.split_once(' ').unwrap();
        let numbers =
            || rest.split(' ').map(|number| number.parse::<f32>().unwrap()).collect::<Vec<_>>();
        match key {
            "v" => mesh.positions.push(numbers().try_into().unwrap()),
            "vn" => mesh.normals.push(numbers().try_into().unwrap()),
            "vt" => mesh.uvs.push(numbers().try_into().unwrap()),
            "f" => {
                let corner = |text: &str| {
                    let numbers: Vec<usize> =
                        text.split('/').map(|number| number.parse().unwrap()).collect();
                    assert_eq!(numbers, [numbers[0]; 3]);
                    numbers[0] - 1
                };
                let corners: Vec<_> = rest.split(' ').map(corner).collect();
                mesh.triangles.push(corners.try_into().unwrap());
            }
            _ => assert!(["o", "#", "mtllib", "usemtl"].contains(&key), "{line}"),
        }
    }
    mesh
}

/// All primitives of a `.glb` in turn, which may be none.
pub(crate) fn glb(path: &Path) -> Mesh {
    let file = std::fs::read(path).unwrap();
    let word = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!(
        (&file[..4], word(4), word(8), &file[16..20]),
        (&b"glTF"[..], 2, file.len(), &b"JSON"[..])
    );
    let binary_at = 20 + word(12);
    let json: Value = serde_json::from_slice(&file[20..binary_at]).unwrap();
    let mut mesh = Mesh::default();
    if binary_at == file.len() {
        assert!(json.get("buffers").is_none() && json.get("meshes").is_none());
        return mesh;
    }
    let binary = &file[binary_at + 8..];
    assert_eq!(
        (word(binary_at), &file[binary_at + 4..binary_at + 8]),
        (binary.len(), &b"BIN\0"[..])
    );
    let array = |index: &Value| {
        let accessor = &json["accessors"][index.as_u64().unwrap() as usize];
        let view = &json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
        let number = |value: &Value| value.as_u64().unwrap() as usize;
        let view_bytes = &binary[number(&view["byteOffset"])..][..number(&view["byteLength"])];
        (Bytes(&view_bytes[number(&accessor["byteOffset"])..]), number(&accessor["count"]))
    };
    let is_short = |index: &Value| {
        json["accessors"][index.as_u64().unwrap() as usize]["componentType"] == 5123
    };
    for primitive in json["meshes"]
        .as_array()
        .unwrap()
        .iter()
        .flat_map(|mesh| mesh["primitives"].as_array().unwrap())
    {
        let (mut positions, count) = array(&primitive["attributes"]["POSITION"]);
        let (mut normals, _) = array(&primitive["attributes"]["NORMAL"]);
        let mut uvs = primitive["attributes"].get("TEXCOORD_0").map(|uvs| array(uvs).0);
        let (mut indices, corners) = array(&primitive["indices"]);
        let next = if is_short(&primitive["indices"]) { Bytes::short_index } else { Bytes::index };
        mesh.append(Mesh {
            positions: (0..count).map(|_| positions.floats()).collect(),
            normals: (0..count).map(|_| normals.floats()).collect(),
            uvs: uvs.iter_mut().flat_map(|uvs| (0..count).map(|_| uvs.floats())).collect(),
            colors: Vec::new(),
            triangles: (0..corners / 3)
                .map(|_| std::array::from_fn(|_| next(&mut indices)))
                .collect(),
        });
    }
    mesh
}

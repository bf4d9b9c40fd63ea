//! glTF 2.0 to a triangulated mesh (Khronos, "glTF 2.0 Specification", 2021): binary (`.glb`), and
//! text (`.gltf`) with its buffers in files beside it or in itself.
//!
//! In: a file's bytes. Out: an [`ObjMesh`] with the triangles of all meshes of the scene, moved by
//! their nodes; the pattern is `TEXCOORD_0`, turned upside down, since there v counts from the
//! top. Quantised attributes are read (`KHR_mesh_quantization`). By hand, since each accessor has
//! to be checked against its buffer anyway, and the crate `gltf` would double what the core
//! depends on.
//!
//! Not promised: meshopt and Draco compression, sparse accessors and external addresses, which
//! have errors; skins and morph targets, whose meshes are taken at rest; texture transforms.

use std::path::Path;

use glam::{DAffine3, DMat4, DQuat, DVec2, DVec3};

use super::json::Json;
use super::obj::ObjMesh;
use super::soup::Soup;
use crate::cursor::Cursor;
use buffers::Buffers;

mod buffers;

/// How deep nodes may lie in each other. Skeletons of people have some thirty levels.
const DEEPEST: usize = 128;
/// Extensions that hide the geometry, and what they are called.
const COMPRESSED: [(&str, &str); 3] = [
    ("KHR_draco_mesh_compression", "Draco"),
    ("EXT_meshopt_compression", "meshopt"),
    ("KHR_meshopt_compression", "meshopt"),
];

/// Reads the bytes of a `.glb`.
///
/// # Errors
/// What is wrong with them.
pub(super) fn parse_binary(bytes: &[u8], path: &Path) -> Result<ObjMesh, String> {
    let cut = || "is cut off: export the garment again".to_owned();
    let mut file = Cursor::new(bytes);
    let [_magic, version, _length] = header(&mut file).ok_or_else(cut)?;
    if version != 2 {
        return Err(format!("is glTF of version {version}: export it as glTF 2.0"));
    }
    let (mut text, mut body) = (None, None);
    while !file.rest().is_empty() {
        let length = file.u32().ok_or_else(cut)?;
        let kind = file.take().ok_or_else(cut)?;
        let chunk = file.slice(length.into()).ok_or_else(cut)?;
        match &kind {
            b"JSON" if text.is_none() => text = Some(chunk),
            b"BIN\0" if body.is_none() => body = Some(chunk),
            _ => {}
        }
    }
    let root = Json::parse(text.ok_or("has no JSON chunk: export the garment again")?)?;
    mesh(&root, body, path)
}

fn header(file: &mut Cursor<'_>) -> Option<[u32; 3]> {
    Some([file.u32()?, file.u32()?, file.u32()?])
}

/// Reads the bytes of a `.gltf`.
///
/// # Errors
/// What is wrong with them.
pub(super) fn parse_text(bytes: &[u8], path: &Path) -> Result<ObjMesh, String> {
    let root = Json::parse(bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes))?;
    if root.get("pattern").is_some() {
        return Err("is a pattern of GarmentCode: give its OBJ behind it".to_owned());
    }
    if root.get("asset").is_none() {
        return Err("is JSON, but not glTF: export the garment as OBJ, GLB, USD or PLY".to_owned());
    }
    mesh(&root, None, path)
}

fn mesh(root: &Json, body: Option<&[u8]>, path: &Path) -> Result<ObjMesh, String> {
    let required = root.list("extensionsRequired").iter().filter_map(Json::as_text);
    for name in required {
        if let Some((_, compression)) = COMPRESSED.iter().find(|(own, _)| *own == name) {
            return Err(format!(
                "is compressed with {compression}, which isn't read: export it uncompressed"
            ));
        }
    }
    let mut scene = GltfScene {
        root,
        buffers: Buffers::read(root, body, path)?,
        soup: Soup::default(),
        is_read: vec![false; root.list("nodes").len()],
    };
    for node in scene.roots() {
        scene.node(node, DAffine3::IDENTITY, 0)?;
    }
    scene.soup.into_mesh().ok_or_else(|| "has no triangle: export the garment as a mesh".to_owned())
}

/// A scene that is being read.
struct GltfScene<'a> {
    root: &'a Json,
    buffers: Buffers<'a>,
    soup: Soup,
    /// Nodes that have been read. Each has one parent at most.
    is_read: Vec<bool>,
}

impl GltfScene<'_> {
    /// The nodes of the scene, or without one those that are in no other.
    fn roots(&self) -> Vec<usize> {
        let index = self.root.index("scene").unwrap_or(0);
        if let Some(scene) = self.root.list("scenes").get(index) {
            return scene.list("nodes").iter().filter_map(Json::as_index).collect();
        }
        let nodes = self.root.list("nodes");
        let mut is_root = vec![true; nodes.len()];
        for child in nodes.iter().flat_map(|node| node.list("children")) {
            if let Some(own) = child.as_index().and_then(|child| is_root.get_mut(child)) {
                *own = false;
            }
        }
        (0..nodes.len()).filter(|node| is_root[*node]).collect()
    }

    fn node(&mut self, number: usize, parent: DAffine3, depth: usize) -> Result<(), String> {
        let root = self.root;
        let node = root.list("nodes").get(number).ok_or_else(|| missing("node", number))?;
        if depth > DEEPEST {
            return Err(format!(
                "its node {number} lies deeper than {DEEPEST} nodes in each other"
            ));
        }
        if std::mem::replace(&mut self.is_read[number], true) {
            return Err(format!("its node {number} has two parents or contains itself"));
        }
        let scene_from_node = parent * transform(node, number)?;
        if let Some(mesh) = node.get("mesh") {
            let mesh = mesh.as_index().unwrap_or(usize::MAX);
            let name = node.text("name");
            let mesh =
                root.list("meshes").get(mesh).ok_or_else(|| missing("mesh of node", number))?;
            self.soup.begin(name.or_else(|| mesh.text("name")).unwrap_or_default());
            for primitive in mesh.list("primitives") {
                self.primitive(primitive, scene_from_node)
                    .map_err(|what| format!("a mesh of its node {number} {what}"))?;
            }
        }
        for child in node.list("children") {
            let child = child.as_index().unwrap_or(usize::MAX);
            self.node(child, scene_from_node, depth + 1)?;
        }
        Ok(())
    }

    /// Adds the triangles of a primitive.
    fn primitive(&mut self, primitive: &Json, scene_from_node: DAffine3) -> Result<(), String> {
        // Numbers of the format: triangles, strips and fans.
        let form = primitive.index("mode").unwrap_or(4);
        let attributes = primitive.get("attributes");
        let attribute = |name| attributes.and_then(|attributes| attributes.index(name));
        let Some(places) = attribute("POSITION").filter(|_| matches!(form, 4..=6)) else {
            return Ok(());
        };
        let places = self.buffers.accessor(places, 3)?;
        let places: Vec<_> = places
            .as_chunks()
            .0
            .iter()
            .map(|place| scene_from_node.transform_point3(DVec3::from_array(*place)))
            .collect();
        let texture =
            attribute("TEXCOORD_0").map(|own| self.buffers.accessor(own, 2)).transpose()?;
        let texture = texture.map(|texture| {
            let texture = texture.as_chunks::<2>().0.iter();
            texture.map(|[u, v]| DVec2::new(*u, 1.0 - v)).collect::<Vec<_>>()
        });
        let corners: Vec<usize> = match primitive.get("indices") {
            Some(indices) => {
                let indices = self.buffers.accessor(indices.as_index().unwrap_or(usize::MAX), 1)?;
                indices.into_iter().map(crate::number::whole_f64).collect()
            }
            None => (0..places.len()).collect(),
        };
        let is_mirrored = scene_from_node.matrix3.determinant() < 0.0;
        for mut triangle in triangles(&corners, form)? {
            if is_mirrored {
                triangle.swap(1, 2);
            }
            let own = triangle.map(|corner| places.get(corner).copied());
            let [Some(a), Some(b), Some(c)] = own else {
                return Err(format!(
                    "has {} vertices, but names {triangle:?}: export it again",
                    places.len()
                ));
            };
            let flat = texture.as_ref().map(|texture| {
                let own = triangle.iter().map(|corner| texture.get(*corner).copied());
                own.collect::<Option<Vec<_>>>()
            });
            if !self.soup.add(&[a, b, c], flat.flatten().as_deref()) {
                return Err("has a number that is not finite: export it again".to_owned());
            }
        }
        Ok(())
    }
}

fn missing(what: &str, number: usize) -> String {
    if number == usize::MAX {
        return format!("names a {what} that isn't there: export it again");
    }
    format!("names the {what} {number}, which isn't there: export it again")
}

/// The transform of a node to its parent.
fn transform(node: &Json, number: usize) -> Result<DAffine3, String> {
    let numbers = |name| {
        let items = node.list(name).iter().map(Json::as_number).collect::<Option<Vec<_>>>()?;
        items.iter().all(|number| number.is_finite()).then_some(items)
    };
    let three = |name, otherwise| -> Option<DVec3> {
        if node.get(name).is_none() {
            Some(otherwise)
        } else {
            Some(array(&numbers(name)?)?.into())
        }
    };
    let own = || {
        if node.get("matrix").is_some() {
            let matrix = DMat4::from_cols_array(&array(&numbers("matrix")?)?);
            return Some(DAffine3::from_mat4(matrix));
        }
        let turn = match node.get("rotation") {
            Some(_) => DQuat::from_array(array(&numbers("rotation")?)?),
            None => DQuat::IDENTITY,
        };
        let (size, shift) = (three("scale", DVec3::ONE)?, three("translation", DVec3::ZERO)?);
        Some(DAffine3::from_scale_rotation_translation(size, unit(turn)?, shift))
    };
    own().ok_or_else(|| format!("its node {number} has a wrong transform: export it again"))
}

/// A rotation, whose length may be off by what a file rounds away.
fn unit(turn: DQuat) -> Option<DQuat> {
    let length = turn.length();
    if length == 1.0 {
        return Some(turn);
    }
    (length > 0.0).then(|| turn / length)
}

fn array<const N: usize>(numbers: &[f64]) -> Option<[f64; N]> {
    numbers.try_into().ok()
}

/// The triangles of corners: one by one (4), as a strip (5), or as a fan (6).
fn triangles(corners: &[usize], form: usize) -> Result<Vec<[usize; 3]>, String> {
    if form == 4 {
        let (triangles, rest) = corners.as_chunks();
        if !rest.is_empty() {
            return Err(format!("has {} corners, which are no triangles", corners.len()));
        }
        return Ok(triangles.to_vec());
    }
    let windows = (0..corners.len().saturating_sub(2)).map(|at| match (form, at % 2) {
        (6, _) => [corners[0], corners[at + 1], corners[at + 2]],
        (_, 0) => [corners[at], corners[at + 1], corners[at + 2]],
        // Every second triangle of a strip is wound the other way.
        _ => [corners[at + 1], corners[at], corners[at + 2]],
    });
    Ok(windows.collect())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// A square of two triangles with indices, in a text whose buffer is in it or in `.glb`.
    fn square(address: &str) -> String {
        format!(
            r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],
            "nodes":[{{"name":"up","translation":[0,1,0],"children":[1]}},
            {{"mesh":0,"scale":[2,2,2]}}],
            "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"TEXCOORD_0":1}},
            "indices":2}}]}}],
            "accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"}},
            {{"bufferView":1,"componentType":5121,"count":4,"type":"VEC2","normalized":true}},
            {{"bufferView":2,"componentType":5121,"count":6,"type":"SCALAR"}}],
            "bufferViews":[{{"buffer":0,"byteLength":48}},
            {{"buffer":0,"byteOffset":48,"byteLength":16,"byteStride":4}},
            {{"buffer":0,"byteOffset":64,"byteLength":6}}],
            "buffers":[{{"byteLength":70{address}}}]}}"#
        )
    }

    fn body() -> Vec<u8> {
        let places = [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let mut body: Vec<u8> =
            places.as_flattened().iter().flat_map(|number| number.to_le_bytes()).collect();
        body.extend(
            [[0, 255, 0, 0], [255, 255, 0, 0], [255, 0, 0, 0], [0, 0, 0, 0]].as_flattened(),
        );
        body.extend([0, 1, 2, 0, 2, 3]);
        body
    }

    fn binary(text: &str, body: &[u8]) -> Vec<u8> {
        let mut text = text.as_bytes().to_vec();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut file = b"glTF\x02\0\0\0\0\0\0\0".to_vec();
        for (kind, chunk) in [(b"JSON", &text[..]), (b"BIN\0", body)] {
            file.extend(u32::try_from(chunk.len()).unwrap().to_le_bytes());
            file.extend(kind);
            file.extend(chunk);
        }
        file
    }

    #[test]
    fn a_square_is_moved_by_its_nodes_and_its_pattern_turned() {
        let here = Path::new("a.glb");
        let mesh = parse_binary(&binary(&square(""), &body()), here).unwrap();
        assert_eq!((mesh.positions.len(), mesh.triangles.len(), mesh.untextured), (4, 2, 0));
        assert_eq!(mesh.positions[2], DVec3::new(2.0, 3.0, 0.0));
        assert_eq!(mesh.texture[2], DVec3::new(1.0, 1.0, 0.0));
        let code = encoded(&body());
        let inside = square(&format!(r#","uri":"data:;base64,{code}""#));
        assert_eq!(parse_text(inside.as_bytes(), here).unwrap().positions, mesh.positions);
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a b.bin"), body()).unwrap();
        let beside = square(r#","uri":"a%20b.bin""#);
        let read = parse_text(beside.as_bytes(), &folder.path().join("a.gltf")).unwrap();
        assert_eq!(read.positions, mesh.positions);
    }

    /// Base64 as others write it.
    fn encoded(bytes: &[u8]) -> String {
        const LETTERS: &[u8; 64] =
            b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
        let mut code = String::new();
        for three in bytes.chunks(3) {
            let bits = three.iter().enumerate().map(|(i, byte)| u32::from(*byte) << (16 - 8 * i));
            let bits: u32 = bits.sum();
            for place in 0..4 {
                let letter = LETTERS[(bits >> (18 - 6 * place) & 63) as usize];
                code.push(if place > three.len() { '=' } else { letter.into() });
            }
        }
        code
    }

    #[test]
    fn what_is_wrong_is_one_line() {
        let whole = square("");
        let wrong = [
            ("\"count\":4", "\"count\":400000000000", "accessor 0"),
            ("\"count\":6", "\"count\":5", "no triangles"),
            ("\"byteLength\":48", "\"byteLength\":9007199254740991", "accessor 0"),
            ("\"byteStride\":4", "\"byteStride\":1", "accessor 1"),
            ("\"byteStride\":4", "\"byteStride\":-4", "accessor 1"),
            ("\"VEC3\"", "\"VEC4\"", "accessor 0"),
            ("\"children\":[1]", "\"children\":[0]", "node 0"),
            ("\"children\":[1]", "\"children\":[7]", "node 7"),
            ("\"nodes\":[0]", "\"nodes\":[]", "no triangle"),
            ("\"mesh\":0", "\"mesh\":-1", "isn't there"),
            ("\"scale\":[2,2,2]", "\"scale\":[2,2]", "transform"),
            ("\"scene\":0", "\"extensionsRequired\":[\"EXT_meshopt_compression\"]", "meshopt"),
            ("\"scene\":0", "\"extensionsRequired\":[\"KHR_draco_mesh_compression\"]", "Draco"),
            ("\"indices\":2", "\"indices\":0", "accessor 0"),
            ("5121,\"count\":6", "5121,\"sparse\":{},\"count\":6", "sparse"),
        ];
        for (from, to, says) in wrong {
            assert!(whole.contains(from), "{from}");
            let file = binary(&whole.replacen(from, to, 1), &body());
            let message = parse_binary(&file, Path::new("a.glb")).unwrap_err();
            assert!(message.contains(says) && !message.contains('\n'), "{to}: {message}");
        }
        let mut far = body();
        far[69] = 200;
        assert!(parse_binary(&binary(&whole, &far), Path::new("a.glb")).is_err());
        for address in
            ["http://a/b.bin", "data:;base64,*", "none.bin", "%zz", "../none.bin", "/etc/passwd"]
        {
            let text = square(&format!(r#","uri":"{address}""#));
            assert!(parse_text(text.as_bytes(), Path::new("a.gltf")).is_err(), "{address}");
        }
        assert!(parse_text(b"{\"panels\":[]}", Path::new("a.json")).unwrap_err().contains("JSON"));
        let file = binary(&whole, &body());
        for end in 0..file.len() {
            assert!(parse_binary(&file[..end], Path::new("a.glb")).is_err(), "{end}");
        }
    }

    #[test]
    fn strips_and_fans_have_the_triangles_of_their_corners() {
        assert_eq!(triangles(&[0, 1, 2, 3], 5), Ok(vec![[0, 1, 2], [2, 1, 3]]));
        assert_eq!(triangles(&[0, 1, 2, 3], 6), Ok(vec![[0, 1, 2], [0, 2, 3]]));
        assert_eq!(triangles(&[0, 1], 5), Ok(vec![]));
    }

    proptest! {
        #[test]
        fn anything_is_read_or_refused(
            at in any::<prop::sample::Index>(),
            byte in any::<u8>(),
            body in prop::collection::vec(any::<u8>(), 70),
        ) {
            let mut file = binary(&square(""), &body);
            let length = file.len();
            file[at.index(length)] = byte;
            let _read = parse_binary(&file, Path::new("a.glb"));
        }
    }
}

//! Files read back: what the report says is in them is in them.

use std::path::Path;

use assert_cmd::Command;
use serde_json::Value;

use crate::readback;

/// Runs `warpknit` in a folder; the report's JSON.
fn knit(folder: &Path, arguments: &[&str]) -> Value {
    let mut command = Command::cargo_bin("warpknit").unwrap();
    command.env("XDG_CACHE_HOME", crate::cache_home());
    command
        .current_dir(folder)
        .args(arguments)
        .args(["-o", "report.json", "--quiet"])
        .assert()
        .success()
        .stderr("");
    serde_json::from_slice(&std::fs::read(folder.join("report.json")).unwrap()).unwrap()
}

/// A `.glb` of floats with a node a yarn.
const FLOATS: [&str; 4] = ["--glb-precision", "f32", "--nodes", "yarn"];

const SWATCH: [&str; 9] = ["swatch", "--wales", "5", "--courses", "7", "--st", "4", "--sr", "5"];

fn count(report: &Value, key: &str) -> usize {
    report[key].as_u64().unwrap() as usize
}

#[test]
fn glb_holds_the_counts_of_the_report_in_valid_chunks() {
    let folder = tempfile::tempdir().unwrap();
    let report = knit(folder.path(), &[&SWATCH[..], &["-o", "s.glb"], &FLOATS].concat());
    let bytes = std::fs::read(folder.path().join("s.glb")).unwrap();
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!((&bytes[..4], word(4), word(8)), (&b"glTF"[..], 2, bytes.len()));
    let json_length = word(12);
    let json: Value = serde_json::from_slice(&bytes[20..20 + json_length]).unwrap();
    let binary = &bytes[28 + json_length..];
    assert_eq!(
        (&bytes[24 + json_length..28 + json_length], word(20 + json_length)),
        (&b"BIN\0"[..], binary.len())
    );
    assert_eq!(json["buffers"][0]["byteLength"], binary.len());

    let number = |value: &Value| value.as_u64().unwrap() as usize;
    let array = |accessor: &Value, size: usize| {
        let view = &json["bufferViews"][number(&accessor["bufferView"])];
        let whole = &binary[number(&view["byteOffset"])..][..number(&view["byteLength"])];
        &whole[number(&accessor["byteOffset"])..][..size * number(&accessor["count"])]
    };
    let accessor = |index: &Value| &json["accessors"][index.as_u64().unwrap() as usize];
    let (mut vertices, mut triangles) = (0, 0);
    for primitive in json["meshes"]
        .as_array()
        .unwrap()
        .iter()
        .flat_map(|mesh| mesh["primitives"].as_array().unwrap())
    {
        let positions = accessor(&primitive["attributes"]["POSITION"]);
        let count = positions["count"].as_u64().unwrap() as usize;
        let floats: &[f32] = &bytemuck::pod_collect_to_vec(array(positions, 12));
        assert_eq!(floats.len(), 3 * count);
        for axis in 0..3 {
            let low = floats.iter().skip(axis).step_by(3).copied().fold(f32::INFINITY, f32::min);
            assert!((positions["min"][axis].as_f64().unwrap() - f64::from(low)).abs() < 1e-9);
        }
        assert!(
            floats.iter().all(|x| x.abs() < 0.02),
            "metres: the swatch is some millimetres large"
        );
        // Short yarns need no more than 16 bits.
        assert_eq!(accessor(&primitive["indices"])["componentType"], 5123);
        let indices: &[u16] =
            &bytemuck::pod_collect_to_vec(array(accessor(&primitive["indices"]), 2));
        assert_eq!(indices.iter().max(), Some(&(u16::try_from(count).unwrap() - 1)));
        vertices += count;
        triangles += indices.len() / 3;
    }
    assert_eq!(
        (vertices, triangles),
        (count(&report["surface"], "vertices"), count(&report["surface"], "triangles"))
    );
    assert_eq!(triangles, 2 * 5 * 7 * 40, "2 · St · Sr a stitch");
    assert_eq!(json["materials"].as_array().unwrap().len(), 2);
    let sheen = &json["materials"][0]["extensions"]["KHR_materials_sheen"];
    assert!(
        json["extensionsUsed"] == serde_json::json!(["KHR_materials_sheen"])
            && sheen["sheenColorFactor"][0].as_f64().unwrap() > 0.0
    );

    // From the scene down: a panel's bars, and their yarns by name.
    let nodes = |indices: &Value| -> Vec<&Value> {
        indices.as_array().unwrap().iter().map(|at| &json["nodes"][number(at)]).collect()
    };
    let bars = nodes(&json["scenes"][0]["nodes"]);
    assert_eq!(
        bars.iter().map(|bar| bar["name"].as_str().unwrap()).collect::<Vec<_>>(),
        ["panel 0 bar 1", "panel 0 bar 2"]
    );
    let yarns: Vec<_> = bars.iter().flat_map(|bar| nodes(&bar["children"])).collect();
    assert_eq!(yarns.len(), count(&report, "yarns"));
    for (at, yarn) in yarns.iter().enumerate() {
        assert_eq!(yarn["name"], format!("yarn {at}"));
        assert_eq!(json["meshes"][number(&yarn["mesh"])]["name"], yarn["name"]);
    }
}

/// The corners of a quantised `.glb`'s triangles in turn, mm, with their normals and the length of
/// the cubes they lie on.
fn quantised_corners(path: &Path) -> Vec<([f32; 3], [f32; 3], f32)> {
    let bytes = std::fs::read(path).unwrap();
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let json: Value = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
    assert_eq!(json["extensionsRequired"], serde_json::json!(["KHR_mesh_quantization"]));
    let number = |value: &Value| value.as_u64().unwrap() as usize;
    let array = |index: &Value| {
        let accessor = &json["accessors"][number(index)];
        let view = &json["bufferViews"][number(&accessor["bufferView"])];
        &bytes[28 + length + number(&view["byteOffset"]) + number(&accessor["byteOffset"])..]
    };
    let mut corners = Vec::new();
    for node in json["nodes"].as_array().unwrap() {
        let float = |value: &Value| value.as_f64().unwrap() as f32;
        let step = float(&node["scale"][0]);
        for primitive in json["meshes"][number(&node["mesh"])]["primitives"].as_array().unwrap() {
            let (positions, normals) = (
                array(&primitive["attributes"]["POSITION"]),
                array(&primitive["attributes"]["NORMAL"]),
            );
            assert!(primitive["attributes"].get("TEXCOORD_0").is_none());
            let count = number(&json["accessors"][number(&primitive["indices"])]["count"]);
            let indices = array(&primitive["indices"])[..2 * count].as_chunks::<2>().0;
            for vertex in indices.iter().map(|index| usize::from(u16::from_le_bytes(*index))) {
                let place = |axis: usize| {
                    let at = 8 * vertex + 2 * axis;
                    let place = u16::from_le_bytes(positions[at..at + 2].try_into().unwrap());
                    1000.0 * (float(&node["translation"][axis]) + step * f32::from(place))
                };
                let normal =
                    |axis: usize| f32::from(normals[4 * vertex + axis].cast_signed()) / 127.0;
                let corner = (std::array::from_fn(place), std::array::from_fn(normal));
                corners.push((corner.0, corner.1, 1000.0 * step));
            }
        }
    }
    corners
}

/// On a swatch and on a garment, triangle by triangle, within half a cube.
#[test]
fn quantised_glb_holds_the_triangles_of_the_floats() {
    let (flat, draped) =
        (crate::drape::mesh("pinch_flat.obj"), crate::drape::mesh("pinch_draped.obj"));
    let drape = ["drape", flat.to_str().unwrap(), draped.to_str().unwrap()];
    let coarse = ["--wales-per-cm", "1", "--st", "4", "--sr", "5"];
    for knitting in [&SWATCH[..], &[&drape[..], &coarse].concat()] {
        let folder = tempfile::tempdir().unwrap();
        knit(folder.path(), &[knitting, &["-o", "s.glb"]].concat());
        knit(folder.path(), &[knitting, &["-o", "f.glb"], &FLOATS].concat());
        let corners = quantised_corners(&folder.path().join("s.glb"));
        let floats = readback::glb(&folder.path().join("f.glb"));
        assert_eq!(corners.len(), 3 * floats.triangles.len());
        for ((place, normal, cube), vertex) in corners.iter().zip(floats.triangles.as_flattened()) {
            let (position, own) = (floats.positions[*vertex], floats.normals[*vertex]);
            for axis in 0..3 {
                let off = (place[axis] - 1000.0 * position[axis]).abs();
                assert!(off <= 0.5 * cube + 2e-4, "{off} mm off, cubes of {cube} mm");
                assert!((normal[axis] - own[axis]).abs() < 0.005);
            }
        }
        let size = |name: &str| std::fs::metadata(folder.path().join(name)).unwrap().len();
        assert!(3 * size("s.glb") < 2 * size("f.glb"), "{} of {}", size("s.glb"), size("f.glb"));
    }
}

/// The arrays themselves are compared by `tests/readers/rows.py`, with the decoder of others.
#[test]
fn a_compressed_glb_says_where_its_arrays_lie() {
    let folder = tempfile::tempdir().unwrap();
    knit(folder.path(), &[&SWATCH[..], &["-o", "a.glb"]].concat());
    knit(folder.path(), &[&SWATCH[..], &["-o", "b.glb", "--glb-meshopt"]].concat());
    let read = |name: &str| {
        let file = std::fs::read(folder.path().join(name)).unwrap();
        let length = u32::from_le_bytes(file[12..16].try_into().unwrap()) as usize;
        let json: Value = serde_json::from_slice(&file[20..20 + length]).unwrap();
        (json, file.len() - 28 - length)
    };
    let ((plain, plain_bytes), (packed, bytes)) = (read("a.glb"), read("b.glb"));
    assert!(2 * bytes < plain_bytes, "{bytes} of {plain_bytes}");
    assert_eq!(packed["accessors"], plain["accessors"]);
    let buffers = packed["buffers"].as_array().unwrap();
    assert_eq!(count(&buffers[0], "byteLength"), bytes);
    assert_eq!(count(&buffers[1], "byteLength"), plain_bytes);
    const NAME: &str = "EXT_meshopt_compression";
    assert_eq!(buffers[1]["extensions"][NAME]["fallback"], true);
    let views = [&plain, &packed].map(|json| json["bufferViews"].as_array().unwrap());
    for (own, view) in views[0].iter().zip(views[1]) {
        for key in ["byteOffset", "byteLength", "byteStride", "target"] {
            assert_eq!(own[key], view[key]);
        }
        let packed = &view["extensions"][NAME];
        assert!(count(packed, "byteOffset") + count(packed, "byteLength") <= bytes);
        assert_eq!(count(packed, "count") * count(packed, "byteStride"), count(view, "byteLength"));
        let is_indices = view["target"] == 34963;
        assert_eq!(packed["mode"], if is_indices { "TRIANGLES" } else { "ATTRIBUTES" });
    }
}

/// Blender takes a `.ply` in metres with z up.
#[test]
fn ply_and_obj_take_the_unit_and_the_upright_axis_of_their_reader() {
    let folder = tempfile::tempdir().unwrap();
    let files = ["-o", "a.ply", "-o", "a.obj"];
    knit(folder.path(), &[&SWATCH[..], &files].concat());
    let turned = ["-o", "b.ply", "-o", "b.obj", "--file-unit", "m", "--up", "z"];
    knit(folder.path(), &[&SWATCH[..], &turned].concat());
    let read = |name: &str| readback::ply(&folder.path().join(name));
    let (a, b) = (read("a.ply"), read("b.ply"));
    for (a, b) in a.positions.iter().zip(&b.positions) {
        for (turned, own) in b.iter().zip([a[0], -a[2], a[1]]) {
            assert!((1000.0 * turned - own).abs() < 1e-5);
        }
    }
    let header = std::fs::read(folder.path().join("b.ply")).unwrap();
    assert!(String::from_utf8_lossy(&header[..200]).contains("comment yarns by warpknit, m "));
    let first = |name: &str| {
        let text = std::fs::read_to_string(folder.path().join(name)).unwrap();
        let line = text.lines().find(|line| line.starts_with("v ")).unwrap().to_owned();
        line.split(' ').skip(1).map(|word| word.parse::<f32>().unwrap()).collect::<Vec<_>>()
    };
    let (a, b) = (first("a.obj"), first("b.obj"));
    assert!((b[0] - a[0] / 1000.0).abs() < 2e-7 && (b[2] - a[1] / 1000.0).abs() < 2e-7);
}

/// Ribbons are for pictures, and a file of tubes says so.
#[test]
fn a_file_of_tubes_says_that_it_holds_no_ribbons() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = Command::cargo_bin("warpknit").unwrap();
    command.current_dir(folder.path()).args(SWATCH).args(["--shape", "ribbon", "-o", "x.glb"]);
    let said = String::from_utf8(command.assert().success().get_output().stderr.clone()).unwrap();
    assert!(said.contains("note: x.glb holds tubes: --shape ribbon is for pictures\n"), "{said}");
}

#[test]
fn glb_counts_the_vertices_of_long_yarns() {
    let folder = tempfile::tempdir().unwrap();
    // A yarn of 700 stitches with 8 rings of 13 vertices each has more than 16 bits count.
    let long = ["swatch", "--fabric", "tricot", "--wales", "2", "--courses", "700"];
    let surface = ["--st", "8", "--sr", "12", "-o", "s.glb", "-o", "s.ply"];
    knit(folder.path(), &[&long[..], &surface, &FLOATS].concat());
    let glb = readback::glb(&folder.path().join("s.glb"));
    let ply = readback::ply(&folder.path().join("s.ply"));
    assert!(glb.positions.len() > 2 * usize::from(u16::MAX));
    assert_eq!(glb.triangles, ply.triangles);
}

#[test]
fn obj_reads_back_with_an_object_a_yarn() {
    let folder = tempfile::tempdir().unwrap();
    let report = knit(folder.path(), &[&SWATCH[..], &["-o", "s.obj", "--caps"]].concat());
    let (models, _) = tobj::load_obj(
        folder.path().join("s.obj"),
        &tobj::LoadOptions { single_index: true, ..Default::default() },
    )
    .unwrap();
    assert_eq!(models.len(), count(&report, "yarns"));
    let triangles: usize = models.iter().map(|model| model.mesh.indices.len() / 3).sum();
    let vertices: usize = models.iter().map(|model| model.mesh.positions.len() / 3).sum();
    assert_eq!(
        (vertices, triangles),
        (count(&report["surface"], "vertices"), count(&report["surface"], "triangles"))
    );
    assert!(models.iter().all(|model| model.mesh.normals.len() == model.mesh.positions.len()));
}

/// A picture that an image of a file holds, as the file's readers see it.
fn image_of(binary: &[u8], json: &Value, place: usize) -> image::RgbImage {
    let number = |value: &Value| usize::try_from(value.as_u64().unwrap()).unwrap();
    let source = number(&json["textures"][place]["source"]);
    assert_eq!(json["images"][source]["mimeType"], "image/png");
    let view = &json["bufferViews"][number(&json["images"][source]["bufferView"])];
    let start = number(&view["byteOffset"]);
    assert_eq!(start % 4, 0);
    image::load_from_memory(&binary[start..start + number(&view["byteLength"])])
        .unwrap()
        .into_rgb8()
}

#[test]
fn glb_and_obj_wear_the_pictures_of_their_yarn() {
    let folder = tempfile::tempdir().unwrap();
    // A picture of a whole surface, dark at its top and light at its bottom, red growing along the
    // yarn.
    let picture =
        image::RgbImage::from_fn(32, 16, |x, y| image::Rgb([8 * x as u8, 100, 10 * y as u8]));
    picture.save(folder.path().join("yarn.png")).unwrap();
    knit(
        folder.path(),
        &[
            &SWATCH[..],
            &["--texture", "yarn.png", "-o", "s.glb", "-o", "s.obj", "-o", "plain.ply"],
            &FLOATS,
        ]
        .concat(),
    );
    let bytes = std::fs::read(folder.path().join("s.glb")).unwrap();
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let (json, binary): (Value, _) =
        (serde_json::from_slice(&bytes[20..20 + length]).unwrap(), &bytes[28 + length..]);
    assert_eq!(json["materials"].as_array().unwrap().len(), 2);
    for material in json["materials"].as_array().unwrap() {
        let surface = &material["pbrMetallicRoughness"];
        let place = |texture: &Value| texture["index"].as_u64().unwrap() as usize;
        let base = image_of(binary, &json, place(&surface["baseColorTexture"]));
        assert_eq!(base.dimensions(), (16, 32));
        assert_eq!(
            base.get_pixel(3, 20),
            picture.get_pixel(20, 3),
            "turned: x goes round the yarn"
        );
        // Nothing stands out, so normals point out and what is around is open.
        let normal = image_of(binary, &json, place(&material["normalTexture"]));
        assert!(normal.pixels().all(|pixel| pixel.0[0].abs_diff(128) < 2
            && pixel.0[1].abs_diff(128) < 2
            && pixel.0[2] == 255));
        let rough = image_of(binary, &json, place(&surface["metallicRoughnessTexture"]));
        assert_eq!(rough.get_pixel(0, 0).0[2], 0, "no metal");
        assert_eq!(
            material["occlusionTexture"]["index"],
            surface["metallicRoughnessTexture"]["index"]
        );
        assert!(
            material["extensions"]["KHR_materials_sheen"]["sheenColorFactor"][1].as_f64().unwrap()
                > 0.0
        );
    }
    // One yarn's pictures are held once, and lengths count their repeats.
    assert_eq!(json["images"].as_array().unwrap().len(), 3);
    let (glb, obj, plain) = (
        readback::glb(&folder.path().join("s.glb")),
        readback::obj(&folder.path().join("s.obj")),
        readback::ply(&folder.path().join("plain.ply")),
    );
    let last = plain.uvs.iter().position(|uv| uv[1] > 1.0).unwrap();
    let per_mm = glb.uvs[last][1] / plain.uvs[last][1];
    assert!(per_mm > 0.1 && (per_mm - 1.0).abs() > 1e-3, "{per_mm}");
    for ((glb, obj), plain) in glb.uvs.iter().zip(&obj.uvs).zip(&plain.uvs) {
        assert!(
            (glb[1] - per_mm * plain[1]).abs() < 1e-3
                && (glb[1] + obj[1]).abs() < 1e-3
                && glb[0] == plain[0]
        );
    }
    let materials = std::fs::read_to_string(folder.path().join("s.mtl")).unwrap();
    assert!(
        materials.contains("newmtl bar_2") && materials.contains("map_Kd s-yarn-1.png"),
        "{materials}"
    );
    let worn = image::open(folder.path().join("s-yarn-1.png")).unwrap().into_rgb8();
    assert_eq!(worn.get_pixel(3, 20), picture.get_pixel(20, 3));
}

#[test]
fn obj_names_a_material_a_bar_and_holds_lines_if_asked_to() {
    let folder = tempfile::tempdir().unwrap();
    let report = knit(folder.path(), &[&SWATCH[..], &["-o", "s.obj"]].concat());
    let (models, materials) =
        tobj::load_obj(folder.path().join("s.obj"), &tobj::LoadOptions::default()).unwrap();
    let materials = materials.unwrap();
    let tricot = warpknit::fabric::Fabric::named("tricot").unwrap();
    for (yarn, material) in tricot.yarns().zip(&materials) {
        let [r, g, b] = yarn.color.linear().map(f64::from);
        assert!(material.diffuse.unwrap().iter().zip([r, g, b]).all(|(a, b)| (a - b).abs() < 1e-6));
    }
    let bar = |name: &str| usize::from(name.contains("bar2"));
    assert!(models.iter().all(|model| model.mesh.material_id == Some(bar(&model.name))));

    let lines =
        knit(folder.path(), &[&SWATCH[..], &["-o", "l.obj", "-o", "l.bcc", "--curves"]].concat());
    assert_eq!(lines["yarns"], report["yarns"]);
    let text = std::fs::read_to_string(folder.path().join("l.obj")).unwrap();
    let points: Vec<Vec<f64>> = text
        .lines()
        .filter_map(|line| {
            Some(line.strip_prefix("v ")?.split(' ').map(|word| word.parse().unwrap()).collect())
        })
        .collect();
    let polylines: Vec<Vec<usize>> = text
        .lines()
        .filter_map(|line| {
            Some(line.strip_prefix("l ")?.split(' ').map(|word| word.parse().unwrap()).collect())
        })
        .collect();
    assert_eq!(polylines.len(), count(&report, "yarns"));
    assert_eq!(polylines.concat(), (1..=points.len()).collect::<Vec<_>>());
    assert!(polylines.iter().all(|line| line.len() == 7 * 4 + 1), "St segments a stitch");
    assert!(
        !text.contains("\nf ")
            && text.contains("mtllib l.mtl")
            && folder.path().join("l.mtl").exists()
    );
    // The same points as the other format of centre lines.
    let curves = crate::curves::bcc(&std::fs::read(folder.path().join("l.bcc")).unwrap()).concat();
    assert!(
        curves.iter().flatten().zip(points.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-4)
    );
    assert_eq!(curves.len(), points.len());
}

#[test]
fn ply_holds_what_the_obj_of_the_same_run_holds_and_the_colours() {
    let folder = tempfile::tempdir().unwrap();
    for caps in [&[][..], &["--caps"]] {
        let report = knit(
            folder.path(),
            &[&SWATCH[..], &["-o", "s.ply", "-o", "s.obj", "-o", "s.glb"], caps, &FLOATS].concat(),
        );
        let ply = readback::ply(&folder.path().join("s.ply"));
        let counts = (ply.positions.len(), ply.triangles.len());
        assert_eq!(
            counts,
            (count(&report["surface"], "vertices"), count(&report["surface"], "triangles"))
        );
        let (obj, glb) = (
            readback::obj(&folder.path().join("s.obj")),
            readback::glb(&folder.path().join("s.glb")),
        );
        assert_eq!((&ply.triangles, &ply.triangles), (&obj.triangles, &glb.triangles));
        // Text has four decimals, and .glb is in metres.
        let near =
            |a: &[f32], b: &[f32], least: f32| a.iter().zip(b).all(|(a, b)| (a - b).abs() < least);
        assert!(near(ply.positions.as_flattened(), obj.positions.as_flattened(), 0.6e-4));
        assert!(near(ply.normals.as_flattened(), obj.normals.as_flattened(), 0.6e-4));
        assert!(near(ply.uvs.as_flattened(), obj.uvs.as_flattened(), 0.6e-4));
        assert_eq!(ply.normals, glb.normals);
        assert!(glb.uvs.is_empty(), "yarns without a picture need none");
        for (ply, (obj, glb)) in
            ply.bounds(1.0).iter().zip(obj.bounds(1.0).iter().zip(&glb.bounds(1e3)))
        {
            assert!(near(ply, obj, 0.6e-4) && near(ply, glb, 1e-5), "{ply:?} {obj:?} {glb:?}");
        }
        let tricot = warpknit::fabric::Fabric::named("tricot").unwrap();
        let (front, back) = (tricot.yarn(0).color.0, tricot.yarn(1).color.0);
        assert_eq!((ply.colors[0], *ply.colors.last().unwrap()), (front, back));
        assert!(ply.colors.chunk_by(|a, b| a == b).count() <= 2);
    }
}

#[test]
fn csv_has_the_contracts_columns_a_row_a_point_and_numbers_that_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let report = knit(folder.path(), &[&SWATCH[..], &["-o", "s.csv"]].concat());
    let text = std::fs::read_to_string(folder.path().join("s.csv")).unwrap();
    let mut lines = text.lines();
    assert_eq!(
        lines.next().unwrap(),
        "panel,bar,yarn,course,wale,kind,point,triangle,flat_x,flat_y,flat_z,draped_x,draped_y,draped_z,normal_x,normal_y,normal_z"
    );
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    assert_eq!(rows.len(), count(&report, "data_points"));
    assert_eq!(rows.len(), 2 * 5 * 7 * 12, "eight points a loop, four an underlap");
    for row in &rows {
        assert_eq!(row.len(), 17);
        assert!(["loop", "inlay", "turn"].contains(&row[5]));
        for number in &row[8..] {
            let read: f64 = number.parse().unwrap();
            assert_eq!(read.to_string(), *number);
        }
    }
}

#[test]
fn the_report_has_the_contracts_keys_in_their_order() {
    let folder = tempfile::tempdir().unwrap();
    knit(folder.path(), &SWATCH);
    let text = std::fs::read_to_string(folder.path().join("report.json")).unwrap();
    let keys: Vec<&str> = text
        .lines()
        .filter_map(|line| line.trim().strip_prefix('"')?.split_once("\":").map(|(key, _)| key))
        .collect();
    let contract = "warpknit fabric garment panels triangles unit uv_scale_mm warnings notes lost_cm2 lost_percent panels scale_mm mirrored folds area_cm2 stretch_warp stretch_weft wales_per_cm courses_per_cm tile yarns stitches \
        data_points points_off_panel stitches_clipped surface shape st sr radius_mm triangles_per_stitch triangles vertices timings_ms read \
        relax knit locate strain map sweep surface render write total clearance clearance min_over_2r pairs_below_1 sweeps draped links checked wrong held strain plane_ms curved_ms threads peak_memory_mb renderer \
        cloth mass_g_m2 yarn_length_m run_in_mm_per_rack loop_width_mm thickness_mm cover_factor porosity stretch_warp stretch_weft";
    assert_eq!(keys, contract.split_whitespace().collect::<Vec<_>>());
}

#[test]
fn flat_coordinates_of_a_csv_lead_back_to_the_file() {
    // Two flat squares of 100 mm. The pattern has the first in units of 10 mm, and the second
    // mirrored, in units of 5 mm.
    let folder = tempfile::tempdir().unwrap();
    let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
    let mut text = String::new();
    for (left, u, side) in [(0.0, 0.0, 10.0_f64), (200.0, 60.0, -20.0)] {
        for (x, y) in corners {
            let (draped, v) = (left + 100.0 * x, side.abs() * y);
            text += &format!("v {draped} {} 0\nvt {} {v}\n", 100.0 * y, u + side * x);
        }
    }
    text += "f 1/1 2/2 3/3 4/4\nf 5/5 6/6 7/7 8/8\n";
    std::fs::write(folder.path().join("two.obj"), text).unwrap();
    let arguments = ["--unit", "mm", "--wales-per-cm", "1", "--mapping", "frame"];
    let mut command = crate::cli::warpknit(folder.path());
    let outputs = ["-o", "two.csv", "-o", "report.json"];
    command.args(["drape", "two.obj"]).args(arguments).args(outputs).assert().success();
    let report = std::fs::read(folder.path().join("report.json")).unwrap();
    let report: Value = serde_json::from_slice(&report).unwrap();
    for stage in ["knit", "locate", "map"] {
        assert!(report["timings_ms"][stage].as_f64() > Some(0.0), "{stage}");
    }
    let panels = report["panels"].as_array().unwrap();
    assert_eq!(panels.iter().map(|panel| &panel["mirrored"]).collect::<Vec<_>>(), [false, true]);
    let rows = std::fs::read_to_string(folder.path().join("two.csv")).unwrap();
    let mut counts = [0, 0];
    for row in rows.lines().skip(1) {
        let row: Vec<&str> = row.split(',').collect();
        let number = |at: usize| row[at].parse::<f64>().unwrap();
        let panel: usize = row[0].parse().unwrap();
        let scale = panels[panel]["scale_mm"].as_f64().unwrap();
        let (u, v) = (number(8) / scale, number(9) / scale);
        // Where the file has this place on the body, and its height over the technical face.
        let expected = match panel {
            0 => [10.0 * u, 10.0 * v, number(10)],
            _ => [200.0 + 5.0 * (60.0 - u), 5.0 * v, -number(10)],
        };
        let draped = [11, 12, 13].map(number);
        let off = expected.iter().zip(draped).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 1e-3, "{row:?}: {expected:?}");
        counts[panel] += 1;
    }
    assert!(counts.iter().all(|count| *count > 500), "{counts:?}");
}

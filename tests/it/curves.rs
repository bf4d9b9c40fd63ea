//! Curves read back by readers of their own, written from the formats' published layouts: all hold
//! the same yarns.

use std::io::Read as _;
use std::path::Path;

use assert_cmd::Command;

/// Segments a stitch.
const ST: usize = 4;

/// A garment with cut yarns, in every format that holds curves, and its data points.
fn knitted(folder: &Path) {
    let mesh = |name: &str| Path::new(env!("CARGO_MANIFEST_DIR")).join("meshes").join(name);
    let mut command = Command::cargo_bin("warpknit").unwrap();
    command.env("XDG_CACHE_HOME", crate::cache_home());
    command
        .current_dir(folder)
        .arg("drape")
        .args([mesh("pinch_flat.obj"), mesh("pinch_draped.obj")]);
    command
        .args(["--fabric", "locknit", "--wales-per-cm", "1", "--courses-per-cm", "1.5", "--quiet"])
        .args(["--st", &ST.to_string(), "--inp", "abaqus"]);
    let outputs = ["s.bcc", "s.curves.txt", "s.inp", "s.npz", "s.usda", "s.csv"];
    command.args(outputs.iter().flat_map(|out| ["-o", out])).assert().success().stderr("");
}

fn read(folder: &Path, name: &str) -> Vec<u8> {
    std::fs::read(folder.join(name)).unwrap()
}

fn text(folder: &Path, name: &str) -> String {
    String::from_utf8(read(folder, name)).unwrap()
}

fn numbers(text: &str) -> Vec<f64> {
    text.split(|c: char| c == ',' || c.is_whitespace())
        .filter(|word| !word.is_empty())
        .map(|word| word.parse().unwrap())
        .collect()
}

fn near(a: [f64; 3], b: [f64; 3], least: f64) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() < least)
}

/// The curves of a BCC file, by cemyuksel.com's description of it.
pub(crate) fn bcc(bytes: &[u8]) -> Vec<Vec<[f64; 3]>> {
    assert_eq!(&bytes[..8], [b'B', b'C', b'C', 0x44, b'C', b'0', 3, 1]);
    let long = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()) as usize;
    let (curves, points) = (long(8), long(16));
    assert_eq!(&bytes[24..45], b"yarns by warpknit, mm");
    let mut rest = &bytes[64..];
    let mut take = |count: usize| {
        let (taken, behind) = rest.split_at(count);
        rest = behind;
        taken
    };
    let read: Vec<Vec<[f64; 3]>> = (0..curves)
        .map(|_| {
            let count = i32::from_le_bytes(take(4).try_into().unwrap());
            let floats: Vec<f32> = bytemuck::pod_collect_to_vec(take(
                12 * usize::try_from(count).expect("no closed curve"),
            ));
            let points: Vec<_> =
                floats.as_chunks::<3>().0.iter().map(|point| point.map(f64::from)).collect();
            // Readers draw from the second point to the last but one, where the curve ends.
            let [first, end, inner, ..] = points[..] else { panic!("{points:?}") };
            assert!(first.iter().zip(end).zip(inner).all(|((a, b), c)| {
                let slack = 1e-4 + 1e-6 * b.abs();
                (a - 2.0 * b + c).abs() < slack
            }));
            points[1..points.len() - 1].to_vec()
        })
        .collect();
    assert!(rest.is_empty() && read.iter().map(|curve| curve.len() + 2).sum::<usize>() == points);
    read
}

/// Curves as Mitsuba reads them, and each one's radius.
fn mitsuba(text: &str) -> Vec<(Vec<[f64; 3]>, f64)> {
    let curve = |text: &str| {
        let rows: Vec<[f64; 4]> =
            text.lines().map(|line| numbers(line).try_into().unwrap()).collect();
        assert!(rows.iter().all(|row| row[3] == rows[0][3]));
        (rows.iter().map(|[x, y, z, _]| [*x, *y, *z]).collect(), rows[0][3])
    };
    text.split("\n\n").filter(|curve| !curve.trim().is_empty()).map(curve).collect()
}

/// An array of an `.npz`: numpy's name of its type, its shape, its bytes.
fn npz(bytes: &[u8], name: &str) -> (String, Vec<usize>, Vec<u8>) {
    let mut archive = zip::ZipArchive::new(std::io::Cursor::new(bytes)).unwrap();
    let mut array = Vec::new();
    archive.by_name(&format!("{name}.npy")).unwrap().read_to_end(&mut array).unwrap();
    assert_eq!(&array[..8], b"\x93NUMPY\x01\x00");
    let length = usize::from(u16::from_le_bytes([array[8], array[9]]));
    assert_eq!((10 + length) % 64, 0);
    let header = std::str::from_utf8(&array[10..10 + length]).unwrap();
    assert!(header.ends_with('\n') && header.contains("'fortran_order': False"));
    let between = |from: &str, to: &str| {
        header.split(from).nth(1).unwrap().split(to).next().unwrap().to_owned()
    };
    let shape =
        between("'shape': (", ")").split(',').filter_map(|n| n.trim().parse().ok()).collect();
    (between("'descr': '", "'"), shape, array[10 + length..].to_vec())
}

fn floats(bytes: &[u8], name: &str) -> Vec<[f64; 3]> {
    let (kind, shape, data) = npz(bytes, name);
    let floats: Vec<f64> = bytemuck::pod_collect_to_vec(&data);
    assert_eq!((kind.as_str(), shape), ("<f8", vec![floats.len() / 3, 3]), "{name}");
    floats.as_chunks::<3>().0.to_vec()
}

fn words(bytes: &[u8], name: &str) -> Vec<u32> {
    let (kind, shape, data) = npz(bytes, name);
    let words: Vec<u32> = bytemuck::pod_collect_to_vec(&data);
    assert!(
        ["<u4", "<i4"].contains(&kind.as_str()) && shape == [words.len()],
        "{name}: {kind} {shape:?}"
    );
    words
}

#[test]
fn bcc_mitsuba_and_abaqus_files_hold_the_same_points() {
    let folder = tempfile::tempdir().unwrap();
    knitted(folder.path());
    let curves = bcc(&read(folder.path(), "s.bcc"));
    let lengths = words(&read(folder.path(), "s.npz"), "length");
    assert_eq!(curves.len(), lengths.len());
    assert!(curves.iter().all(|curve| curve.len() % ST == 1 && curve.len() > ST));

    let same = mitsuba(&text(folder.path(), "s.curves.txt"));
    assert_eq!(same.len(), curves.len());
    for ((own, radius), curve) in same.iter().zip(&curves) {
        assert!(
            own.len() == curve.len()
                && own.iter().zip(curve).all(|(a, b)| near(*a, *b, 0.6e-4))
                && *radius > 0.0
        );
    }

    let text = text(folder.path(), "s.inp");
    let sections: Vec<(&str, Vec<&str>)> = text
        .split("\n*")
        .map(|section| {
            (
                section.lines().next().unwrap(),
                section.lines().skip(1).filter(|line| !line.starts_with("**")).collect(),
            )
        })
        .collect();
    let nodes = &sections.iter().find(|(name, _)| name.starts_with("NODE")).unwrap().1;
    let points: Vec<[f64; 3]> = curves.iter().flatten().copied().collect();
    assert_eq!(nodes.len(), points.len());
    for (at, (line, point)) in nodes.iter().zip(&points).enumerate() {
        let row = numbers(line);
        assert!(
            row[0] == (at + 1) as f64 && near([row[1], row[2], row[3]], *point, 0.6e-4),
            "{line}"
        );
    }
    let elements: Vec<Vec<f64>> = sections
        .iter()
        .filter(|(name, _)| name.starts_with("ELEMENT, TYPE=B31"))
        .flat_map(|(_, lines)| lines.iter().map(|line| numbers(line)))
        .collect();
    let starts =
        |curve: &[[f64; 3]], first: usize| (first..first + curve.len() - 1).map(|node| node as f64);
    let mut first = 1;
    let mut expected = Vec::new();
    for curve in &curves {
        expected.extend(starts(curve, first));
        first += curve.len();
    }
    assert_eq!(elements.len(), expected.len());
    for (at, (element, node)) in elements.iter().zip(expected).enumerate() {
        assert_eq!(*element, [(at + 1) as f64, node, node + 1.0]);
    }
    // A set a bar, each with its section; locknit has two bars, which meet themselves and each
    // other.
    for start in [
        "ELEMENT, TYPE=B31, ELSET=PANEL_0_BAR_1",
        "ELEMENT, TYPE=B31, ELSET=PANEL_0_BAR_2",
        "MATERIAL, NAME=YARN_2",
    ] {
        assert!(sections.iter().any(|(name, _)| *name == start), "{start}");
    }
    let pairs: Vec<_> = sections
        .iter()
        .filter(|(name, _)| name.starts_with("CONTACT PAIR"))
        .map(|(_, lines)| lines[0])
        .collect();
    assert_eq!(pairs, ["SURFACE_1, SURFACE_1", "SURFACE_1, SURFACE_2", "SURFACE_2, SURFACE_2"]);
}

#[test]
fn npz_holds_the_data_points_of_the_csv_and_the_cut_ends() {
    let folder = tempfile::tempdir().unwrap();
    knitted(folder.path());
    let bytes = read(folder.path(), "s.npz");
    let (flat, draped, normals) =
        (floats(&bytes, "flat"), floats(&bytes, "draped"), floats(&bytes, "normal"));
    let (course, wale, triangle) =
        (words(&bytes, "course"), words(&bytes, "wale"), words(&bytes, "triangle"));
    let kinds = npz(&bytes, "kind").2;
    let weights = floats(&bytes, "weights");
    assert!(weights.iter().all(|weights| (weights.iter().sum::<f64>() - 1.0).abs() < 1e-9));
    let points: Vec<u16> = bytemuck::pod_collect_to_vec(&npz(&bytes, "point").2);
    let csv = text(folder.path(), "s.csv");
    let rows: Vec<Vec<&str>> = csv.lines().skip(1).map(|line| line.split(',').collect()).collect();
    let data: Vec<usize> = (0..kinds.len()).filter(|&at| kinds[at] != u8::MAX).collect();
    assert!(rows.len() == data.len() && kinds.len() > data.len(), "the garment cuts yarns");
    for (row, at) in rows.iter().zip(data) {
        let kind = ["loop", "inlay", "turn"][usize::from(kinds[at])];
        let tags = [
            course[at].cast_signed().to_string(),
            wale[at].cast_signed().to_string(),
            kind.to_owned(),
            points[at].to_string(),
            triangle[at].to_string(),
        ];
        assert_eq!(row[3..8], tags);
        let numbers: Vec<f64> = row[8..].iter().map(|number| number.parse().unwrap()).collect();
        assert_eq!(numbers, [flat[at], draped[at], normals[at]].concat());
    }
    let (lengths, bars) = (words(&bytes, "length"), words(&bytes, "bar"));
    assert_eq!(lengths.iter().sum::<u32>() as usize, kinds.len());
    let (mut first, mut cut) = (0, [0, 0]);
    for length in lengths.iter().map(|length| *length as usize) {
        let last = first + length - 1;
        for (side, (end, beside)) in [(first, first + 1), (last, last - 1)].into_iter().enumerate()
        {
            if kinds[end] == u8::MAX {
                assert_ne!(kinds[beside], u8::MAX, "{end}");
                assert_eq!((course[end], wale[end]), (course[beside], wale[beside]), "{end}");
                assert_eq!(points[end], 0, "{end}");
                cut[side] += 1;
            }
        }
        first += length;
    }
    assert!(cut.iter().all(|count| *count > 10), "{cut:?}");
    assert!(
        bars.len() == lengths.len()
            && bars.is_sorted()
            && words(&bytes, "panel").iter().all(|panel| *panel == 0)
    );
    let (_, shape, colors) = npz(&bytes, "color");
    let locknit = warpknit::fabric::Fabric::named("locknit").unwrap();
    assert_eq!((shape, &colors[3..]), (vec![2, 3], &locknit.yarn(1).color.0[..]));
}

#[test]
fn npz_may_be_of_32_bits_and_compressed() {
    let folder = tempfile::tempdir().unwrap();
    let run = |name: &str, flags: &[&str]| {
        let mut command = crate::cli::warpknit(folder.path());
        command
            .args(["swatch", "--wales", "8", "--courses", "8", "--quiet", "-o", name])
            .args(flags);
        command.assert().success();
        read(folder.path(), name)
    };
    let whole = run("a.npz", &[]);
    let single = run("b.npz", &["--npz-precision", "f32"]);
    let packed = run("c.npz", &["--npz-precision", "f32", "--npz-compress"]);
    assert!(single.len() * 3 < whole.len() * 2 && packed.len() * 3 < single.len() * 2);
    for name in ["flat", "draped", "normal", "weights"] {
        let (kind, shape, data) = npz(&single, name);
        let singles: Vec<f32> = bytemuck::pod_collect_to_vec(&data);
        assert_eq!((kind.as_str(), shape), ("<f4", vec![singles.len() / 3, 3]), "{name}");
        let doubles = floats(&whole, name);
        let rounded: Vec<f32> = doubles.as_flattened().iter().map(|own| *own as f32).collect();
        assert_eq!(singles, rounded, "{name}");
    }
    for name in ["draped", "course", "kind", "radius", "color"] {
        assert_eq!(npz(&single, name), npz(&packed, name), "{name}");
    }
    assert_eq!(words(&whole, "yarn"), words(&packed, "yarn"));
}

#[test]
fn usd_curves_go_through_the_data_points_with_their_courses() {
    let folder = tempfile::tempdir().unwrap();
    knitted(folder.path());
    let (text, bytes) = (text(folder.path(), "s.usda"), read(folder.path(), "s.npz"));
    for wanted in
        ["#usda 1.0\n", "defaultPrim = \"cloth\"", "metersPerUnit = 0.001", "upAxis = \"Y\""]
    {
        assert!(text.contains(wanted), "{wanted}");
    }
    let prims: Vec<&str> = text.split("def BasisCurves").skip(1).collect();
    assert_eq!(prims.len(), 2);
    let array = |prim: &str, name: &str| -> Vec<f64> {
        let inside = prim
            .split(&format!(" {name} = ["))
            .nth(1)
            .unwrap_or_else(|| panic!("{name}"))
            .split(']')
            .next()
            .unwrap();
        numbers(&inside.replace(['(', ')'], " "))
    };
    let (draped, courses) = (floats(&bytes, "draped"), words(&bytes, "course"));
    let (lengths, yarns, kinds) =
        (words(&bytes, "length"), words(&bytes, "yarn"), npz(&bytes, "kind").2);
    let (mut point, mut strand) = (0, 0);
    for prim in prims {
        let points: Vec<[f64; 3]> = array(prim, "points").as_chunks::<3>().0.to_vec();
        let counts = array(prim, "curveVertexCounts");
        let (course, st) = (array(prim, "primvars:course"), array(prim, "primvars:st"));
        assert_eq!(
            (course.len(), st.len()),
            (array(prim, "primvars:wale").len(), 2 * course.len())
        );
        let extent = array(prim, "extent");
        let mut next = 0;
        let mut data = 0;
        for (count, yarn) in counts.iter().zip(array(prim, "primvars:yarn")) {
            assert_eq!(
                (*count, yarn),
                (f64::from(3 * lengths[strand] - 2), f64::from(yarns[strand]))
            );
            let mut last = -1.0;
            for _ in 0..lengths[strand] {
                assert!(near(points[next], draped[point], 0.6e-4));
                assert!(
                    (0..3).all(|k| extent[k] < points[next][k] && points[next][k] < extent[3 + k])
                );
                if kinds[point] != u8::MAX {
                    assert_eq!(course[data], f64::from(courses[point].cast_signed()));
                }
                assert!(st[2 * data + 1] >= last, "lengths grow along the yarn");
                last = st[2 * data + 1];
                (next, data, point) = (next + 3, data + 1, point + 1);
            }
            // The last point of a curve is followed by the next one's first.
            next -= 2;
            strand += 1;
        }
        assert_eq!((next, data), (points.len(), course.len()));
    }
    assert_eq!((point, strand), (draped.len(), lengths.len()));
}

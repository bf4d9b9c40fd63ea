//! Writes OBJ files, in centimetres, y up.
//!
//! In: a pattern and its draped positions. Out: either two files, flat and draped, whose vertices
//! and faces correspond one to one, or one file whose `v` are draped and welded at the seams and
//! whose `vt` are the flat pattern; and a body. Four decimals (a micrometre) change the stretch of a
//! 5 mm edge by at most 0.03 %.

use std::{fmt::Write as _, fs, path::Path};

use anyhow::{Context, Result};
use glam::DVec3;

use crate::pattern::Garment;
use crate::surface::Surface;

/// Writes the pair and returns how many bytes both take.
pub(crate) fn pair(
    folder: &Path,
    name: &str,
    garment: &Garment,
    draped: &[DVec3],
) -> Result<usize> {
    let flat: Vec<DVec3> = garment.flat.iter().map(|point| point.extend(0.0)).collect();
    let mut bytes = 0;
    for (kind, positions) in [("flat", &flat[..]), ("draped", draped)] {
        let mut text = header(&format!(
            "{name}, {kind}; its vertices and faces are those of the other file of the pair"
        ));
        for piece in &garment.pieces {
            push(&mut text, format_args!("o {}\n", piece.name));
            for &position in &positions[piece.vertices.clone()] {
                vertex(&mut text, position);
            }
            for &triangle in &garment.triangles[piece.triangles.clone()] {
                let [a, b, c] = triangle.map(|vertex| vertex + 1);
                push(&mut text, format_args!("f {a} {b} {c}\n"));
            }
        }
        bytes += store(&folder.join(format!("{name}_{kind}.obj")), &text)?;
    }
    Ok(bytes)
}

/// Writes one file with the pattern as texture coordinates and returns its bytes.
pub(crate) fn with_pattern(
    folder: &Path,
    name: &str,
    garment: &Garment,
    draped: &[DVec3],
) -> Result<usize> {
    let mut text =
        header(&format!("{name}: v draped, vt the flat pattern in cm, panels side by side"));
    let (particle_of, count) = garment.welded();
    let mut written = 0;
    for (&particle, &position) in particle_of.iter().zip(draped) {
        // Particles are numbered in the order of their first vertex.
        if particle as usize == written {
            vertex(&mut text, position);
            written += 1;
        }
    }
    assert_eq!(written, count, "every particle has a vertex");
    for point in &garment.flat {
        push(&mut text, format_args!("vt {:.4} {:.4}\n", point.x, point.y));
    }
    for piece in &garment.pieces {
        push(&mut text, format_args!("o {}\n", piece.name));
        for triangle in &garment.triangles[piece.triangles.clone()] {
            let [a, b, c] = triangle.map(|vertex| (particle_of[vertex as usize] + 1, vertex + 1));
            push(&mut text, format_args!("f {}/{} {}/{} {}/{}\n", a.0, a.1, b.0, b.1, c.0, c.1));
        }
    }
    store(&folder.join(format!("{name}.obj")), &text)
}

/// Writes the body in a garment and returns its bytes.
pub(crate) fn body(folder: &Path, name: &str, body: &Surface) -> Result<usize> {
    let mut text = header(&format!("the body in {name}"));
    body.vertices.iter().for_each(|&place| vertex(&mut text, place));
    for quad in &body.quads {
        let [a, b, c, d] = quad.map(|vertex| vertex + 1);
        push(&mut text, format_args!("f {a} {b} {c} {d}\n"));
    }
    store(&folder.join(format!("{name}_body.obj")), &text)
}

/// The comment lines at the beginning of a file.
fn header(what: &str) -> String {
    format!(
        "# {what}\n# Made by warpknit's example make_meshes. Unit: 1 cm, y up. Licence: CC0 1.0.\n"
    )
}

/// Adds a vertex.
fn vertex(text: &mut String, position: DVec3) {
    push(text, format_args!("v {:.4} {:.4} {:.4}\n", position.x, position.y, position.z));
}

/// Adds formatted text.
fn push(text: &mut String, arguments: std::fmt::Arguments) {
    text.write_fmt(arguments).expect("a string takes any text");
}

/// Writes a file and returns its bytes.
fn store(path: &Path, text: &str) -> Result<usize> {
    fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))?;
    Ok(text.len())
}

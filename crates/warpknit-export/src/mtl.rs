//! What stands beside an `.obj`: its materials (`.mtl`), one a bar, and the base colours of yarns
//! that wear pictures.
//!
//! Roughness is told both ways, by Phong's exponent (`Ns`) for the many readers that know no other,
//! and by `Pr`, which Blender reads.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use super::texture::{Texture, Wardrobe};
use super::{ExportError, Output};
use warpknit_core::fabric::Fabric;
use warpknit_render::cloth::ROUGHNESS;

/// The files that come with the `.obj` of cloth whose yarns wear so many pictures: `skirt.mtl`,
/// `skirt-yarn-1.png` and so on.
#[must_use]
pub fn companions(obj: &Path, pictures: usize) -> Vec<PathBuf> {
    let beside = |ending: String| {
        let mut name = obj.file_stem().unwrap_or_default().to_owned();
        name.push(ending);
        obj.with_file_name(name)
    };
    std::iter::once(".mtl".to_owned())
        .chain((1..=pictures).map(|number| format!("-yarn-{number}.png")))
        .map(beside)
        .collect()
}

/// Writes them: whole, but still under their temporary names.
pub(super) fn write(
    obj: &Path,
    fabric: &Fabric,
    wardrobe: &Wardrobe,
) -> Result<Vec<Output>, ExportError> {
    let paths = companions(obj, wardrobe.textures.len());
    let text = text(fabric, wardrobe, &paths[1..]);
    let pictures =
        wardrobe.textures.iter().map(|texture| texture.pictures[Texture::BASE].as_slice());
    let contents = std::iter::once(text.as_bytes()).chain(pictures);
    let whole = |(path, bytes): (&PathBuf, &[u8])| {
        let mut output = Output::create(path)?;
        output.write_with(|file| file.write_all(bytes))?;
        output.seal()
    };
    paths.iter().zip(contents).map(whole).collect()
}

/// The first line of an `.obj`, which names its `.mtl`.
pub(super) fn reference(obj: &Path) -> String {
    format!("mtllib {}\n", name(&companions(obj, 0)[0]))
}

fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

fn text(fabric: &Fabric, wardrobe: &Wardrobe, pictures: &[PathBuf]) -> String {
    let mut text = String::from("# yarns by warpknit\n");
    for (yarn, number) in fabric.yarns().zip(1..) {
        let worn = wardrobe.worn_by(number - 1);
        let [r, g, b] = worn.map_or(yarn.color.linear(), |_| [1.0; 3]);
        // The exponent whose highlight is as wide: 2 / roughness^4 - 2.
        let exponent = 2.0 / ROUGHNESS.powi(4) - 2.0;
        write!(text, "newmtl bar_{number}\nKd {r} {g} {b}\nKs 0.04 0.04 0.04\nNs {exponent:.3}\nPr {ROUGHNESS}\nillum 2\n")
            .expect("text takes all text");
        if let Some(place) = worn {
            writeln!(text, "map_Kd {}", name(&pictures[place])).expect("text takes all text");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn companions_are_named_after_their_obj() {
        let named = companions(Path::new("out/skirt.v2.obj"), 2);
        assert_eq!(
            named,
            ["out/skirt.v2.mtl", "out/skirt.v2-yarn-1.png", "out/skirt.v2-yarn-2.png"]
                .map(PathBuf::from)
        );
    }
}

//! The companions of an `.obj`: its materials (`.mtl`), one a bar, and the base colours of yarns
//! that have textures.
//!
//! The format is Alias|Wavefront's ("Advanced Visualizer Manual", appendix B5, "MTL material
//! format", version 4.2). It has no roughness, so roughness is written in two ways: as the Phong
//! exponent `Ns`, which every reader knows, and as `Pr` of the later extension for physically based
//! rendering, which Blender reads.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use super::texture::{Texture, TextureSet};
use super::{ClothInfo, Format, StrandStyle, bcc};
use warpknit_render::cloth::ROUGHNESS;

/// The `.obj` whose companions they are, where its path is not known.
const UNNAMED: &str = "yarns.obj";
const UNNAMED_BCC: &str = "yarns.bcc";

/// A file that belongs beside another one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Companion<'c> {
    /// In the same folder as the file it belongs to, which names it.
    pub path: PathBuf,
    /// All of it.
    pub bytes: Cow<'c, [u8]>,
}

impl Companion<'_> {
    /// The same with bytes of its own.
    #[must_use]
    pub fn into_owned(self) -> Companion<'static> {
        Companion { path: self.path, bytes: Cow::Owned(self.bytes.into_owned()) }
    }
}

/// The paths of the companions of an `.obj` with so many textures: `skirt.mtl`, `skirt-yarn-1.png`
/// and so on.
#[must_use]
pub fn paths(obj: &Path, textures: usize) -> Vec<PathBuf> {
    let stem = obj.file_stem().unwrap_or_default();
    let mut endings = vec![".mtl".to_owned()];
    endings.extend((1..=textures).map(|number| format!("-yarn-{number}.png")));
    endings
        .into_iter()
        .map(|ending| {
            let mut name = stem.to_owned();
            name.push(ending);
            obj.with_file_name(name)
        })
        .collect()
}

/// The companions of a file of that format and path: none but for an `.obj`, and a `.bcc`, whose is
/// [`bcc::companion`]. Without a path they
/// are `yarns.mtl`, `yarns-yarn-1.png` and so on.
#[must_use]
pub fn companions<'c>(
    format: Format,
    path: Option<&Path>,
    cloth: &'c ClothInfo<'_>,
) -> Vec<Companion<'c>> {
    let no_textures = TextureSet::default();
    let textures = match format {
        Format::Obj => &*cloth.textures,
        Format::Bcc => return vec![bcc::companion(path.unwrap_or(Path::new(UNNAMED_BCC)), cloth)],
        // A line has no surface to put a picture on.
        Format::ObjLines => &no_textures,
        _ => return Vec::new(),
    };
    let paths = paths(path.unwrap_or(Path::new(UNNAMED)), textures.textures.len());
    let text = materials(&cloth.strands, textures, &paths[1..]);
    let pictures = if format == Format::Obj { cloth.textures.textures.as_slice() } else { &[] };
    let pictures = pictures.iter().map(|texture| Cow::from(&texture.pictures[Texture::BASE]));
    let contents = std::iter::once(Cow::from(text.into_bytes())).chain(pictures);
    paths.into_iter().zip(contents).map(|(path, bytes)| Companion { path, bytes }).collect()
}

/// What an `.obj` begins with: a comment, and the name of its `.mtl`.
pub(super) fn obj_beginning(obj: Option<&Path>) -> String {
    let mtl = &paths(obj.unwrap_or(Path::new(UNNAMED)), 0)[0];
    format!("# yarns by warpknit, mm\nmtllib {}\n", name(mtl))
}

fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// The `.mtl`'s text.
fn materials(strands: &[StrandStyle], textures: &TextureSet, pictures: &[PathBuf]) -> String {
    // The exponent whose highlight is as wide: 2 / roughness^4 - 2.
    let exponent = 2.0 / ROUGHNESS.powi(4) - 2.0;
    let mut text = String::from("# yarns by warpknit\n");
    for (bar, style) in strands.iter().enumerate() {
        let texture = textures.texture_of(bar);
        // A picture is multiplied by `Kd`, so that is white where there is one. `Ks` is the
        // reflectance of most fibres head-on, 4 %.
        let [r, g, b] = texture.map_or(style.color.linear(), |_| [1.0; 3]);
        let number = bar + 1;
        write!(
            text,
            "newmtl bar_{number}\nKd {r} {g} {b}\nKs 0.04 0.04 0.04\n\
             Ns {exponent:.3}\nPr {ROUGHNESS}\nillum 2\n"
        )
        .expect("text takes all text");
        if let Some(place) = texture {
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
        let named = paths(Path::new("out/skirt.v2.obj"), 2);
        assert_eq!(
            named,
            ["out/skirt.v2.mtl", "out/skirt.v2-yarn-1.png", "out/skirt.v2-yarn-2.png"]
                .map(PathBuf::from)
        );
    }
}

//! A fabric as a material that other programs take: its maps, and files that name them.
//!
//! In: a [`FabricMaterial`], that is [`FabricMaps`] with the cloth's name and numbers. Out:
//! [`MaterialFile`]s, whose names are relative to one folder:
//!
//! - `textures/front_base_color.png` and so on: eight maps for each side, RGB as U3M asks, 8 bits a
//!   channel and 16 for heights. PNG's `pHYs` chunk holds the true size.
//! - `.u3m`: U3M 1.1, and `.u3ma`: the same with its pictures in one archive (`u3m`, `u3ma`).
//! - `.mtlx`: MaterialX 1.39 with OpenPBR surfaces (`mtlx`).
//! - `.glb`: glTF 2.0, a plane with a material on each side; pictures are inside (`gltf`).
//! - `.usda`: USD preview materials on such a plane (`usd`).
//!
//! Cost: compression of the maps. Not promised: one look in all programs. They light a surface by
//! models of their own.

mod gltf;
mod maps;
mod mtlx;
mod u3m;
mod u3ma;
mod usd;

use glam::DVec2;
use rayon::prelude::*;

use warpknit_render::fabric_maps::{FabricMaps, Side};

pub use maps::{Means, Role};
pub use u3ma::UtcTime;

/// Length of the plane's sides in `.glb` and `.usda`, mm, rounded to whole repeats.
const PLANE: f64 = 100.0;
/// How widely fibres that stand off a yarn scatter light, where a format asks: as in files of tubes.
const SHEEN_ROUGHNESS: f64 = 0.5;

/// A fabric as a material.
#[derive(Clone, Debug)]
pub struct FabricMaterial<'a> {
    /// Its name, which is also that of its files: letters, digits, `-` and `_`.
    pub name: String,
    /// One line about it.
    pub about: &'a str,
    /// How it is made.
    pub making: Making,
    /// Its maps.
    pub maps: &'a FabricMaps,
    /// Its picture, PNG, and the picture's width and height in mm and in pixels.
    pub preview: Preview,
    /// g/m².
    pub mass: f64,
    /// Thickness of the cloth, mm.
    pub thickness: f64,
    /// A number of the fabric, the same for the same fabric.
    pub id: u128,
    /// When it is made.
    pub time: UtcTime,
}

/// A picture of the material.
#[derive(Clone, Debug)]
pub struct Preview {
    /// PNG.
    pub png: Vec<u8>,
    /// Width and height of the cloth that it shows, mm.
    pub size: DVec2,
    /// Width and height, pixels.
    pub pixels: [u32; 2],
}

/// How a fabric is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Making {
    /// A warp knit.
    WarpKnit,
    /// A weft knit.
    WeftKnit,
    /// Laid yarns, as in woven cloth.
    Laid,
}

/// A file of a material.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MaterialFile {
    /// Its name in the material's folder, with `/` between folders.
    pub name: String,
    /// Its bytes.
    pub bytes: Vec<u8>,
}

/// Name of the picture of the material.
pub const PREVIEW: &str = "preview.png";

impl FabricMaterial<'_> {
    /// All files of the material, its pictures first.
    #[must_use]
    pub fn files(&self) -> Vec<MaterialFile> {
        let wanted: Vec<_> =
            Side::BOTH.iter().flat_map(|&side| Role::ALL.map(|role| (side, role))).collect();
        let dpi = self.maps.dpi();
        let mut files: Vec<MaterialFile> = wanted
            .into_par_iter()
            .map(|(side, role)| MaterialFile {
                name: role.path(side),
                bytes: maps::png(self.maps.side(side), role, dpi),
            })
            .collect();
        files.push(MaterialFile { name: PREVIEW.to_owned(), bytes: self.preview.png.clone() });
        files.push(self.file("u3m", u3m::text(self).into_bytes()));
        let archive = u3ma::archive(&files, self.time);
        files.extend([
            self.file("u3ma", archive),
            self.file("mtlx", mtlx::text(self).into_bytes()),
            self.file("glb", gltf::bytes(self)),
            self.file("usda", usd::text(self).into_bytes()),
        ]);
        files
    }

    fn file(&self, ending: &str, bytes: Vec<u8>) -> MaterialFile {
        MaterialFile { name: format!("{}.{ending}", self.name), bytes }
    }

    /// How often the repeat lies on the plane, across and up.
    fn repeats(&self) -> DVec2 {
        (DVec2::splat(PLANE) / self.maps.size).round().max(DVec2::ONE)
    }

    /// Width and height of the plane, mm.
    fn plane(&self) -> DVec2 {
        self.repeats() * self.maps.size
    }
}

/// A number with six digits after the point at most, as all of these formats read it.
fn decimal(number: f64) -> f64 {
    (number * 1e6).round() / 1e6
}

/// A text as the name of a material's files: what is no letter, digit, `-` or `_` becomes `_`.
///
/// ```
/// use warpknit_export::material::file_name;
/// assert_eq!(file_name("3-4/1-0// + 1-0/1-2//"), "3-4_1-0_1-0_1-2");
/// assert_eq!(file_name("//"), "fabric");
/// ```
#[must_use]
pub fn file_name(text: &str) -> String {
    let is_plain = |letter: char| letter.is_ascii_alphanumeric() || matches!(letter, '-' | '_');
    let words: Vec<&str> =
        text.split(|letter| !is_plain(letter)).filter(|word| !word.is_empty()).collect();
    // File systems take 255 bytes, endings included.
    let name: String = words.join("_").chars().take(100).collect();
    if name.is_empty() { "fabric".to_owned() } else { name }
}

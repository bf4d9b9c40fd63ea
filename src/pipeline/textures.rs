//! The maps that yarns are drawn with, and the scene that wears them.
//!
//! In: a fabric that names them, or a folder for all yarns. Out: [`Textures`], and an empty
//! [`Scene`] with the looks of the fabric's yarns.

use std::path::Path;

use super::RunError;
use crate::fabric::Fabric;
use crate::fabric::yarn::Yarn;
use crate::photo::yarn::read_maps;
use crate::render::cloth;
use crate::render::maps::Maps;
use crate::render::scene::{Scene, Shape};

/// Widths of pictures that fit a yarn, in thicknesses of the yarn: from hardly any fuzz to loops
/// that stand far off.
const FITTING_WIDTHS: (f64, f64) = (0.8, 4.0);
/// The maps of a fabric's yarns, as large as the yarns really are.
#[derive(Debug, Default)]
pub struct Textures {
    maps: Vec<Maps>,
    /// Each bar's place in `maps`, the last one for all bars after it too.
    of_bars: Vec<Option<u16>>,
}

impl Textures {
    /// The chosen maps, for all bars, or else those that the fabric names.
    ///
    /// Where nothing says how wide a picture is, it fits the yarn that wears it, the thickest if
    /// all do.
    ///
    /// # Errors
    /// Maps that can't be read.
    pub fn read(chosen: Option<&Path>, fabric: &Fabric) -> Result<Self, RunError> {
        let thickest = 2.0 * fabric.radius() / fabric.enlargement;
        match chosen {
            Some(path) => Ok(Self::for_all(read_maps(path, thickest, None)?)),
            None => Self::named_by(fabric, thickest),
        }
    }

    /// One yarn's pictures for all bars.
    #[must_use]
    pub fn for_all(maps: Maps) -> Self {
        Self { maps: vec![maps], of_bars: vec![Some(0)] }
    }

    /// Those that a fabric whose yarns are `thickest` mm thick at the most names, each read once.
    fn named_by(fabric: &Fabric, thickest: f64) -> Result<Self, RunError> {
        let mut textures = Self::default();
        let mut worn: Vec<&Yarn> = Vec::new();
        for ((own, thickness), number) in fabric.yarns().zip(fabric.thickness()).zip(1..) {
            let Some(path) = &own.texture else {
                textures.of_bars.push(None);
                continue;
            };
            let place = worn.iter().position(|yarn| *yarn == own).unwrap_or(worn.len());
            if place == worn.len() {
                let maps = read_maps(path, thickest * thickness, own.texture_length)
                    .map_err(|source| RunError::MapsOfBar { bar: number, source })?;
                textures.maps.push(maps);
                worn.push(own);
            }
            textures.of_bars.push(u16::try_from(place).ok());
        }
        Ok(textures)
    }

    /// What is odd about ribbons as wide as the pictures say in place of a fabric's yarns, for the
    /// first such bar.
    #[must_use]
    pub fn misfit(&self, fabric: &Fabric) -> Option<String> {
        fabric.thickness().into_iter().enumerate().find_map(|(bar, thickness)| {
            let shown = f64::from(self.maps[usize::from(self.of_bar(bar)?)].width);
            let thick = 2.0 * thickness * fabric.radius() / fabric.enlargement;
            let (least, most) = FITTING_WIDTHS;
            let message = || {
                format!(
                    "bar {}: its pictures are of a yarn {shown:.2} mm wide with its fuzz, but its yarns are {thick:.2} mm thick; ribbons are as wide as the \
                     pictures: width_mm in their yarn.toml says how wide",
                    bar + 1
                )
            };
            (!(least * thick..=most * thick).contains(&shown)).then(message)
        })
    }

    /// How many different yarns have pictures.
    #[must_use]
    pub fn count(&self) -> usize {
        self.maps.len()
    }

    fn of_bar(&self, bar: usize) -> Option<u16> {
        self.of_bars.get(bar).or(self.of_bars.last()).copied().flatten()
    }
}

/// The scene that a fabric's yarns go into, the thickest of that radius, with their pictures: those
/// are as much enlarged as the cloth.
#[must_use]
pub fn scene(shape: Shape, fabric: &Fabric, radius: f64, textures: &Textures) -> Scene {
    let looks = cloth::looks(fabric, radius);
    #[expect(clippy::cast_possible_truncation, reason = "a length in mm needs no more")]
    let enlargement = fabric.enlargement as f32;
    let enlarged = |maps: &Maps| Maps {
        length: enlargement * maps.length,
        width: enlargement * maps.width,
        ..maps.clone()
    };
    Scene::with_textures(shape, looks, textures.maps.iter().map(enlarged).collect(), |bar| {
        textures.of_bar(bar)
    })
}

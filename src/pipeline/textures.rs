//! The maps with which yarns are drawn, and the empty scene that has them.
//!
//! In: a fabric whose yarns name maps, or one folder of maps for all yarns. Out: [`Textures`], and
//! an empty [`Scene`] with the looks of the fabric's yarns.

use std::path::Path;

use super::RunError;
use crate::fabric::Fabric;
use crate::fabric::yarn::Yarn;
use crate::photo::yarn::read_maps;
use crate::render::cloth;
use crate::render::maps::Maps;
use crate::render::scene::{Scene, Shape};

/// Widths of maps that are plausible for a yarn, in thicknesses of the yarn. A smooth yarn is at the
/// lower end; a yarn whose fuzz or loops stand far off is at the upper one. Outside this range
/// [`Textures::misfit`] warns.
const FITTING_WIDTHS: (f64, f64) = (0.8, 4.0);

/// The maps of a fabric's yarns, at the true size of the yarns.
#[derive(Debug, Default)]
pub struct Textures {
    maps: Vec<Maps>,
    /// Index in `maps` for each bar. The last entry also counts for all bars after it.
    of_bars: Vec<Option<u16>>,
}

impl Textures {
    /// Reads the chosen maps, for all bars, or else those that the fabric names.
    ///
    /// Maps of unknown width become as wide as the yarn that uses them. If all yarns use the same
    /// maps, that is the thickest one.
    ///
    /// # Errors
    /// [`RunError::Maps`] or [`RunError::MapsOfBar`] if maps can't be read.
    pub fn read(chosen: Option<&Path>, fabric: &Fabric) -> Result<Self, RunError> {
        let thickest = 2.0 * fabric.radius() / fabric.enlargement;
        match chosen {
            Some(path) => Ok(Self::for_all(read_maps(path, thickest, None)?)),
            None => Self::named_by(fabric, thickest),
        }
    }

    /// The maps of one yarn, for all bars.
    #[must_use]
    pub fn for_all(maps: Maps) -> Self {
        Self { maps: vec![maps], of_bars: vec![Some(0)] }
    }

    /// The maps that a fabric names. `thickest` is the diameter of its thickest yarn, mm.
    fn named_by(fabric: &Fabric, thickest: f64) -> Result<Self, RunError> {
        let mut textures = Self::default();
        // The yarns whose maps are read already, in the order of `maps`: bars that share a yarn
        // share its maps.
        let mut known: Vec<&Yarn> = Vec::new();
        for ((own, thickness), number) in fabric.yarns().zip(fabric.thickness()).zip(1..) {
            let Some(path) = &own.texture else {
                textures.of_bars.push(None);
                continue;
            };
            let place = known.iter().position(|yarn| *yarn == own).unwrap_or(known.len());
            if place == known.len() {
                let maps = read_maps(path, thickest * thickness, own.texture_length)
                    .map_err(|source| RunError::MapsOfBar { bar: number, source })?;
                textures.maps.push(maps);
                known.push(own);
            }
            textures.of_bars.push(u16::try_from(place).ok());
        }
        Ok(textures)
    }

    /// A warning about the first bar whose maps are much wider or narrower than its yarn. Ribbons
    /// have the width of the maps, so they would look wrong.
    #[must_use]
    pub fn misfit(&self, fabric: &Fabric) -> Option<String> {
        fabric.thickness().into_iter().enumerate().find_map(|(bar, thickness)| {
            let shown = f64::from(self.maps[usize::from(self.of_bar(bar)?)].width);
            let thick = 2.0 * thickness * fabric.radius() / fabric.enlargement;
            let (least, most) = FITTING_WIDTHS;
            if (least * thick..=most * thick).contains(&shown) {
                return None;
            }
            Some(format!(
                "bar {}: its pictures are of a yarn {shown:.2} mm wide with its fuzz, but its yarns \
                 are {thick:.2} mm thick; ribbons are as wide as the pictures: width_mm in their \
                 yarn.toml says how wide",
                bar + 1
            ))
        })
    }

    /// Number of different maps.
    #[must_use]
    pub fn count(&self) -> usize {
        self.maps.len()
    }

    /// Index of a bar's maps. `None` if its yarn has none.
    fn of_bar(&self, bar: usize) -> Option<u16> {
        self.of_bars.get(bar).or(self.of_bars.last()).copied().flatten()
    }
}

/// The empty scene for a fabric's yarns, with their looks and maps. `radius` is that of the thickest
/// yarn. The maps are enlarged as much as the cloth.
#[must_use]
pub fn scene(shape: Shape, fabric: &Fabric, radius: f64, textures: &Textures) -> Scene {
    let looks = cloth::looks(fabric, radius);
    #[expect(clippy::cast_possible_truncation, reason = "a length in mm needs no more")]
    let enlargement = fabric.enlargement as f32;
    let maps = textures.maps.iter().map(|maps| enlarged(maps, enlargement)).collect();
    Scene::with_textures(shape, looks, maps, |bar| textures.of_bar(bar))
}

/// Maps so many times as long and wide.
fn enlarged(maps: &Maps, enlargement: f32) -> Maps {
    Maps { length: enlargement * maps.length, width: enlargement * maps.width, ..maps.clone() }
}

//! What files say of a cloth besides its points.
//!
//! In: a fabric, and where fibres are written the bundles that fill its yarns. Out: a [`ClothInfo`]
//! that serves every format. Writers see no [`Fabric`], so that yarns and fibres are the same to
//! them.

use std::sync::Arc;

use super::axes::Axes;
use super::facts::Facts;
use super::glb::GlbOptions;
use super::inp::InpDialect;
use super::npz::NpzOptions;
use super::texture::TextureSet;
use super::usd_stage::UsdCurves;
use warpknit_core::fabric::Fabric;
use warpknit_core::fabric::yarn::{Color, Yarn};
use warpknit_core::garment::Panel;
use warpknit_core::number::narrow;
use warpknit_core::yarn::fibres::Bundle;
use warpknit_core::yarn::tube::Section;

/// St and Sr of tubes in files, if no others are asked for.
const FILE_ST: u32 = 10;
const FILE_SR: u32 = 6;

/// The tubes that files hold if no others are asked for: round, open, and with texture coordinates
/// in millimetres of yarn.
#[must_use]
pub fn default_section(radius: f64) -> Section {
    Section { st: FILE_ST, sr: FILE_SR, radius, flatten: 1.0, caps: false, texture_per_mm: 1.0 }
}

/// How the strands of one yarn system (a bar) look and what they are made of.
#[derive(Clone, Debug, PartialEq)]
pub struct StrandStyle {
    /// Its name, for formats whose names are free text; the others number the bars.
    pub name: String,
    /// Colour, sRGB.
    pub color: Color,
    /// Radius of a strand, mm.
    pub radius: f64,
    /// Mass over volume of the strand, air included, g/cm³.
    pub density: f64,
    /// Mass of a kilometre of the strand, g. Strands of enlarged cloth are as heavy as leaves the
    /// mass of the cloth.
    pub tex: f64,
    /// Young's modulus of its fibres, GPa.
    pub modulus: f64,
    /// Share of its section that is fibre.
    pub packing: f64,
}

impl StrandStyle {
    fn new(number: usize, yarn: &Yarn, radius: f64) -> Self {
        Self {
            name: format!("bar {number}"),
            color: yarn.color,
            radius,
            density: yarn.density * yarn.packing,
            tex: yarn.tex_in_cloth(),
            modulus: yarn.modulus_gpa(),
            packing: yarn.packing,
        }
    }

    /// The styles of a fabric's yarns, one a bar, where the thickest has that radius.
    #[must_use]
    pub fn from_fabric(fabric: &Fabric, radius: f64) -> Vec<Self> {
        let yarns = fabric.yarns().zip(fabric.thickness()).zip(1..);
        yarns
            .map(|((yarn, thickness), number)| {
                let style = Self::new(number, yarn, radius * thickness);
                Self { tex: style.tex * fabric.enlargement, ..style }
            })
            .collect()
    }

    /// The styles of the fibres in a fabric's yarns, one a bar. Their density is that of their
    /// yarn.
    #[must_use]
    pub fn from_bundles(fabric: &Fabric, bundles: &[Bundle]) -> Vec<Self> {
        let yarns = fabric.yarns().zip(bundles).zip(1..);
        let style = |((yarn, bundle), number): ((&Yarn, &Bundle), usize)| {
            let style = Self::new(number, yarn, bundle.fibre);
            // A kilometre of a mm² holds 1000 cm³.
            let section = std::f64::consts::PI * bundle.fibre * bundle.fibre;
            Self { tex: 1000.0 * yarn.density * section, packing: 1.0, ..style }
        };
        yarns.map(style).collect()
    }

    /// Radius as files hold it, mm.
    pub(super) fn radius_f32(&self) -> f32 {
        narrow(self.radius)
    }
}

/// How many blocks and yarns are to come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Expected {
    /// [`warpknit_core::drape::Cloth::blocks`].
    pub blocks: usize,
    /// [`warpknit_core::drape::Cloth::yarns`].
    pub yarns: usize,
}

/// What files say of a cloth besides its points.
#[derive(Clone, Debug)]
pub struct ClothInfo<'a> {
    /// The cloth's name.
    pub name: String,
    /// One a bar, front first.
    pub strands: Vec<StrandStyle>,
    /// How fine tubes and centre lines are; the radius is the thickest strand's.
    pub section: Section,
    /// The yarns' pictures, for formats that hold textures.
    pub textures: Arc<TextureSet>,
    /// What fills each bar's yarns, where files hold fibres in the place of yarns; else empty.
    pub bundles: Vec<Bundle>,
    /// How much is to come at the most, where it is known. A `.glb` keeps room for as much, and
    /// refuses more; without this its body waits in a temporary file and is copied at the end.
    pub expected: Option<Expected>,
    /// The curves of `.usda` and `.usdc`.
    pub usd_curves: UsdCurves,
    /// Whose keywords an `.inp` has.
    pub inp: InpDialect,
    /// Unit and upright axis of `.ply` and `.obj`.
    pub axes: Axes,
    /// How a `.glb` holds its meshes.
    pub glb: GlbOptions,
    /// How an `.npz` holds its arrays.
    pub npz: NpzOptions,
    /// What a page says of the fabric in words and numbers. By default nothing.
    pub facts: Facts,
    /// The garment's panels: `.npz` and `.csv` take triangles and flat coordinates from them.
    pub panels: &'a [Panel],
}

impl<'a> ClothInfo<'a> {
    /// A fabric's yarns, the thickest of which has the section's radius, without textures.
    #[must_use]
    pub fn from_fabric(fabric: &Fabric, section: Section) -> Self {
        Self {
            name: fabric.name.clone(),
            strands: StrandStyle::from_fabric(fabric, section.radius),
            section,
            textures: Arc::default(),
            bundles: Vec::new(),
            expected: None,
            usd_curves: UsdCurves::default(),
            inp: InpDialect::default(),
            axes: Axes::default(),
            glb: GlbOptions::default(),
            npz: NpzOptions::default(),
            facts: Facts::default(),
            panels: &[],
        }
    }

    /// The fibres of a fabric's yarns. Of the section only Sr and caps count: fibres are round,
    /// have one segment between points, and are as thick as their bundle says.
    #[must_use]
    pub fn from_bundles(fabric: &Fabric, bundles: Vec<Bundle>, section: Section) -> Self {
        let radius = bundles.iter().map(|bundle| bundle.fibre).fold(0.0, f64::max);
        let section = Section { st: 1, radius, flatten: 1.0, ..section };
        Self {
            strands: StrandStyle::from_bundles(fabric, &bundles),
            bundles,
            ..Self::from_fabric(fabric, section)
        }
    }

    /// The same of a cloth on these panels.
    #[must_use]
    pub fn on_panels(self, panels: &'a [Panel]) -> Self {
        Self { panels, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use warpknit_core::drape::fibres::bundles;

    #[test]
    fn yarns_keep_their_proportions_and_fibres_are_as_thick_as_their_bundles() {
        let fabric = Fabric::named("locknit").unwrap();
        let yarns = StrandStyle::from_fabric(&fabric, 0.2);
        let thickest = yarns.iter().map(|style| style.radius).fold(0.0, f64::max);
        assert!((thickest - 0.2).abs() < 1e-15);
        assert_eq!(yarns[1].name, "bar 2");
        let bundles = bundles(&fabric, 0.2, 0.01);
        let section = Section { st: 7, sr: 4, ..default_section(0.2) };
        let fibres = ClothInfo::from_bundles(&fabric, bundles.clone(), section);
        for (style, bundle) in fibres.strands.iter().zip(&bundles) {
            assert_eq!(style.radius.to_bits(), bundle.fibre.to_bits());
        }
        assert_eq!((fibres.section.st, fibres.section.sr), (1, 4));
        assert!((fibres.section.radius - 0.01).abs() < 1e-3);
    }
}

//! Fabrics as a designer names them: the structure of their yarns, and the densities of the cloth.
//!
//! In: a TOML file ([`Fabric::read`]) or a built-in name ([`Fabric::named`]). Out: a checked
//! [`Fabric`], which is a warp knit, a weft knit or laid cloth ([`Structure`]). The drawn radius of
//! its yarns follows from the densities ([`Fabric::radius`]); masses always follow from the yarns'
//! counts.

mod bar;
pub mod builtin;
mod changes;
mod checks;
mod dimensions;
mod error;
mod file;
mod finish;
pub mod lapping;
mod limits;
pub mod motif;
mod structure;
pub mod threading;
pub mod yarn;
mod yarn_cover;

use std::fmt;
use std::path::Path;

use glam::DVec2;

use file::FabricFile;
use yarn::Yarn;

pub(crate) use bar::RACK;
pub use bar::{Bar, Lay};
pub use changes::chains;
pub use checks::Needles;
pub use dimensions::Dimensions;
pub use error::{FabricError, FabricFault, Place};
pub use finish::{Finish, Machine};
pub use limits::{MAX_BARS, MAX_LAPS, MAX_LOOPS, MAX_PATH, MAX_REPEAT, MAX_THREADING};
pub use structure::{
    Feeder, LaidCloth, LaidStrand, StrandDirection, Structure, WarpKnit, WeftKnit,
};

const INCH_IN_CM: f64 = 2.54;

// The thickest radius for which knits are laid out, over W and over C. At a radius of 0.14 W the
// lower legs of a loop would touch each other (w2 of the stitch), and no other yarn could pass
// between them.
const THICKEST_ACROSS: f64 = 0.12;
const THICKEST_ALONG: f64 = 0.2;

/// A fabric: the structure of its yarns, and how densely they lie in the cloth.
#[derive(Clone, Debug, PartialEq)]
pub struct Fabric {
    /// The name by which the command line knows it.
    pub name: String,
    /// One line about it.
    pub about: String,
    /// Wales per centimetre of the finished cloth.
    pub wales_per_cm: f64,
    /// Needles an inch, where the wales were given so: `wales_per_cm` follows from it and from the
    /// shrinkage of `finish`.
    pub gauge: Option<f64>,
    /// Courses per centimetre of the finished cloth.
    pub courses_per_cm: f64,
    /// What finishing does to it.
    pub finish: Finish,
    /// Its yarns, and how they are knitted or laid.
    pub structure: Structure,
    /// Panels on which it lies otherwise than along the garment's grain from the lowest-left
    /// corner.
    pub panels: Vec<PanelLayout>,
    /// How many times the yarns are drawn larger than their count says, for cloth shown at another
    /// scale.
    pub enlargement: f64,
}

/// How the fabric lies on one panel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PanelLayout {
    /// Index of the panel in [`crate::garment::Garment::panels`].
    pub panel: usize,
    /// Whether it is turned over, so that its technical face is on the side away from that to which
    /// the panel's faces are wound.
    pub turn: bool,
    /// The angle of the panel's wales, degrees, counter-clockwise seen from the technical face, on
    /// top of the garment's grain.
    pub grain_degrees: f64,
    /// Position of gap 0 of course 0, mm from the lowest-left corner of the panel once its wales
    /// run upward.
    pub origin: DVec2,
}

impl Fabric {
    /// The built-in fabric of that name; [`builtin::names`] lists them.
    ///
    /// # Errors
    /// [`FabricFault::Unknown`].
    ///
    /// ```
    /// use warpknit_core::fabric::Fabric;
    /// let tricot = Fabric::named("tricot")?;
    /// assert_eq!((tricot.yarn_systems(), tricot.repeat()), (2, 2));
    /// assert!(Fabric::named("tweed").is_err());
    /// # Ok::<(), warpknit_core::fabric::FabricError>(())
    /// ```
    pub fn named(name: &str) -> Result<Self, FabricError> {
        let text = builtin::text(name).ok_or_else(|| FabricFault::Unknown(name.to_owned()))?;
        Self::parse(text)
    }

    /// Reads a fabric file. Relative paths of textures in it start from its folder.
    ///
    /// # Errors
    /// The first fault in it. The caller knows the file's name.
    pub fn read(path: &Path) -> Result<Self, FabricError> {
        let mut fabric = Self::parse(&std::fs::read_to_string(path).map_err(FabricFault::Io)?)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        for texture in fabric.structure.yarns_mut().filter_map(|yarn| yarn.texture.as_mut()) {
            *texture = folder.join(&*texture);
        }
        Ok(fabric)
    }

    /// Reads a fabric from TOML.
    ///
    /// # Errors
    /// The first fault in it.
    ///
    /// ```
    /// use warpknit_core::fabric::Fabric;
    /// let pillar = Fabric::parse(r##"
    ///     name = "pillar"
    ///     wales_per_cm = 8
    ///     courses_per_cm = 12
    ///     [[bars]]
    ///     lapping = "1-0/0-1//"
    ///     yarn = { count = "110 dtex", density = 1.38, packing = 0.65, color = "#d8d0c0" }
    /// "##)?;
    /// assert_eq!(pillar.wale_spacing(), 1.25);
    /// assert!(pillar.warnings().is_empty());
    /// # Ok::<(), warpknit_core::fabric::FabricError>(())
    /// ```
    pub fn parse(text: &str) -> Result<Self, FabricError> {
        file::parse(text)
    }

    /// The yarn of each yarn system (guide bar, feeder or laid strand), front first.
    ///
    /// ```
    /// use warpknit_core::fabric::Fabric;
    /// let locknit = Fabric::named("locknit")?;
    /// assert!(locknit.yarns().all(|yarn| yarn.count.tex() == 4.4));
    /// # Ok::<(), warpknit_core::fabric::FabricError>(())
    /// ```
    pub fn yarns(&self) -> impl ExactSizeIterator<Item = &Yarn> + Clone {
        (0..self.yarn_systems()).map(|system| self.structure.yarn(system))
    }

    /// The yarn of one system.
    ///
    /// # Panics
    /// If there is no such system.
    #[must_use]
    pub fn yarn(&self, system: usize) -> &Yarn {
        self.structure.yarn(system)
    }

    /// How many yarn systems it has: guide bars, feeders or laid strands.
    #[must_use]
    pub fn yarn_systems(&self) -> usize {
        self.structure.yarn_systems()
    }

    /// How a yarn system is laid, as a designer writes it: see [`Structure::lapping`].
    ///
    /// # Panics
    /// If there is no such system.
    #[must_use]
    pub fn lapping(&self, system: usize) -> String {
        self.structure.lapping(system)
    }

    /// The warp knit that it is, if it is one.
    #[must_use]
    pub fn warp_knit(&self) -> Option<&WarpKnit> {
        match &self.structure {
            Structure::Warp(knit) => Some(knit),
            Structure::Weft(_) | Structure::Laid(_) => None,
        }
    }

    /// The weft knit that it is, if it is one.
    #[must_use]
    pub fn weft_knit(&self) -> Option<&WeftKnit> {
        match &self.structure {
            Structure::Weft(knit) => Some(knit),
            Structure::Warp(_) | Structure::Laid(_) => None,
        }
    }

    /// The laid cloth that it is, if it is one.
    #[must_use]
    pub fn laid_cloth(&self) -> Option<&LaidCloth> {
        match &self.structure {
            Structure::Laid(cloth) => Some(cloth),
            Structure::Warp(_) | Structure::Weft(_) => None,
        }
    }

    /// Whether its yarns lie on given paths and nothing is knitted.
    #[must_use]
    pub fn is_laid(&self) -> bool {
        self.laid_cloth().is_some()
    }

    /// Wale spacing W, mm.
    #[must_use]
    pub fn wale_spacing(&self) -> f64 {
        10.0 / self.wales_per_cm
    }

    /// Course spacing C, mm.
    #[must_use]
    pub fn course_spacing(&self) -> f64 {
        10.0 / self.courses_per_cm
    }

    /// The radius for which all of the fabric's yarns are laid out, and with which the thickest is
    /// drawn, mm.
    ///
    /// It is the thickest yarn's own, but in a knit at most the radius that leaves a loop open. The
    /// layout takes one radius for all yarn systems, so that their layers stay apart.
    #[must_use]
    pub fn radius(&self) -> f64 {
        let radius = self.true_radius() * self.enlargement;
        match self.structure {
            Structure::Warp(_) | Structure::Weft(_) => radius
                .min(THICKEST_ACROSS * self.wale_spacing())
                .min(THICKEST_ALONG * self.course_spacing()),
            Structure::Laid(_) => radius,
        }
    }

    /// The drawn radius of each system's yarn over that of the thickest: yarns keep their
    /// proportions, whatever the radius they are laid out for.
    #[must_use]
    pub fn thickness(&self) -> Vec<f64> {
        self.yarns().map(|yarn| yarn.diameter() / 2.0 / self.true_radius()).collect()
    }

    /// The thickest yarn's radius by its count, mm.
    #[must_use]
    pub fn true_radius(&self) -> f64 {
        self.yarns().map(|yarn| yarn.diameter() / 2.0).fold(0.0, f64::max)
    }

    /// Courses after which all yarn systems repeat together.
    #[must_use]
    pub fn repeat(&self) -> usize {
        self.structure.repeat()
    }

    /// Wales after which all yarn systems repeat together: see [`Structure::threading_repeat`].
    #[must_use]
    pub fn threading_repeat(&self) -> usize {
        self.structure.threading_repeat()
    }
}

impl fmt::Display for Fabric {
    /// The fabric as the TOML that [`Fabric::parse`] reads.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text =
            toml::to_string(&FabricFile::from(self)).map_err(|_unserialisable| fmt::Error)?;
        f.write_str(&text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bars(fabric: &Fabric) -> &[Bar] {
        &fabric.warp_knit().unwrap().bars
    }

    #[test]
    fn built_in_fabrics_read_print_and_read_again() {
        for name in builtin::names() {
            let fabric = Fabric::named(name).unwrap();
            assert_eq!(fabric.name, name);
            assert_eq!(Fabric::parse(&fabric.to_string()).unwrap(), fabric);
            assert_eq!(fabric.warnings(), Vec::<String>::new(), "{name}");
        }
    }

    #[test]
    fn a_left_hand_drive_mirrors_and_prints_as_given() {
        let text = Fabric::named("tricot")
            .unwrap()
            .to_string()
            .replace("\"1-2/1-0//\"", "\"1-2/1-0//\"\ndrive = \"left\"");
        let text = text.replacen("drive = \"right\"\n", "", 1);
        let fabric = Fabric::parse(&text).unwrap();
        assert_eq!(bars(&fabric)[0].gaps(), (-2, 0));
        assert_eq!(Fabric::parse(&fabric.to_string()).unwrap(), fabric);
    }

    #[test]
    fn a_left_hand_drive_is_the_mirror_image() {
        let bar = |drive: &str| {
            let yarn = "yarn = { count = \"44 dtex\", density = 1.38, packing = 0.65, \
                        color = \"#ffffff\" }";
            let table = format!(
                "[[bars]]\nlapping = \"1-0/1-2//\"\nthreading = \"II.\"\n{drive}\n{yarn}\n"
            );
            let fabric = Fabric::parse(&format!(
                "name = \"t\"\nwales_per_cm = 10.0\ncourses_per_cm = 10.0\n{table}"
            ))
            .unwrap();
            assert!(!fabric.warnings().iter().any(|warning| warning.contains("no gap 0")));
            bars(&fabric)[0].clone()
        };
        let (right, left) = (bar(""), bar("drive = \"left\""));
        for course in 0..2 {
            for wale in -6..6 {
                // Wale w lies between gaps w and w + 1, so its mirror image is wale -w - 1.
                assert_eq!(
                    right.loops_on(wale, course),
                    left.loops_on(-wale - 1, course),
                    "wale {wale}, course {course}"
                );
            }
        }
    }

    #[test]
    fn a_weft_counts_courses_and_knits_nothing() {
        let text = Fabric::named("tricot").unwrap().to_string().replacen("1-2/1-0//", "weft", 1);
        let fabric =
            Fabric::parse(&text.replacen("threading = \"I\"", "threading = \"I..\"", 1)).unwrap();
        let weft = &bars(&fabric)[0];
        assert!(weft.lay == Lay::Weft && weft.is_inlay() && !weft.loops_on(0, 0));
        assert_eq!((fabric.repeat(), fabric.threading_repeat()), (6, 1));
        assert!(fabric.to_string().contains("lapping = \"weft\""));
        assert_eq!(Fabric::parse(&fabric.to_string()).unwrap(), fabric);
    }

    #[test]
    fn a_needle_without_a_loop_is_named() {
        let text = Fabric::named("tricot")
            .unwrap()
            .to_string()
            .replace("threading = \"I\"", "threading = \"..I\"");
        assert_eq!(Fabric::parse(&text).unwrap().warnings().len(), 1);
    }

    #[test]
    fn a_gauge_is_needles_an_inch() {
        let tricot = Fabric::named("tricot").unwrap();
        let wales = format!("wales_per_cm = {:?}", tricot.wales_per_cm);
        let fabric = Fabric::parse(&tricot.to_string().replace(&wales, "gauge = 28.0")).unwrap();
        assert!((fabric.wale_spacing() - 25.4 / 28.0).abs() < 1e-12);
        assert!(
            fabric.to_string().contains("gauge = 28.0")
                && !fabric.to_string().contains("wales_per_cm")
        );
        assert!(
            fabric.at_densities(10.0, 10.0).unwrap().to_string().contains("wales_per_cm = 10.0")
        );
    }
}

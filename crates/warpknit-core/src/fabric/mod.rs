//! Fabrics as a designer names them: guide bars with their lapping, threading and yarn, and the
//! densities.
//!
//! In: a TOML file ([`Fabric::read`]) or a built-in name ([`Fabric::named`]). Out: a checked
//! [`Fabric`]. Lengths that are drawn follow from it ([`Fabric::radius`]), weights always from the
//! yarn's count.

mod bar;
pub mod builtin;
mod checks;
mod dimensions;
mod error;
mod file;
pub mod lapping;
pub mod motif;
pub mod threading;
pub mod yarn;

use std::fmt;
use std::path;

use glam::{DVec2, DVec3};

use file::{FabricFile, in_range};
use lapping::Numbering;
use motif::Motif;
use threading::Threading;

pub use bar::{Bar, BarKind};
pub use checks::Needles;
pub use dimensions::Dimensions;
pub use error::{FabricError, Fault, Place};

/// The longest common repeat of all bars, courses.
pub const MAX_REPEAT: usize = 10_000;
/// The longest common repeat of all threadings, guides.
pub const MAX_THREADING: usize = 1_000;
/// The most guide bars; machines have up to some 80, most of them for a few patterning threads.
pub const MAX_BARS: usize = 100;

/// The most needles of the common repeat, over all of its courses and bars: each is looked at for
/// warnings.
pub const MAX_LAPS: usize = 10_000_000;
/// The most loops of a weft knit's common repeat: all are laid out, and take a kilobyte each.
pub const MAX_LOOPS: usize = 1_000_000;

/// The most points of a laid strand's path.
pub const MAX_PATH: usize = 1_000;

const INCH_IN_CM: f64 = 2.54;
/// The thickest radius that leaves a loop open, over W and over C.
const THICKEST_ACROSS: f64 = 0.12;
const THICKEST_ALONG: f64 = 0.2;

/// How the yarn of a laid strand runs through its cell: x and y in cells, counted from its lower
/// left corner, z in mm before [`Fabric::enlargement`]. From the last point it goes on to the first
/// one of the next cell.
pub type Path = Vec<DVec3>;

/// A fabric: warp knit by guide bars, weft knit by feeders after a motif, or laid as its strands'
/// paths say, in cells of one wale and one course.
#[derive(Clone, Debug, PartialEq)]
pub struct Fabric {
    /// The name by which the command line knows it.
    pub name: String,
    /// One line about it.
    pub about: String,
    /// Wales per centimetre of the finished cloth.
    pub wales_per_cm: f64,
    /// Needles an inch, where the wales were given so: `wales_per_cm` follows from it, before
    /// finishing.
    pub gauge: Option<f64>,
    /// Courses per centimetre of the finished cloth.
    pub courses_per_cm: f64,
    /// The shape of its stitches.
    pub stitch: Dimensions,
    /// Guide bars, front first (bar 1 = front guide bar, nearest the technical back); of a weft
    /// knit its feeders, of laid cloth its strands.
    pub bars: Vec<Bar>,
    /// Which loop stands where in a weft knit; none in others.
    pub motif: Option<Motif>,
    /// Of laid cloth the path of each of [`Fabric::bars`]; none in a knit.
    pub paths: Vec<Path>,
    /// Panels on which it lies otherwise than along the garment's grain from the lowest-left
    /// corner.
    pub panels: Vec<PanelLayout>,
    /// How many times the yarns are drawn larger than their count says: cloth shown at another
    /// scale.
    pub enlargement: f64,
}

/// How the fabric lies on one panel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PanelLayout {
    /// Index of the panel in [`crate::garment::Garment::panels`].
    pub panel: usize,
    /// Turns the panel's wales, degrees, counter-clockwise seen from the technical face, on top of
    /// the garment's grain.
    pub grain_degrees: f64,
    /// Where gap 0 of course 0 lies, mm from the lowest-left corner of the panel once its wales run
    /// upward.
    pub origin: DVec2,
}

impl Fabric {
    /// The built-in fabric of that name.
    ///
    /// # Errors
    /// [`Fault::Unknown`].
    pub fn named(name: &str) -> Result<Self, FabricError> {
        let text = builtin::text(name).ok_or_else(|| Fault::Unknown(name.to_owned()))?;
        Self::parse(text)
    }

    /// Reads a fabric file; the paths of textures in it start from its folder.
    ///
    /// # Errors
    /// What is wrong with it; the caller knows the file's name.
    pub fn read(path: &path::Path) -> Result<Self, FabricError> {
        let mut fabric = Self::parse(&std::fs::read_to_string(path).map_err(Fault::Io)?)?;
        let folder = path.parent().unwrap_or(path::Path::new(""));
        for texture in fabric.bars.iter_mut().filter_map(|bar| bar.yarn.texture.as_mut()) {
            *texture = folder.join(&*texture);
        }
        Ok(fabric)
    }

    /// Reads a fabric from TOML.
    ///
    /// # Errors
    /// The first thing that is wrong.
    pub fn parse(text: &str) -> Result<Self, FabricError> {
        file::parse(text)
    }

    /// The fabric with other bars, of these chains (or `weft`) and threadings, front first, as the
    /// command line gives them.
    ///
    /// Densities and yarns stay: each bar has the yarn of this fabric's bar in its place, or of the
    /// last. Without threadings all are full, and the last one is that of all bars after it.
    ///
    /// # Errors
    /// A chain or a threading that can't be read, under the name of its flag, or too much of
    /// anything.
    ///
    /// ```
    /// use warpknit_core::fabric::Fabric;
    /// let satin = Fabric::named("tricot")?.with_chains(&["3-4/1-0".into(), "1-0/1-2".into()], &[])?;
    /// assert_eq!(satin.name, "3-4/1-0// + 1-0/1-2//");
    /// # Ok::<(), warpknit_core::fabric::FabricError>(())
    /// ```
    pub fn with_chains(
        self,
        chains: &[String],
        threadings: &[String],
    ) -> Result<Self, FabricError> {
        let threading = |text: &String| {
            bar::read_threading("--threading", text).map_err(|fault| fault.in_own(text))
        };
        let threadings = threadings.iter().map(threading).collect::<Result<Vec<_>, _>>()?;
        let last = self.bars.last().ok_or(Fault::NoBars)?;
        let bar = |(index, text): (usize, &String)| {
            let (kind, chain) = bar::read_lapping("--lapping", text, Numbering::default())
                .map_err(|fault| fault.in_own(text))?;
            let threading = threadings
                .get(index)
                .or(threadings.last())
                .cloned()
                .unwrap_or_else(Threading::full);
            let yarn = self.bars.get(index).unwrap_or(last).yarn.clone();
            Ok(Bar { chain, threading, yarn, kind })
        };
        let bars = chains.iter().enumerate().map(bar).collect::<Result<Vec<_>, FabricError>>()?;
        let name = bars.iter().map(Bar::lapping).collect::<Vec<_>>().join(" + ");
        let fabric =
            Self { name, about: String::new(), bars, motif: None, paths: Vec::new(), ..self };
        fabric.check_repeats()?;
        Ok(fabric)
    }

    /// Refuses more bars and longer repeats than can be knitted.
    fn check_repeats(&self) -> Result<(), Fault> {
        let (courses, guides) = (self.repeat(), self.threading_repeat());
        // Of feeders one alone knits each course.
        let (bars, most) =
            if self.motif.is_some() { (1, MAX_LOOPS) } else { (self.bars.len(), MAX_LAPS) };
        match self.bars.len() {
            0 if self.motif.is_some() => Err(Fault::NoFeeders),
            0 => Err(Fault::NoBars),
            bars if bars > MAX_BARS => Err(Fault::TooManyBars(bars)),
            _ if courses > MAX_REPEAT => Err(Fault::RepeatTooLong(courses)),
            _ if guides > MAX_THREADING => Err(Fault::ThreadingTooLong(guides)),
            _ if guides * courses * bars > most => {
                Err(Fault::RepeatTooLarge { wales: guides, courses, bars, most })
            }
            _ => self.check_feeders(),
        }
    }

    /// Refuses courses of a weft knit that not exactly one feeder knits.
    fn check_feeders(&self) -> Result<(), Fault> {
        if self.motif.is_none() {
            return Ok(());
        }
        for (course, number) in (0_i64..).zip(1..=self.repeat()) {
            let count = self.bars.iter().filter(|feeder| feeder.loops_on(0, course)).count();
            if count != 1 {
                return Err(Fault::Feeders { course: number, count });
            }
        }
        Ok(())
    }

    /// The same cloth at other densities, the yarns drawn in the same proportion to the wale
    /// spacing.
    ///
    /// A named fabric is a look: at a tenth of its wales its true yarns would be hairlines. Weights
    /// still follow the count.
    ///
    /// # Errors
    /// [`Fault::Range`] where a density is not positive.
    pub fn at_densities(
        mut self,
        wales_per_cm: f64,
        courses_per_cm: f64,
    ) -> Result<Self, FabricError> {
        in_range("wales_per_cm", wales_per_cm, file::DENSITY)?;
        in_range("courses_per_cm", courses_per_cm, file::DENSITY)?;
        self.enlargement *= self.wales_per_cm / wales_per_cm;
        self.wales_per_cm = wales_per_cm;
        self.gauge = None;
        self.courses_per_cm = courses_per_cm;
        Ok(self)
    }

    /// Whether its yarns lie as paths say.
    #[must_use]
    pub fn is_laid(&self) -> bool {
        !self.paths.is_empty()
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
    /// It is the thickest yarn's own, but in a knit no more than what leaves a loop open. The
    /// layout takes one radius for all bars, so that their layers stay apart.
    #[must_use]
    pub fn radius(&self) -> f64 {
        let radius = self.true_radius() * self.enlargement;
        if self.is_laid() {
            return radius;
        }
        radius
            .min(THICKEST_ACROSS * self.wale_spacing())
            .min(THICKEST_ALONG * self.course_spacing())
    }

    /// Each bar's drawn radius over the thickest one's: yarns keep their proportions whatever the
    /// radius they are laid out for.
    #[must_use]
    pub fn thickness(&self) -> Vec<f64> {
        self.bars.iter().map(|bar| bar.yarn.diameter() / 2.0 / self.true_radius()).collect()
    }

    /// The thickest yarn's radius by its count, mm.
    #[must_use]
    pub fn true_radius(&self) -> f64 {
        self.bars.iter().map(|bar| bar.yarn.diameter() / 2.0).fold(0.0, f64::max)
    }

    /// Courses after which all bars repeat together.
    #[must_use]
    pub fn repeat(&self) -> usize {
        let motif = self.motif.as_ref().map_or(1, Motif::courses);
        self.bars.iter().fold(motif, |repeat, bar| least_common_multiple(repeat, bar.courses()))
    }

    /// Guides after which all threadings repeat together; of a weft knit the motif's wales. Wefts
    /// count courses and not guides, and so are left out.
    #[must_use]
    pub fn threading_repeat(&self) -> usize {
        let motif = self.motif.as_ref().map_or(1, Motif::wales);
        self.bars.iter().fold(motif, |repeat, bar| least_common_multiple(repeat, bar.guides()))
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

fn least_common_multiple(a: usize, b: usize) -> usize {
    let (mut x, mut y) = (a, b);
    while y != 0 {
        (x, y) = (y, x % y);
    }
    (a / x).saturating_mul(b)
}

#[cfg(test)]
mod tests {
    use super::*;

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
        assert_eq!(fabric.bars[0].chain.gaps(), (-2, 0));
        assert_eq!(Fabric::parse(&fabric.to_string()).unwrap(), fabric);
    }

    #[test]
    fn a_left_hand_drive_is_the_mirror_image() {
        let bar = |drive: &str| {
            let yarn = "yarn = { count = \"44 dtex\", density = 1.38, packing = 0.65, color = \"#ffffff\" }";
            let bars = format!(
                "[[bars]]\nlapping = \"1-0/1-2//\"\nthreading = \"II.\"\n{drive}\n{yarn}\n"
            );
            let fabric = Fabric::parse(&format!(
                "name = \"t\"\nwales_per_cm = 10.0\ncourses_per_cm = 10.0\n{bars}"
            ))
            .unwrap();
            assert!(!fabric.warnings().iter().any(|warning| warning.contains("no gap 0")));
            fabric.bars[0].clone()
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
        let weft = &fabric.bars[0];
        assert!(weft.kind == BarKind::Weft && weft.chain.is_inlay() && !weft.loops_on(0, 0));
        assert_eq!((fabric.repeat(), fabric.threading_repeat()), (6, 1));
        assert!(fabric.to_string().contains("lapping = \"weft\""));
        assert_eq!(Fabric::parse(&fabric.to_string()).unwrap(), fabric);
    }

    fn threading(marks: usize) -> String {
        format!("threading = \"{}\"", "I".repeat(marks))
    }

    #[test]
    fn too_much_of_anything_is_refused() {
        let good = Fabric::named("tricot").unwrap().to_string();
        let long = good.replacen("threading = \"I\"", &threading(997), 1).replacen(
            "threading = \"I\"",
            &threading(1009),
            1,
        );
        assert!(matches!(
            Fabric::parse(&long),
            Err(FabricError { fault: Fault::ThreadingTooLong(_), .. })
        ));
        let bars = good[good.find("[[bars]]").unwrap()..].repeat(60);
        assert!(matches!(
            Fabric::parse(&(good + "\n" + &bars)),
            Err(FabricError { fault: Fault::TooManyBars(122), .. })
        ));
    }

    #[test]
    fn a_repeat_that_takes_minutes_or_gigabytes_is_refused() {
        let good = Fabric::named("tricot").unwrap().to_string();
        let bars = good[good.find("[[bars]]").unwrap()..].repeat(10);
        let warp = good.replacen("1-2/1-0//", &"1-2/1-0/".repeat(3_000), 1).replacen(
            "threading = \"I\"",
            &threading(900),
            1,
        );
        let warp = warp + "\n" + &bars;
        assert!(matches!(
            Fabric::parse(&warp),
            Err(FabricError { fault: Fault::RepeatTooLarge { bars: 22, .. }, .. })
        ));
        let feeder = &good[good.find("[bars.yarn]").unwrap()..good.rfind("[[bars]]").unwrap()]
            .replace("bars", "feeders");
        let head = format!(
            "name = \"w\"\nkind = \"weft\"\nwales_per_cm = 7.0\ncourses_per_cm = 8.0\nchart = \"{}\"\n",
            "k".repeat(500)
        );
        let weft = |courses: usize| {
            format!("{head}[[feeders]]\ncourses = \"{}\"\n{feeder}", "I".repeat(courses))
        };
        assert!(Fabric::parse(&weft(2_000)).is_ok());
        let refused = Fabric::parse(&weft(2_001));
        assert!(
            matches!(
                refused,
                Err(FabricError { fault: Fault::RepeatTooLarge { bars: 1, .. }, .. })
            ),
            "{refused:?}"
        );
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
    fn chains_take_the_bars_places_and_keep_their_yarns() {
        let strings =
            |texts: &[&str]| texts.iter().map(|text| (*text).to_owned()).collect::<Vec<_>>();
        let tricot = Fabric::named("tricot").unwrap();
        let net = tricot
            .clone()
            .with_chains(&strings(&["2-1/1-2", "1-0/1-2", "weft"]), &strings(&["I."]))
            .unwrap();
        assert_eq!(net.name, "2-1/1-2// + 1-0/1-2// + weft");
        let yarns: Vec<_> = net.bars.iter().map(|bar| bar.yarn.color).collect();
        assert_eq!(yarns, [0, 1, 1].map(|bar: usize| tricot.bars[bar].yarn.color));
        assert!(net.bars.iter().all(|bar| bar.threading.to_string() == "I."));
        assert_eq!((net.wales_per_cm, net.bars[2].kind), (tricot.wales_per_cm, BarKind::Weft));

        let wrong = tricot.clone().with_chains(&strings(&["1-0", "1-0/1-7"]), &[]).unwrap_err();
        assert_eq!(
            wrong.to_string(),
            "--lapping \"1-0/1-7\": an overlap over 6 needles: guides lap over 1 or 2"
        );
        assert_eq!(wrong.place.unwrap().to_string(), "1-0/1-7\n    ^^^");
        let wrong = tricot.with_chains(&strings(&["1-0"]), &strings(&["Ix"])).unwrap_err();
        assert_eq!(wrong.place.unwrap().to_string(), "Ix\n ^");
    }

    #[test]
    fn densities_scale_the_drawing_but_not_the_count() {
        let fabric = Fabric::named("tricot").unwrap();
        let coarse = fabric
            .clone()
            .at_densities(fabric.wales_per_cm / 10.0, fabric.courses_per_cm / 10.0)
            .unwrap();
        assert!((coarse.radius() - 10.0 * fabric.radius()).abs() < 1e-12);
        assert_eq!(coarse.bars, fabric.bars);
        assert!(fabric.at_densities(0.0, 1.0).is_err());
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

//! Fabrics as a designer names them: guide bars with their lapping, threading and yarn, and the densities.
//!
//! In: a TOML file ([`Fabric::read`]) or a built-in name ([`Fabric::named`]). Out: a checked [`Fabric`]. Lengths that are drawn
//! follow from it ([`Fabric::radius`]), weights always from the yarn's count.

pub mod builtin;
mod checks;
pub mod lapping;
pub mod yarn;

use std::fmt;
use std::path::Path;

use serde::{Deserialize, Serialize};

pub use checks::Needles;
use lapping::{Chain, LappingError, Numbering};
use yarn::Yarn;

/// The longest common repeat of all bars, courses.
pub const MAX_REPEAT: usize = 10_000;
/// The longest common repeat of all threadings, guides.
pub const MAX_THREADING: usize = 1_000;
/// The most guide bars; machines have up to some 80, most of them for a few patterning threads.
pub const MAX_BARS: usize = 100;

/// A warp-knitted fabric.
#[derive(Clone, Debug, PartialEq)]
pub struct Fabric {
    /// The name by which the command line knows it.
    pub name: String,
    /// One line about it.
    pub about: String,
    /// Wales per centimetre of the finished cloth.
    pub wales_per_cm: f64,
    /// Courses per centimetre of the finished cloth.
    pub courses_per_cm: f64,
    /// Guide bars, front first (bar 1 = front guide bar, nearest the technical back).
    pub bars: Vec<Bar>,
    /// How many times the yarns are drawn larger than their count says: cloth shown at another scale.
    pub enlargement: f64,
}

/// A guide bar.
#[derive(Clone, Debug, PartialEq)]
pub struct Bar {
    /// Its lapping, numbered from x = 0 upward.
    pub chain: Chain,
    /// Which of its guides carry a yarn.
    pub threading: Threading,
    /// The yarn they carry.
    pub yarn: Yarn,
}

/// Which guides of a bar carry a yarn, repeated across.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Threading(Vec<bool>);

impl Threading {
    /// Reads marks, one a guide: `I`, `1` or `|` threaded, `.`, `0` or `*` empty.
    ///
    /// # Errors
    /// An unknown mark, or no threaded guide at all.
    pub fn parse(text: &str) -> Result<Self, ThreadingError> {
        let marks = text.chars().filter(|c| !c.is_whitespace()).map(|c| match c {
            'I' | '1' | '|' => Ok(true),
            '.' | '0' | '*' => Ok(false),
            other => Err(ThreadingError::UnknownMark(other)),
        });
        let marks = marks.collect::<Result<Vec<_>, _>>()?;
        if marks.contains(&true) { Ok(Self(marks)) } else { Err(ThreadingError::NoYarn) }
    }

    /// Whether guide `k` carries a yarn; the first mark is guide 0.
    #[must_use]
    pub fn carries(&self, guide: i64) -> bool {
        let repeat = i64::try_from(self.0.len()).expect("marks fit in memory");
        self.0[usize::try_from(guide.rem_euclid(repeat)).expect("a remainder is not negative")]
    }

    /// The same threading counted the other way from guide 0.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        let (first, others) = self.0.split_first().expect("a threading has a mark");
        Self(std::iter::once(*first).chain(others.iter().rev().copied()).collect())
    }

    /// Guides in one repeat.
    #[must_use]
    pub fn repeat(&self) -> usize {
        self.0.len()
    }
}

impl fmt::Display for Threading {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|&threaded| f.write_str(if threaded { "I" } else { "." }))
    }
}

/// What is wrong with a threading.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ThreadingError {
    /// A character that is no mark.
    #[error("'{0}' is no threading mark: use I for a threaded guide and . for an empty one")]
    UnknownMark(char),
    /// Every guide empty.
    #[error("a bar without a threaded guide knits nothing: use I for a threaded guide and . for an empty one")]
    NoYarn,
}

/// Why there is no fabric.
#[derive(Debug, thiserror::Error)]
pub enum FabricError {
    /// The file can't be read.
    #[error("can't read the fabric file")]
    Io(#[from] std::io::Error),
    /// No built-in fabric of that name.
    #[error("there is no built-in fabric '{0}': `warpknit fabrics` lists them, and a file's name ends in .toml")]
    Unknown(String),
    /// Not TOML, or not what a fabric file holds; carries its own line, column and caret.
    #[error("{}", .0.to_string().trim_end())]
    Toml(toml::de::Error),
    /// A chain that can't be read.
    #[error("bar {bar}, lapping \"{text}\"")]
    Lapping {
        /// The bar, front bar 1.
        bar: usize,
        /// The chain as written.
        text: String,
        /// What is wrong, with its span in `text`.
        source: LappingError,
    },
    /// A threading that can't be read.
    #[error("bar {bar}")]
    Threading {
        /// The bar, front bar 1.
        bar: usize,
        /// What is wrong.
        source: ThreadingError,
    },
    /// A number out of its range.
    #[error("{what} is {value}, but must be {range}")]
    Range {
        /// The key.
        what: String,
        /// Its value.
        value: f64,
        /// What it may be.
        range: &'static str,
    },
    /// No bar.
    #[error("a fabric needs at least one [[bars]] table")]
    NoBars,
    /// Over [`MAX_BARS`].
    #[error("{0} bars; at most {MAX_BARS} are taken")]
    TooManyBars(usize),
    /// Threadings that meet too rarely.
    #[error("the threadings repeat together only after {0} guides; at most {MAX_THREADING} are taken")]
    ThreadingTooLong(usize),
    /// Bars that meet too rarely.
    #[error("the bars repeat together only after {0} courses; at most {MAX_REPEAT} are taken")]
    RepeatTooLong(usize),
}

impl Fabric {
    /// The built-in fabric of that name.
    ///
    /// # Errors
    /// [`FabricError::Unknown`].
    pub fn named(name: &str) -> Result<Self, FabricError> {
        let text = builtin::text(name).ok_or_else(|| FabricError::Unknown(name.to_owned()))?;
        Self::parse(text)
    }

    /// Reads a fabric file.
    ///
    /// # Errors
    /// What is wrong with it; the caller knows the file's name.
    pub fn read(path: &Path) -> Result<Self, FabricError> {
        Self::parse(&std::fs::read_to_string(path)?)
    }

    /// Reads a fabric from TOML.
    ///
    /// # Errors
    /// The first thing that is wrong.
    pub fn parse(text: &str) -> Result<Self, FabricError> {
        let file: FabricFile = toml::from_str(text).map_err(FabricError::Toml)?;
        file.into_fabric()
    }

    /// The same cloth at other densities, the yarns drawn in the same proportion to the wale spacing.
    ///
    /// A named fabric is a look: at a tenth of its wales its true yarns would be hairlines. Weights still follow the count.
    ///
    /// # Errors
    /// [`FabricError::Range`] where a density is not positive.
    pub fn at_densities(mut self, wales_per_cm: f64, courses_per_cm: f64) -> Result<Self, FabricError> {
        in_range("wales_per_cm", wales_per_cm, DENSITY)?;
        in_range("courses_per_cm", courses_per_cm, DENSITY)?;
        self.enlargement *= self.wales_per_cm / wales_per_cm;
        self.wales_per_cm = wales_per_cm;
        self.courses_per_cm = courses_per_cm;
        Ok(self)
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

    /// The radius for which all of the fabric's yarns are laid out, and with which the thickest is drawn, mm.
    ///
    /// It is the thickest yarn's own, but no more than the eight-point layout holds without yarns that cut each other: .042 W and
    /// .06 C for two knitting bars, half as much again for one (the specification's table of least distances: 1.0 and 1.5 times
    /// 2r there). The layout takes one radius for all bars, so that their layers stay apart.
    #[must_use]
    pub fn radius(&self) -> f64 {
        let knitting = self.bars.iter().filter(|bar| !bar.chain.is_inlay()).count();
        let room = if knitting > 1 { 1.0 } else { 1.4 };
        let limit = room * (0.042 * self.wale_spacing()).min(0.06 * self.course_spacing());
        (self.true_radius() * self.enlargement).min(limit)
    }

    /// Each bar's drawn radius over the thickest one's: yarns keep their proportions whatever the radius they are laid out for.
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
        self.bars.iter().fold(1, |repeat, bar| least_common_multiple(repeat, bar.chain.laps().len()))
    }

    /// Guides after which all threadings repeat together.
    #[must_use]
    pub fn threading_repeat(&self) -> usize {
        self.bars.iter().fold(1, |repeat, bar| least_common_multiple(repeat, bar.threading.repeat()))
    }
}

impl Bar {
    /// Whether the drive is on the left, so that a designer writes its gaps with the other sign.
    ///
    /// Only a chain read with its drive on the left has gaps below 0.
    #[must_use]
    pub fn counts_from_left(&self) -> bool {
        self.chain.gaps().0 < 0
    }

    /// The chain as a designer writes it: gaps counted from the drive, never below 0.
    #[must_use]
    pub fn written_chain(&self) -> Chain {
        if self.counts_from_left() { self.chain.mirrored() } else { self.chain.clone() }
    }

    /// Whether one of this bar's yarns makes a loop on the needle of `wale` in `course`.
    #[must_use]
    pub fn loops_on(&self, wale: i64, course: i64) -> bool {
        let lap = self.chain.lap(course);
        let needles = i64::from(lap.needle())..i64::from(lap.from.max(lap.to));
        needles.into_iter().any(|needle| self.threading.carries(wale - needle))
    }
}

impl fmt::Display for Fabric {
    /// The fabric as the TOML that [`Fabric::parse`] reads.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = toml::to_string(&FabricFile::from(self)).map_err(|_unserialisable| fmt::Error)?;
        f.write_str(&text)
    }
}

const DENSITY: (f64, f64, &str) = (0.01, 1000.0, "between 0.01 and 1000 per cm");
const FIBRE_DENSITY: (f64, f64, &str) = (0.1, 25.0, "between 0.1 and 25 g/cm³");
const PACKING: (f64, f64, &str) = (0.01, 1.0, "between 0.01 and 1");

/// Refuses a value outside `low..=high` (NaN included).
fn in_range(what: &str, value: f64, (low, high, range): (f64, f64, &'static str)) -> Result<(), FabricError> {
    if (low..=high).contains(&value) { Ok(()) } else { Err(FabricError::Range { what: what.to_owned(), value, range }) }
}

fn least_common_multiple(a: usize, b: usize) -> usize {
    let (mut x, mut y) = (a, b);
    while y != 0 {
        (x, y) = (y, x % y);
    }
    (a / x).saturating_mul(b)
}

/// The fabric file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct FabricFile {
    name: String,
    #[serde(default)]
    about: String,
    wales_per_cm: f64,
    courses_per_cm: f64,
    bars: Vec<BarTable>,
}

/// A `[[bars]]` table.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct BarTable {
    lapping: String,
    #[serde(default)]
    numbering: Numbering,
    #[serde(default)]
    drive: Drive,
    #[serde(default = "full_set")]
    threading: String,
    yarn: Yarn,
}

/// The side of the machine from which gaps are counted, seen from the technical face.
#[derive(Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Drive {
    #[default]
    Right,
    Left,
}

fn full_set() -> String {
    "I".to_owned()
}

impl FabricFile {
    fn into_fabric(self) -> Result<Fabric, FabricError> {
        in_range("wales_per_cm", self.wales_per_cm, DENSITY)?;
        in_range("courses_per_cm", self.courses_per_cm, DENSITY)?;
        let bars = self.bars.into_iter().zip(1..).map(|(table, number)| table.into_bar(number)).collect::<Result<Vec<_>, _>>()?;
        if bars.is_empty() {
            return Err(FabricError::NoBars);
        }
        let fabric = Fabric {
            name: self.name,
            about: self.about,
            wales_per_cm: self.wales_per_cm,
            courses_per_cm: self.courses_per_cm,
            bars,
            enlargement: 1.0,
        };
        let (courses, guides) = (fabric.repeat(), fabric.threading_repeat());
        match fabric.bars.len() {
            bars if bars > MAX_BARS => Err(FabricError::TooManyBars(bars)),
            _ if courses > MAX_REPEAT => Err(FabricError::RepeatTooLong(courses)),
            _ if guides > MAX_THREADING => Err(FabricError::ThreadingTooLong(guides)),
            _ => Ok(fabric),
        }
    }
}

impl BarTable {
    fn into_bar(self, number: usize) -> Result<Bar, FabricError> {
        let chain = Chain::parse(&self.lapping, self.numbering).map_err(|source| FabricError::Lapping {
            bar: number,
            text: self.lapping.clone(),
            source,
        })?;
        let threading = Threading::parse(&self.threading).map_err(|source| FabricError::Threading { bar: number, source })?;
        in_range(&format!("bar {number}: yarn.density"), self.yarn.density, FIBRE_DENSITY)?;
        in_range(&format!("bar {number}: yarn.packing"), self.yarn.packing, PACKING)?;
        // Both gaps and guides are counted from the drive.
        let (chain, threading) =
            if self.drive == Drive::Left { (chain.mirrored(), threading.mirrored()) } else { (chain, threading) };
        Ok(Bar { chain, threading, yarn: self.yarn })
    }
}

impl From<&Fabric> for FabricFile {
    fn from(fabric: &Fabric) -> Self {
        Self {
            name: fabric.name.clone(),
            about: fabric.about.clone(),
            wales_per_cm: fabric.wales_per_cm,
            courses_per_cm: fabric.courses_per_cm,
            bars: fabric.bars.iter().map(BarTable::from).collect(),
        }
    }
}

impl From<&Bar> for BarTable {
    fn from(bar: &Bar) -> Self {
        let left = bar.counts_from_left();
        Self {
            lapping: bar.written_chain().to_string(),
            numbering: Numbering::Tricot,
            drive: if left { Drive::Left } else { Drive::Right },
            threading: if left { bar.threading.mirrored() } else { bar.threading.clone() }.to_string(),
            yarn: bar.yarn.clone(),
        }
    }
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
        let text = Fabric::named("tricot").unwrap().to_string().replace("\"1-2/1-0//\"", "\"1-2/1-0//\"\ndrive = \"left\"");
        let text = text.replacen("drive = \"right\"\n", "", 1);
        let fabric = Fabric::parse(&text).unwrap();
        assert_eq!(fabric.bars[0].chain.gaps(), (-2, 0));
        assert_eq!(Fabric::parse(&fabric.to_string()).unwrap(), fabric);
    }

    #[test]
    fn a_left_hand_drive_is_the_mirror_image() {
        let bar = |drive: &str| {
            let yarn = "yarn = { count = \"44 dtex\", density = 1.38, packing = 0.65, color = \"#ffffff\" }";
            let bars = format!("[[bars]]\nlapping = \"1-0/1-2//\"\nthreading = \"II.\"\n{drive}\n{yarn}\n");
            let fabric = Fabric::parse(&format!("name = \"t\"\nwales_per_cm = 10.0\ncourses_per_cm = 10.0\n{bars}")).unwrap();
            assert!(!fabric.warnings().iter().any(|warning| warning.contains("no gap 0")));
            fabric.bars[0].clone()
        };
        let (right, left) = (bar(""), bar("drive = \"left\""));
        for course in 0..2 {
            for wale in -6..6 {
                // Wale w lies between gaps w and w + 1, so its mirror image is wale -w - 1.
                assert_eq!(right.loops_on(wale, course), left.loops_on(-wale - 1, course), "wale {wale}, course {course}");
            }
        }
    }

    #[test]
    fn too_much_of_anything_is_refused() {
        let good = Fabric::named("tricot").unwrap().to_string();
        let threading = |marks: usize| format!("threading = \"{}\"", "I".repeat(marks));
        let long = good.replacen("threading = \"I\"", &threading(997), 1).replacen("threading = \"I\"", &threading(1009), 1);
        assert!(matches!(Fabric::parse(&long), Err(FabricError::ThreadingTooLong(_))));
        let bars = good[good.find("[[bars]]").unwrap()..].repeat(60);
        assert!(matches!(Fabric::parse(&(good + "\n" + &bars)), Err(FabricError::TooManyBars(122))));
    }

    #[test]
    fn faults_name_their_place() {
        let good = Fabric::named("locknit").unwrap().to_string();
        let message =
            |from: &str, to: &str| format!("{:#}", anyhow::Error::from(Fabric::parse(&good.replace(from, to)).unwrap_err()));
        assert!(message("2-3/1-0//", "2-9/1-0//").contains("bar 1, lapping \"2-9/1-0//\": an overlap over 7 needles"));
        assert!(message("threading = \"I\"", "threading = \"x\"").contains("bar 1: 'x' is no threading mark"));
        assert!(message("packing = 0.65", "packing = 2.0").contains("bar 1: yarn.packing is 2"));
        assert!(message("44 dtex", "44 stone").contains("no yarn count"));
        assert!(message("wales_per_cm", "whales_per_cm").contains("line 3"));
        assert!(matches!(Fabric::named("tweed"), Err(FabricError::Unknown(_))));
    }

    #[test]
    fn densities_scale_the_drawing_but_not_the_count() {
        let fabric = Fabric::named("tricot").unwrap();
        let coarse = fabric.clone().at_densities(fabric.wales_per_cm / 10.0, fabric.courses_per_cm / 10.0).unwrap();
        assert!((coarse.radius() - 10.0 * fabric.radius()).abs() < 1e-12);
        assert_eq!(coarse.bars, fabric.bars);
        assert!(fabric.at_densities(0.0, 1.0).is_err());
    }
}

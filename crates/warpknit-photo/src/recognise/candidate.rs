//! Cloths that a photo may show, with their sketches.
//!
//! In: built-in fabrics and lappings. Out: [`Candidate`]s. A draft, whose yarns are not relaxed, is
//! good enough to tell which cloths are worth more; those are relaxed at the photo's own
//! proportions. Drafts of the catalogue are drawn once and kept. Cost: one or two milliseconds a
//! draft, some tens a relaxed cloth.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use rayon::prelude::*;

use super::Face;
use super::same::ClothKey;
use super::sketch::{PartSpread, Sketch};
use warpknit_core::fabric::motif::Motif;
use warpknit_core::fabric::yarn::Count;
use warpknit_core::fabric::{Bar, Fabric, Structure, builtin};
use warpknit_core::knit::Pattern;
use warpknit_core::knit::spread::Spread;

/// Shares of the width by which filaments spread that are tried once a cloth is relaxed: cloth of
/// round yarns, cloth whose yarns lie as flat as can be, and one in between. Of two-bar cloths of
/// spread yarns, 18 of 25 were known with a quarter alone, and 20 with these, both before
/// [`super::sky_light`] let light pass below yarns. With that, 16 are.
const SPREADS: [f64; 3] = [0.0, 0.5, 1.0];
/// The share before that. With a half, a locknit on white paper was taken for another cloth; with
/// none, fewer cloths of spread yarns are found.
const FIRST_SPREAD: f64 = 0.25;

/// A cloth, and what its faces look like.
#[derive(Clone)]
pub(super) struct Candidate {
    pub(super) fabric: Fabric,
    /// Equal for the same warp knit; weft knits have none and go by their charts.
    pub(super) key: Option<ClothKey>,
    /// Its face and its back.
    sketches: [Sketch; 2],
    /// Whether its mirror image is another cloth to the eye.
    pub(super) is_handed: bool,
}

impl Candidate {
    /// Lays a fabric out and draws both faces; nothing is relaxed.
    pub(super) fn draft(fabric: &Fabric) -> Self {
        let [drawn] = Self::drawn(fabric, &Pattern::draft(fabric), [FIRST_SPREAD]);
        drawn
    }

    /// Relaxes a fabric and draws both faces, its yarns spread as in drafts.
    pub(super) fn relaxed(fabric: &Fabric) -> Self {
        let [drawn] = Self::drawn(fabric, &Pattern::new(fabric), [FIRST_SPREAD]);
        drawn
    }

    /// Relaxes a fabric and draws both faces, once for each of [`SPREADS`].
    pub(super) fn relaxed_and_spread(fabric: &Fabric) -> [Self; SPREADS.len()] {
        Self::drawn(fabric, &Pattern::new(fabric), SPREADS)
    }

    /// A fabric whose yarns are spread by each of some shares.
    fn drawn<const N: usize>(fabric: &Fabric, pattern: &Pattern, shares: [f64; N]) -> [Self; N] {
        let spread = Spread::of(fabric, pattern, fabric.radius());
        let (key, is_handed) = key_and_hand(fabric);
        shares.map(|share| Self {
            fabric: fabric.clone(),
            key: key.clone(),
            sketches: [Face::Front, Face::Back].map(|face| {
                Sketch::new(fabric, pattern, PartSpread { spread: &spread, share }, face)
            }),
            is_handed,
        })
    }

    /// Its sketch from a face.
    pub(super) fn sketch(&self, face: Face) -> &Sketch {
        match face {
            Face::Front => &self.sketches[0],
            Face::Back => &self.sketches[1],
        }
    }

    /// Wales and courses of its repeat.
    pub(super) fn repeat(&self) -> [usize; 2] {
        self.sketches[0].repeat
    }
}

/// A fabric's key, and whether its mirror image is another cloth to the eye.
fn key_and_hand(fabric: &Fabric) -> (Option<ClothKey>, bool) {
    match &fabric.structure {
        Structure::Warp(knit) => {
            let [courses, guides] = [fabric.repeat(), fabric.threading_repeat()];
            let handed = |mirrored| ClothKey::handed(knit, courses, guides, mirrored);
            let is_handed = handed(false) != handed(true);
            (Some(ClothKey::new(knit, courses, guides)), is_handed)
        }
        Structure::Weft(_) => (None, false),
        Structure::Laid(_) => (None, true),
    }
}

/// A fabric whose courses are `course` wale spacings high, of yarns of `thickness` times the
/// diameter. Wales keep their density, since sketches have no scale.
pub(super) fn proportioned(fabric: &Fabric, course: f64, thickness: f64) -> Fabric {
    let mut fabric = fabric.clone();
    fabric.gauge = None;
    let courses_per_cm = fabric.wales_per_cm / course;
    let change = fabric.courses_per_cm / courses_per_cm;
    if let Structure::Warp(knit) = &mut fabric.structure
        && (change - 1.0).abs() > SAME_PROPORTION
    {
        // A run-in is that of courses as high as the file has them.
        knit.bars.iter_mut().for_each(|bar| bar.run_in = None);
    }
    fabric.courses_per_cm = courses_per_cm;
    for yarn in fabric.structure.yarns_mut() {
        yarn.count = Count::from_tex(yarn.count.tex() * thickness.powi(2));
    }
    fabric
}

/// Change of the proportion of wales to courses up to which a run-in counts.
const SAME_PROPORTION: f64 = 0.02;

/// Laps of two courses, one needle further each: pillar, tricot, cord, satin.
const FRONT: [&str; 4] = ["1-0/0-1", "1-2/1-0", "2-3/1-0", "3-4/1-0"];
/// The same in the other sense.
const BACK: [&str; 4] = ["1-0/0-1", "1-0/1-2", "1-0/2-3", "1-0/3-4"];

/// The built-in warp knits, and the two-bar cloths of pillar, tricot, cord and satin in both senses.
pub(super) fn warp_knits() -> &'static [Candidate] {
    static CATALOGUE: OnceLock<Vec<Candidate>> = OnceLock::new();
    kept(&CATALOGUE, || {
        let mut fabrics = built_in(|fabric| fabric.warp_knit().is_some());
        fabrics.extend(grid());
        let all: Vec<Candidate> = fabrics
            .into_par_iter()
            .map(|fabric| {
                if has_inlay(&fabric) {
                    Candidate::relaxed(&fabric)
                } else {
                    Candidate::draft(&fabric)
                }
            })
            .collect();
        let mut different: Vec<Candidate> = Vec::new();
        for candidate in all {
            if !different.iter().any(|other| other.key == candidate.key) {
                different.push(candidate);
            }
        }
        different
    })
}

/// Whether a cloth is one of [`warp_knits`], or a weft knit.
pub(super) fn is_known(cloth: &Candidate) -> bool {
    cloth.key.is_none() || warp_knits().iter().any(|known| known.key == cloth.key)
}

/// Weft knits by their charts: jersey, reverse jersey, both ribs and garter.
const CHARTS: [(&str, &str); 5] =
    [("jersey", "k"), ("jersey", "p"), ("rib-1x1", "kp"), ("rib-2x2", "kkpp"), ("garter", "p\nk")];

/// The weft knits. They are relaxed: their drafts would not interlock.
pub(super) fn weft_knits() -> &'static [Candidate] {
    static CATALOGUE: OnceLock<Vec<Candidate>> = OnceLock::new();
    kept(&CATALOGUE, || {
        CHARTS
            .into_par_iter()
            .filter_map(|(name, chart)| {
                let mut fabric = Fabric::named(name).ok()?;
                if let Structure::Weft(knit) = &mut fabric.structure {
                    knit.motif = Motif::parse(chart, &BTreeMap::new()).ok()?;
                }
                if chart == "p" {
                    "reverse-jersey".clone_into(&mut fabric.name);
                }
                Some(Candidate::relaxed(&fabric))
            })
            .collect()
    })
}

/// What `made` gives, kept. Threads that ask before it is kept each make it: none can wait for another,
/// because each works on all threads and may have begun what the other waits for.
fn kept(
    known: &'static OnceLock<Vec<Candidate>>,
    made: impl FnOnce() -> Vec<Candidate>,
) -> &'static [Candidate] {
    if let Some(known) = known.get() {
        return known;
    }
    let made = made();
    known.get_or_init(|| made)
}

/// Whether a bar is laid in. Only the relaxation pulls it straight, so that no draft is like it.
fn has_inlay(fabric: &Fabric) -> bool {
    fabric.warp_knit().is_some_and(|knit| knit.bars.iter().any(Bar::is_inlay))
}

/// Built-in fabrics of a kind.
pub(super) fn built_in(is_wanted: impl Fn(&Fabric) -> bool) -> Vec<Fabric> {
    builtin::names()
        .filter_map(|name| Fabric::named(name).ok())
        .filter(|fabric| is_wanted(fabric))
        .collect()
}

/// The two-bar cloths of pillar, tricot, cord and satin in both senses. These 25 are different
/// cloths; all others of these laps are mirror images of one of them.
pub fn grid() -> impl Iterator<Item = Fabric> {
    FRONT.into_iter().enumerate().flat_map(|(at, front)| {
        // A pillar in front has no sense.
        let others = if at == 0 { &[] } else { &FRONT[1..] };
        let backs = BACK.into_iter().chain(others.iter().copied());
        backs.filter_map(move |back| full_bars(&[front.to_owned(), back.to_owned()]).ok())
    })
}

/// A cloth of full bars with these chains, front first, or what is wrong with them.
pub(super) fn full_bars(chains: &[String]) -> Result<Fabric, String> {
    let like = Fabric::named("locknit").map_err(|error| error.to_string())?;
    like.with_chains(chains, &[]).map_err(|error| error.to_string())
}

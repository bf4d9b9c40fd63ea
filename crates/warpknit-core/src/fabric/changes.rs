//! A fabric with something changed, as the command line asks for it: chains, yarn counts, run-ins,
//! densities and scale.
//!
//! In: a [`Fabric`]. Out: another one. A change that makes no fabric is an error under the name of
//! its flag.
//!
//! Two changes make a cloth coarser or finer. [`Fabric::at_densities`] keeps the real yarns and
//! draws them enlarged: it is for pictures. [`Fabric::at_scale`] changes the real cloth in
//! proportion: it is for cloth of another yarn.

use super::bar::{self, Bar, RUN_IN};
use super::error::{FabricError, FabricFault};
use super::file::{self, in_range};
use super::lapping::Numbering;
use super::threading::Threading;
use super::yarn::Count;
use super::{Dimensions, Fabric, Structure, WarpKnit};

/// Difference of two proportions of wales to courses that count as one, as a share.
const SAME_PROPORTION: f64 = 0.02;
/// What stands between the chains of a name.
const BETWEEN_CHAINS: &str = " + ";

/// The chains in some texts, each of which may hold those of several bars with ` + ` between.
///
/// ```
/// use warpknit_core::fabric::chains;
/// let texts = ["2-3/1-0// + 1-0/1-2//".to_owned()];
/// assert_eq!(chains(&texts).count(), 2);
/// ```
pub fn chains(texts: &[String]) -> impl Iterator<Item = &str> {
    texts.iter().flat_map(|text| text.split(BETWEEN_CHAINS))
}

impl Fabric {
    /// A warp knit of these chains (or `weft`) and threadings, front first, as the command line
    /// gives them: those of [`chains`].
    ///
    /// Densities and yarns stay: each bar has the yarn of this fabric's yarn system in its place,
    /// or of the last one. Without threadings all are full, and the last threading is that of all
    /// bars after it. A run-in or a slack was that of the old chain, so the new bars have none.
    ///
    /// # Errors
    /// A chain or a threading that can't be read, under the name of its flag, or too much of
    /// anything.
    ///
    /// ```
    /// use warpknit_core::fabric::Fabric;
    /// let chains = ["3-4/1-0".to_owned(), "1-0/1-2".to_owned()];
    /// let satin = Fabric::named("tricot")?.with_chains(&chains, &[])?;
    /// assert_eq!(satin.name, "3-4/1-0// + 1-0/1-2//");
    /// assert_eq!(Fabric::named("tricot")?.with_chains(&[satin.name.clone()], &[])?, satin);
    /// # Ok::<(), warpknit_core::fabric::FabricError>(())
    /// ```
    pub fn with_chains(
        self,
        chains: &[String],
        threadings: &[String],
    ) -> Result<Self, FabricError> {
        // Threadings first: a fault in one is reported before a fault in a chain.
        let mut read = Vec::with_capacity(threadings.len());
        for text in threadings {
            let threading = bar::read_threading("--threading", text);
            read.push(threading.map_err(|fault| fault.in_own(text))?);
        }
        let last = self.yarns().last().ok_or(FabricFault::NoBars)?;
        let mut bars = Vec::new();
        for (index, text) in self::chains(chains).enumerate() {
            let lay = bar::read_lapping("--lapping", text, Numbering::default())
                .map_err(|fault| fault.in_own(text))?;
            let threading = read.get(index).or(read.last()).cloned();
            bars.push(Bar {
                lay,
                threading: threading.unwrap_or_else(Threading::full),
                run_in: None,
                slack: None,
                yarn: self.yarns().nth(index).unwrap_or(last).clone(),
            });
        }
        let stitch = match &self.structure {
            Structure::Warp(knit) => knit.stitch,
            Structure::Weft(_) | Structure::Laid(_) => Dimensions::default(),
        };
        let fabric = Self {
            name: bars.iter().map(Bar::lapping).collect::<Vec<_>>().join(BETWEEN_CHAINS),
            about: String::new(),
            structure: Structure::Warp(WarpKnit { bars, stitch }),
            ..self
        };
        fabric.check_repeats()?;
        Ok(fabric)
    }

    /// The same cloth at other densities, the yarns drawn in the same proportion to the wale
    /// spacing.
    ///
    /// A named fabric is a look: at a tenth of its wales its true yarns would be hairlines. Masses
    /// still follow the count. Run-ins of the file are enlarged too. In other proportions of wales and
    /// courses they don't count: yarns take the length of their loops.
    ///
    /// # Errors
    /// [`FabricFault::Range`] where a density is not positive.
    ///
    /// ```
    /// use warpknit_core::fabric::Fabric;
    /// let coarse = Fabric::named("tricot")?.at_densities(2.0, 3.0)?;
    /// assert_eq!(coarse.wale_spacing(), 5.0);
    /// # Ok::<(), warpknit_core::fabric::FabricError>(())
    /// ```
    pub fn at_densities(
        mut self,
        wales_per_cm: f64,
        courses_per_cm: f64,
    ) -> Result<Self, FabricError> {
        in_range("wales_per_cm", wales_per_cm, file::DENSITY)?;
        in_range("courses_per_cm", courses_per_cm, file::DENSITY)?;
        // Drawn radii grow with the wale spacing, so that the loops keep their shape.
        let times = self.wales_per_cm / wales_per_cm;
        self.enlargement *= times;
        let proportion = self.courses_per_cm / courses_per_cm / times;
        if let Structure::Warp(knit) = &mut self.structure
            && (proportion - 1.0).abs() >= SAME_PROPORTION
        {
            knit.bars.iter_mut().for_each(|bar| bar.run_in = None);
        }
        self.scale_lengths(times);
        self.wales_per_cm = wales_per_cm;
        self.gauge = None;
        self.courses_per_cm = courses_per_cm;
        Ok(self)
    }

    /// Scales what is given in mm: run-ins and thickness.
    fn scale_lengths(&mut self, times: f64) {
        self.finish.thickness = self.finish.thickness.map(|thickness| thickness * times);
        if let Structure::Warp(knit) = &mut self.structure {
            for bar in &mut knit.bars {
                bar.run_in = bar.run_in.map(|run_in| run_in * times);
            }
        }
    }

    /// The same cloth, all its lengths so many times as large, but for its yarns: densities,
    /// run-ins and thickness.
    ///
    /// With yarns of so many times the diameter it is the same cloth at another scale. Its cover
    /// factor stays.
    ///
    /// # Errors
    /// [`FabricFault::Range`] where a density leaves its limits.
    ///
    /// ```
    /// use warpknit_core::fabric::Fabric;
    /// let fine = Fabric::named("tricot")?.with_counts(&["11 dtex".parse().unwrap()])?;
    /// let fine = fine.at_scale(0.5)?;
    /// let tricot = Fabric::named("tricot")?;
    /// assert_eq!(fine.wales_per_cm, 2.0 * tricot.wales_per_cm);
    /// assert!((fine.yarn_cover() / tricot.yarn_cover() - 1.0).abs() < 1e-12);
    /// # Ok::<(), warpknit_core::fabric::FabricError>(())
    /// ```
    pub fn at_scale(mut self, times: f64) -> Result<Self, FabricError> {
        self.wales_per_cm = in_range("wales_per_cm", self.wales_per_cm / times, file::DENSITY)?;
        self.courses_per_cm =
            in_range("courses_per_cm", self.courses_per_cm / times, file::DENSITY)?;
        self.gauge = None;
        self.scale_lengths(times);
        Ok(self)
    }

    /// The same cloth of yarns of these counts, front first. The last one is that of all further
    /// yarns. Densities stay.
    ///
    /// # Errors
    /// [`FabricFault::TooManyValues`].
    ///
    /// ```
    /// use warpknit_core::fabric::Fabric;
    /// let locknit = Fabric::named("locknit")?.with_counts(&["20 den".parse().unwrap()])?;
    /// assert!(locknit.yarns().all(|yarn| yarn.count.to_string() == "20 den"));
    /// # Ok::<(), warpknit_core::fabric::FabricError>(())
    /// ```
    pub fn with_counts(mut self, counts: &[Count]) -> Result<Self, FabricError> {
        self.check_number("--count", counts.len())?;
        if let Some(last) = counts.last() {
            let counts = counts.iter().chain(std::iter::repeat(last));
            for (yarn, count) in self.structure.yarns_mut().zip(counts) {
                yarn.count = *count;
            }
        }
        Ok(self)
    }

    /// The same cloth whose bars are fed these lengths, mm a rack, front first. Bars with `None`,
    /// and bars after the last, keep their own.
    ///
    /// # Errors
    /// More run-ins than bars, one for wefts or for a fabric without bars, or one out of its range.
    ///
    /// ```
    /// use warpknit_core::fabric::Fabric;
    /// let locknit = Fabric::named("locknit")?.with_run_ins(&[None, Some(1100.0)])?;
    /// let run_ins: Vec<_> = locknit.warp_knit().unwrap().bars.iter().map(|bar| bar.run_in).collect();
    /// assert_eq!(run_ins, [None, Some(1100.0)]);
    /// # Ok::<(), warpknit_core::fabric::FabricError>(())
    /// ```
    pub fn with_run_ins(mut self, run_ins: &[Option<f64>]) -> Result<Self, FabricError> {
        let flag = "--run-in";
        if run_ins.is_empty() {
            return Ok(self);
        }
        let kind = match self.structure {
            Structure::Warp(_) => None,
            Structure::Weft(_) => Some("weft knit"),
            Structure::Laid(_) => Some("laid cloth"),
        };
        if let Some(kind) = kind {
            let instead = "only guide bars have one";
            return Err(FabricFault::OtherKind { kind, key: flag, instead }.into());
        }
        self.check_number(flag, run_ins.len())?;
        if let Structure::Warp(knit) = &mut self.structure {
            for ((bar, run_in), number) in knit.bars.iter_mut().zip(run_ins).zip(1..) {
                let Some(run_in) = *run_in else { continue };
                bar.run_in = Some(in_range(&format!("{flag} of bar {number}"), run_in, RUN_IN)?);
                // It says how long the yarn is, so a slack of the file would say it twice.
                bar.slack = bar.slack.filter(|_| bar.chain().is_none());
                if let Some(why) = bar.contradiction() {
                    return Err(FabricFault::Bar { number, why }.into());
                }
            }
        }
        Ok(self)
    }

    /// Refuses a flag that is given more often than there are yarn systems.
    fn check_number(&self, flag: &'static str, given: usize) -> Result<(), FabricFault> {
        let systems = self.yarn_systems();
        let system = match self.structure {
            Structure::Warp(_) => "bar",
            Structure::Weft(_) => "feeder",
            Structure::Laid(_) => "strand",
        };
        if given > systems {
            return Err(FabricFault::TooManyValues { flag, given, system, systems });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fabric::Lay;

    fn bars(fabric: &Fabric) -> &[Bar] {
        &fabric.warp_knit().unwrap().bars
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
        let yarns: Vec<_> = net.yarns().map(|yarn| yarn.color).collect();
        assert_eq!(yarns, [0, 1, 1].map(|bar| tricot.yarn(bar).color));
        assert!(bars(&net).iter().all(|bar| bar.threading.to_string() == "I."));
        assert_eq!((net.wales_per_cm, &bars(&net)[2].lay), (tricot.wales_per_cm, &Lay::Weft));

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
        assert_eq!(coarse.structure, fabric.structure);
        assert!(fabric.at_densities(0.0, 1.0).is_err());
    }

    #[test]
    fn counts_go_to_all_further_bars_and_change_nothing_else() {
        let counts = |texts: &[&str]| -> Vec<Count> {
            texts.iter().map(|text| text.parse().unwrap()).collect()
        };
        let net = Fabric::named("power-net").unwrap();
        let changed = net.clone().with_counts(&counts(&["78 dtex", "20 den"])).unwrap();
        let texts: Vec<_> = changed.yarns().map(|yarn| yarn.count.to_string()).collect();
        assert_eq!(texts, ["78 dtex", "20 den", "20 den", "20 den"]);
        assert_eq!(changed.yarn(2).density, net.yarn(2).density);
        assert_eq!(net.clone().with_counts(&[]).unwrap(), net);
        let jersey = Fabric::named("jersey").unwrap();
        assert_eq!(
            jersey.with_counts(&counts(&["1 tex", "2 tex"])).unwrap_err().to_string(),
            "--count is given 2 times, but the fabric has 1 feeder"
        );
    }

    #[test]
    fn run_ins_go_to_their_bars() {
        let named = |name: &str| Fabric::named(name).unwrap();
        let changed = named("locknit").with_run_ins(&[Some(1500.0)]).unwrap();
        let run_ins: Vec<_> = bars(&changed).iter().map(|bar| bar.run_in).collect();
        assert_eq!(run_ins, [Some(1500.0), None]);
        // The cloth is drawn enlarged, and the yarn of its loops with it.
        let coarse = changed.at_densities(1.46, 2.174).unwrap();
        let run_ins: Vec<_> =
            coarse.warp_knit().unwrap().bars.iter().map(|bar| bar.run_in).collect();
        assert!(run_ins[0].is_some_and(|run_in| run_in > 2000.0) && run_ins[1].is_none());
        let fault = |name: &str, run_ins: &[Option<f64>]| {
            named(name).with_run_ins(run_ins).unwrap_err().to_string()
        };
        assert_eq!(
            fault("locknit", &[None; 3]),
            "--run-in is given 3 times, but the fabric has 2 bars"
        );
        assert_eq!(
            fault("locknit", &[None, Some(0.0)]),
            "--run-in of bar 2 is 0, but must be between 1 and 1000000 mm a rack of 480 courses"
        );
        assert!(fault("weft-inserted", &[None, Some(9.0)]).starts_with("bar 2: wefts have no"));
        assert_eq!(
            fault("jersey", &[Some(9.0)]),
            "a weft knit has no --run-in: only guide bars have one"
        );
    }

    #[test]
    fn a_run_in_replaces_a_slack() {
        let mut fabric = Fabric::named("tricot-inlay").unwrap();
        let Structure::Warp(knit) = &mut fabric.structure else { unreachable!() };
        knit.bars[1].slack = Some(0.1);
        let fed = fabric.with_run_ins(&[None, Some(1200.0)]).unwrap();
        assert_eq!((bars(&fed)[1].run_in, bars(&fed)[1].slack), (Some(1200.0), None));
    }
}

//! What a page says in words and numbers of the fabric that it shows.
//!
//! In: a fabric. Out: [`Facts`]: its densities, mass and thickness, and what each of its bars,
//! feeders or strands is made of; and what yarns finer than pixels look like together: how much
//! light they stop, and which of them are seen. The numbers are those of the real cloth
//! ([`warpknit_core::knit::numbers`]), also where it is drawn larger.

use warpknit_core::fabric::{Fabric, Structure};
use warpknit_core::ids::index32;
use warpknit_core::knit::numbers::{self, Numbers};
use warpknit_core::knit::{Pattern, visible_shares};

/// Characters of a lapping that a page shows. Patterned nets have chains of a thousand.
const LAPPING: usize = 120;

/// What a page says of a fabric.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Facts {
    /// One line about it.
    pub about: String,
    /// Of each bar, feeder or strand, front first.
    pub systems: Vec<SystemFacts>,
    /// Label and value, in the order in which they are shown.
    pub cloth: Vec<(&'static str, String)>,
    /// The share of the area that yarns hide. It is unknown without a fabric.
    pub cover: Option<f64>,
    /// Optical depth of the cloth, seen from the front, over the area of its yarns side by side.
    /// It is 1 for yarns that lie at random, more where they lie beside each other, and less where
    /// they lie behind each other. It is unknown without a fabric.
    pub depth_of_yarns: Option<f64>,
    /// The share that each system has of the yarn that is seen, from the front and from the back.
    pub visible_shares: [Vec<f64>; 2],
    /// The longer side of the repeat as it is shown, mm. It is unknown without a fabric.
    pub repeat: Option<f64>,
}

/// The most cover whose optical depth counts: a raster can't tell more from all of it.
const MOST_COVER: f64 = 0.998;

/// What a page says of a yarn system.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SystemFacts {
    /// Such as `Bar 1`.
    pub name: String,
    /// Such as its lapping and its yarn count.
    pub facts: Vec<String>,
}

impl Facts {
    /// Measures the fabric, which knits one repeat of it at its true scale.
    #[must_use]
    pub fn measured(fabric: &Fabric) -> Self {
        let real = Fabric { enlargement: 1.0, ..fabric.clone() };
        let pattern = Pattern::new(&real);
        Self::new(&real, &numbers::measure(&real, &pattern), (&real, &pattern))
    }

    /// The facts of a fabric whose numbers are known, and which is shown as another one is: its loops
    /// drawn larger, say.
    ///
    /// ```
    /// use warpknit_core::{fabric::Fabric, knit::{Pattern, numbers}};
    /// use warpknit_export::Facts;
    /// let tricot = Fabric::named("tricot")?;
    /// let pattern = Pattern::new(&tricot);
    /// let numbers = numbers::measure(&tricot, &pattern);
    /// let facts = Facts::new(&tricot, &numbers, (&tricot, &pattern));
    /// assert_eq!(facts.systems[0].name, "Bar 1");
    /// assert!(facts.cloth.iter().any(|(label, _)| *label == "Mass"));
    /// # Ok::<(), warpknit_core::fabric::FabricError>(())
    /// ```
    #[must_use]
    pub fn new(fabric: &Fabric, numbers: &Numbers, shown: (&Fabric, &Pattern)) -> Self {
        let drawn = fabric.wales_per_cm / shown.0.wales_per_cm;
        let mut cloth = vec![
            ("Wales", format!("{} /cm", rounded(fabric.wales_per_cm))),
            ("Courses", format!("{} /cm", rounded(fabric.courses_per_cm))),
            ("Mass", format!("{:.0} g/m²", numbers.mass)),
            ("Thickness", format!("{:.2} mm", numbers.thickness)),
            ("Cover", format!("{:.0} %", 100.0 * numbers.cover)),
            ("Yarn", format!("{} m/m²", rounded(numbers.yarn_length))),
        ];
        if (drawn - 1.0).abs() > 0.005 {
            cloth.push(("Loops drawn", format!("{drawn:.1} × true size")));
        }
        let kind = match fabric.structure {
            Structure::Warp(_) => "Bar",
            Structure::Weft(_) => "Feeder",
            Structure::Laid(_) => "Strand",
        };
        let systems = (0..fabric.yarn_systems()).map(|system| {
            let run_in = numbers.run_in.get(system).copied().flatten();
            let run_in = run_in.map(|run_in| format!("run-in {run_in:.0} mm/rack"));
            let own = [shortened(fabric.lapping(system)), fabric.yarn(system).count.to_string()];
            let facts = own.into_iter().chain(run_in).collect();
            SystemFacts { name: format!("{kind} {}", system + 1), facts }
        });
        Self {
            about: fabric.about.clone(),
            systems: systems.collect(),
            cloth,
            cover: Some(numbers.cover),
            depth_of_yarns: depth_of_yarns(fabric, numbers),
            visible_shares: visible_shares(shown.0, shown.1),
            repeat: Some(longer_side(shown.0)),
        }
    }
}

/// [`Facts::repeat`].
fn longer_side(fabric: &Fabric) -> f64 {
    let [wales, courses] =
        [fabric.threading_repeat(), fabric.repeat()].map(|count| f64::from(index32(count)));
    (wales * fabric.wale_spacing()).max(courses * fabric.course_spacing())
}

/// [`Facts::depth_of_yarns`].
fn depth_of_yarns(fabric: &Fabric, numbers: &Numbers) -> Option<f64> {
    let widths = fabric.thickness().into_iter().map(|thickness| 2.0 * thickness * fabric.radius());
    let lengths = fabric.yarns().zip(&numbers.bar_mass);
    // g/m² over g/km is km/m², and so many mm of yarn lie on each mm².
    let area: f64 =
        lengths.zip(widths).map(|((yarn, mass), width)| width * mass / yarn.tex_in_cloth()).sum();
    (area > 0.0).then(|| -(-numbers.cover.min(MOST_COVER)).ln_1p() / area)
}

/// A number with three digits or more, and no zeros behind its point.
fn rounded(number: f64) -> String {
    let digits = if number < 100.0 { 1 } else { 0 };
    let text = format!("{number:.digits$}");
    text.strip_suffix(".0").map_or(text.clone(), str::to_owned)
}

/// A chain, cut where it is too long to be read. Chains are ASCII.
fn shortened(mut chain: String) -> String {
    if chain.len() > LAPPING {
        chain.truncate(LAPPING);
        chain.push('…');
    }
    chain
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_has_the_numbers_of_a_fabric_and_of_its_bars() {
        let fabric = Fabric::named("locknit").unwrap();
        let pattern = Pattern::new(&fabric);
        let numbers = numbers::measure(&fabric, &pattern);
        let [wales, courses] = [fabric.wales_per_cm / 2.0, fabric.courses_per_cm / 2.0];
        let larger = fabric.clone().at_densities(wales, courses).unwrap();
        let facts = Facts::new(&fabric, &numbers, (&larger, &Pattern::new(&larger)));
        assert_eq!(facts.cloth[0], ("Wales", format!("{} /cm", rounded(fabric.wales_per_cm))));
        assert_eq!(facts.cloth.last(), Some(&("Loops drawn", "2.0 × true size".to_owned())));
        let run_in = format!("run-in {:.0} mm/rack", numbers.run_in[1].unwrap());
        assert_eq!(facts.systems[1].facts[2], run_in);
        assert_eq!(facts.systems[1].facts[0], fabric.lapping(1));
        // Weft yarns have no run-in, and laid ones are strands.
        let jersey = Facts::measured(&Fabric::named("jersey").unwrap());
        assert_eq!(
            (jersey.systems[0].name.as_str(), jersey.systems[0].facts.len()),
            ("Feeder 1", 2)
        );
        assert!(jersey.cloth.iter().all(|(label, _)| *label != "Loops drawn"));
    }

    /// Yarns of this net cross each other more often than by chance, and those of a jersey less often.
    #[test]
    fn the_optical_depth_of_yarns_is_that_of_the_cover() {
        for (name, depth) in [("hex-net-5", 0.9), ("jersey", 1.55)] {
            let found = Facts::measured(&Fabric::named(name).unwrap()).depth_of_yarns.unwrap();
            assert!((found - depth).abs() < 0.1, "{name}: {found}");
        }
        assert_eq!(Facts::default().depth_of_yarns, None);
    }

    #[test]
    fn a_number_has_no_needless_digits() {
        assert_eq!([15.0, 21.96, 1234.4].map(rounded), ["15", "22", "1234"]);
    }
}

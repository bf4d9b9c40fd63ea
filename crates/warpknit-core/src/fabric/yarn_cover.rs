//! How much yarn a fabric has for its area, from its lapping alone.
//!
//! In: a [`Fabric`]. Out: [`Fabric::yarn_cover`]. It compares one fabric with another yarn or other
//! densities, so that a change of the count can be judged before anything is knitted. Cost: the
//! laps of all bars. Not promised: the cover factor of the cloth
//! (`knit::numbers`). This sum counts yarns twice where they lie over each other, and its
//! lengths are those of a flat drawing, up to a quarter below relaxed ones. In the ratio of two
//! cloths of one lapping most of that cancels: it is within 15 %.

use super::bar::{Lay, RACK};
use super::lapping::Chain;
use super::{Fabric, LaidStrand, Structure, WarpKnit, WeftKnit};
use crate::ids::index32;

// The loop of a weft knit. Its legs run through 1.47 of the course spacing. The rest is what is
// missing to 4.1 wale spacings, the loop length of relaxed plain knit (Munden 1959), at
// C = 0.77 W.
const WEFT_LEGS: f64 = 2.0 * 1.47;
const WEFT_REST: f64 = 1.84;

impl Fabric {
    /// Estimated area of all yarns, length times true diameter, over the area of the cloth.
    ///
    /// ```
    /// use warpknit_core::fabric::Fabric;
    /// let locknit = Fabric::named("locknit")?;
    /// let finer = locknit.clone().with_counts(&["11 dtex".parse().unwrap()])?;
    /// // A quarter of the count is half the diameter.
    /// assert!((finer.yarn_cover() / locknit.yarn_cover() - 0.5).abs() < 1e-12);
    /// # Ok::<(), warpknit_core::fabric::FabricError>(())
    /// ```
    #[must_use]
    pub fn yarn_cover(&self) -> f64 {
        let (w, c) = (self.wale_spacing(), self.course_spacing());
        let length = |system: usize| match &self.structure {
            Structure::Warp(knit) => length_of_bar(knit, system, w, c),
            Structure::Weft(knit) => length_of_feeder(knit, system, w, c),
            Structure::Laid(cloth) => length_of_strand(&cloth.strands[system], w, c),
        };
        let yarns = self.yarns().enumerate();
        yarns.map(|(system, yarn)| length(system) / (w * c) * yarn.diameter()).sum()
    }
}

/// mm of a bar's yarns in a wale and a course.
fn length_of_bar(knit: &WarpKnit, bar: usize, w: f64, c: f64) -> f64 {
    let (bar, stitch) = (&knit.bars[bar], &knit.stitch);
    // A loop: two legs up to the head, and the head's width.
    let length_of_loop = 2.0 * (stitch.h3 * c + stitch.w4 * w);
    let threaded = share(bar.threading.repeat(), |guide| bar.threading.carries(guide));
    let length = match &bar.lay {
        Lay::Weft => w,
        Lay::Lapping(chain) => match bar.run_in {
            Some(run_in) => run_in / RACK,
            None => length_of_course(chain, length_of_loop, w, c),
        },
    };
    threaded * length * (1.0 + bar.slack.unwrap_or(0.0))
}

/// mm of a guide's yarn in a course, the mean of its chain.
fn length_of_course(chain: &Chain, length_of_loop: f64, w: f64, c: f64) -> f64 {
    let courses = chain.laps().len();
    let length = |course: i64| {
        let loops = f64::from(chain.lap(course).overlap().abs());
        let aside = f64::from(chain.underlap(course)) * w;
        loops * length_of_loop + aside.hypot(c)
    };
    (0_i64..).take(courses).map(length).sum::<f64>() / f64::from(index32(courses))
}

/// mm of a feeder's yarn in a wale and a course.
fn length_of_feeder(knit: &WeftKnit, feeder: usize, w: f64, c: f64) -> f64 {
    let courses = &knit.feeders[feeder].courses;
    share(courses.repeat(), |course| courses.carries(course)) * (WEFT_LEGS * c + WEFT_REST * w)
}

/// mm of a strand in its cell.
fn length_of_strand(strand: &LaidStrand, w: f64, c: f64) -> f64 {
    let place = |point: glam::DVec3| point * glam::DVec3::new(w, c, 1.0);
    let next = strand.path.iter().copied().skip(1);
    let next = next.chain([strand.path[0] + strand.direction.step()]);
    strand.path.iter().zip(next).map(|(&from, to)| place(from).distance(place(to))).sum()
}

/// The share of marks that are set.
fn share(marks: usize, is_set: impl Fn(i64) -> bool) -> f64 {
    let set = (0_i64..).take(marks).filter(|&mark| is_set(mark)).count();
    f64::from(index32(set)) / f64::from(index32(marks))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fabric::builtin;

    #[test]
    fn cloth_of_the_same_shape_has_the_same_cover() {
        for name in builtin::names() {
            let fabric = Fabric::named(name).unwrap();
            let counts: Vec<_> =
                fabric.yarns().map(|yarn| format!("{} tex", 4.0 * yarn.count.tex())).collect();
            let counts: Vec<_> = counts.iter().map(|count| count.parse().unwrap()).collect();
            let thick = fabric.clone().with_counts(&counts).unwrap().at_scale(2.0).unwrap();
            assert!((thick.yarn_cover() / fabric.yarn_cover() - 1.0).abs() < 1e-9, "{name}");
        }
    }

    #[test]
    fn a_given_length_is_taken() {
        let mut fabric = Fabric::named("weft-inserted").unwrap();
        let Structure::Warp(knit) = &mut fabric.structure else { unreachable!() };
        knit.bars[0].run_in = Some(960.0);
        knit.bars[1].slack = Some(0.25);
        let (w, c) = (fabric.wale_spacing(), fabric.course_spacing());
        let expected =
            2.0 / (w * c) * fabric.yarn(0).diameter() + 1.25 / c * fabric.yarn(1).diameter();
        assert!((fabric.yarn_cover() - expected).abs() < 1e-12);
    }
}

//! The eight-point stitch: the points through which the yarn of one lap passes, laid out so that
//! every loop is drawn through the old loops of its needle.
//!
//! In: a warp knit, its spacings and a layout radius. Out: [`StitchLayout`], which places the
//! points of each loop, inlay and underlap on straight wales, mm from gap 0 of guide 0 in course 0.
//! S1 and S8 are the feet (behind, where the underlaps join), S2 and S7 the lower legs, S3 and S6
//! the upper legs, S4 and S5 the head:
//!
//! ```text
//!      S4 ---- S5        z > 0 towards the technical face: legs lie in front of all heads,
//!     /          \
//!   S3            S6     heads at z = 0 and more,
//!     \          /
//!      S2      S7
//!   ---S1      S8---     the feet behind.
//! ```
//!
//! Five rules make the topology right for any lapping and threading, as long as the yarns are thin:
//!
//! 1. The loops of a needle in a course are ranked from the rear. The rear bar comes first; the
//!    second loop of an overlap over two needles lies behind the first.
//! 2. Loops of one needle have the same width and are stacked in depth: heads lie at their rank,
//!    legs in front of all heads. So no two loops of a needle cross on the face.
//! 3. Yarns come to a course line from below and leave it upward, each straight along its wale.
//!    They move sideways between the lines only, so underlaps never meet a foot.
//! 4. Each bar has its own layer on the technical back, the front bar outermost, inlays in the same
//!    order. A bar that laps two needles at once has two.
//! 5. The feet of the bars in front stand inside those of the bars behind.
//!
//! Source: the eight points are those of Liu, Kyosev and Jiang 2022, "Yarn-level modelling and
//! geometric simulation of warp-knitted clothing elements", section 2.1 and Fig. 2; the rules are
//! this project's, and `docs/method.md` has the table of [`Dimensions`]. Cost: some dozens of
//! nanoseconds a point. Not promised: room for thick yarns, which the relaxation (`relax`) makes.

use glam::DVec3;

use crate::fabric::lapping::Lap;
use crate::fabric::{Bar, Dimensions, Fabric, WarpKnit};
use crate::ids::index32;

/// Distance of two stacked yarns over the layout radius. Two would touch; the rest is air for the
/// curve between the points.
const PITCH: f64 = 2.4;
/// How far the feet of a rank stand inside those of the rank behind, pitches.
const FOOT_STEP: f64 = 1.5;
/// All steps of a needle's feet together take at most this share of the feet's distance from the
/// wale. At 1 the innermost feet would meet on the wale.
const FOOT_STEPS: f64 = 0.8;
/// The thickest layout radius over W, times the loops on a needle. The feet of all ranks share a
/// width of `FOOT_STEPS` times w1 (0.19 W) on each side, and take two radii a rank.
const ROOM: f64 = 0.07;
/// Depth of the rearmost layer, pitches: a part that every fabric has, and one for each loop on a
/// needle.
const REAR_LAYER: [f64; 2] = [1.0, 0.6];
/// How far along the wale yarns run straight beside a course line, courses. With less, sideways
/// strands touch the feet; with more, steep underlaps have no room between the lines.
const TURN: f64 = 0.18;
/// Distance of an underlap's first and last inner point from its ends, over W, and at most this
/// share of its length.
const UNDERLAP_INSET: [f64; 2] = [0.22, 0.3];
/// How far an inlay's two corners lie outside its run, over C. At 0 the yarn overshoots its corner;
/// larger values lengthen the float in the gap.
const INLAY_CORNER: f64 = 0.05;

/// Where the stitches of a warp knit lie on straight wales.
#[derive(Clone, Debug)]
pub(super) struct StitchLayout<'a> {
    knit: &'a WarpKnit,
    dimensions: Dimensions,
    /// W, mm.
    wale_spacing: f64,
    /// C, mm.
    course_spacing: f64,
    /// Layout radius, mm.
    radius: f64,
    /// Distance of stacked yarns, mm.
    pitch: f64,
    /// The most loops on one needle in one course.
    ranks: f64,
    /// Whether a loop's rank depends on its bar alone, as if all bars behind looped on each needle.
    is_ranked_by_bar: bool,
    /// How far behind the wale's plane the layers of each bar lie, front bar first, mm. The first
    /// loop of an overlap takes the first layer of its bar.
    depths: Vec<Vec<f64>>,
}

/// A loop of a bar: which guide forms it in which course, and its number in the overlap.
#[derive(Clone, Copy, Debug)]
pub(super) struct LoopPlace {
    pub(super) guide: i64,
    pub(super) course: i64,
    /// 0 for the first needle that the guide passes.
    pub(super) at: usize,
}

impl<'a> StitchLayout<'a> {
    /// The layout for yarns of a radius, mm.
    pub(super) fn new(fabric: &Fabric, knit: &'a WarpKnit, radius: f64) -> Self {
        Self::with_ranks(fabric, knit, radius, most_on_a_needle(fabric, knit))
    }

    fn with_ranks(fabric: &Fabric, knit: &'a WarpKnit, radius: f64, ranks: usize) -> Self {
        let (pitch, ranks) = (PITCH * radius, f64::from(index32(ranks.max(1))));
        Self {
            knit,
            dimensions: knit.stitch,
            wale_spacing: fabric.wale_spacing(),
            course_spacing: fabric.course_spacing(),
            radius,
            pitch,
            ranks,
            is_ranked_by_bar: false,
            depths: layer_depths(&knit.bars, ranks, pitch),
        }
    }

    /// The layout for a radius that is thin enough for any number of loops on a needle, at most
    /// `radius` mm.
    pub(super) fn thin(fabric: &Fabric, knit: &'a WarpKnit, radius: f64) -> Self {
        let ranks = f64::from(index32(most_on_a_needle(fabric, knit).max(1)));
        Self::new(fabric, knit, radius.min(ROOM / ranks * fabric.wale_spacing()))
    }

    /// A layout in which each bar is independent of the others, so that it serves for repeats of any
    /// size. It is deeper than [`Self::new`] where bars don't loop on the same needles.
    pub(super) fn of_any_repeat(fabric: &Fabric, knit: &'a WarpKnit, radius: f64) -> Self {
        let ranks = knit.bars.iter().map(most_loops).sum();
        Self { is_ranked_by_bar: true, ..Self::with_ranks(fabric, knit, radius, ranks) }
    }

    /// W and C, mm.
    pub(super) fn spacing(&self) -> glam::DVec2 {
        glam::DVec2::new(self.wale_spacing, self.course_spacing)
    }

    /// Depth of a bar's layer below the wale's plane, mm.
    pub(super) fn depth(&self, bar: usize) -> f64 {
        self.depths[bar][0]
    }

    /// S1 to S8 of a loop.
    pub(super) fn loop_points(&self, bar: usize, lap: Lap, place: LoopPlace) -> [DVec3; 8] {
        let (d, c) = (&self.dimensions, self.course_spacing);
        let needle = lap.needles().nth(place.at).expect("a lap has that loop");
        let wale = place.guide + i64::from(needle);
        let rank = f64::from(index32(self.rank(bar, place.at, wale, place.course)));
        let step = (FOOT_STEP * self.pitch).min(FOOT_STEPS * d.w1 * self.wale_spacing / self.ranks);
        let foot = d.w1 * self.wale_spacing - rank * step;
        let lower = foot * d.w2 / d.w1;
        let (leg, head) = ((self.ranks + rank) * self.pitch, rank * self.pitch);
        let layers = &self.depths[bar];
        // The guide swings in front of the needle in the overlap's direction, so the yarn enters
        // the loop on the opposite side.
        let entry = -f64::from(lap.overlap());
        let half = [
            DVec3::new(foot, 0.0, -layers[place.at.min(layers.len() - 1)]),
            DVec3::new(lower, d.h1 * c, leg),
            DVec3::new(d.w3 * self.wale_spacing, d.h2 * c, leg),
            DVec3::new(d.w4 * self.wale_spacing, d.h3 * c, head),
        ];
        let home = self.home(wale, place.course);
        std::array::from_fn(|at| {
            let (side, point) = if at < 4 { (entry, half[at]) } else { (-entry, half[7 - at]) };
            home + DVec3::new(side * point.x, point.y, point.z)
        })
    }

    /// Where a yarn turns into the wale before a loop that starts at `foot`, or out of it behind a
    /// loop that ends there (`direction` -1 or 1).
    pub(super) fn turn(&self, foot: DVec3, direction: f64) -> DVec3 {
        foot + DVec3::Y * (direction * TURN * self.course_spacing)
    }

    /// Where a yarn that goes over to an inlay in the next course enters that course's gap.
    pub(super) fn turn_into_gap(&self, bar: usize, gap: i64, course: i64) -> DVec3 {
        let [gap, course] = [gap, course].map(as_f64);
        let y = (course - TURN) * self.course_spacing;
        DVec3::new(gap * self.wale_spacing, y, -self.depth(bar))
    }

    /// Points of an inlay that runs in a course from one gap to another.
    pub(super) fn inlay_points(&self, bar: usize, [from, to]: [i64; 2], course: i64) -> Vec<DVec3> {
        let c = self.course_spacing;
        let place = |gap: f64, y: f64| {
            DVec3::new(gap * self.wale_spacing, (as_f64(course) + y) * c, -self.depth(bar))
        };
        let gaps = (to - from).abs();
        if gaps == 0 {
            return vec![place(as_f64(from), 0.5)];
        }
        // The run rises over the course: an inlay that passes many wales in one course has to cross
        // the underlaps of all of them. The range keeps thin yarns from lying flat on each other
        // and thick ones within their course.
        let rise = (1.125 * self.radius * as_f64(gaps) / c).clamp(0.12, 0.26);
        let mut points = vec![place(as_f64(from), 0.5 - rise - INLAY_CORNER)];
        points.extend((0..gaps).map(|wale| {
            let share = (as_f64(wale) + 0.5) / as_f64(gaps);
            place(as_f64(from) + as_f64(to - from) * share, 0.5 - rise + 2.0 * rise * share)
        }));
        points.push(place(as_f64(to), 0.5 + rise + INLAY_CORNER));
        points
    }

    /// Inner points of an underlap that passes over `wales` of them: near both ends, and one more
    /// for each wale. The path is a Catmull-Rom curve, and without these points the turns at its
    /// ends would make its long spans bulge.
    pub(super) fn underlap_points(
        &self,
        from: DVec3,
        to: DVec3,
        wales: u32,
    ) -> impl Iterator<Item = DVec3> + use<> {
        let length = (to - from).truncate().length().max(1e-9);
        let [inset, most] = UNDERLAP_INSET;
        let inset = (inset * self.wale_spacing / length).min(most);
        let points = if wales == 0 { 0 } else { wales + 1 };
        (0..points).map(move |point| {
            let share = f64::from(point) / f64::from(wales);
            from.lerp(to, inset + (1.0 - 2.0 * inset) * share)
        })
    }

    /// How many loops of its needle lie behind a loop.
    fn rank(&self, bar: usize, at: usize, wale: i64, course: i64) -> usize {
        let behind = self.knit.bars[bar + 1..].iter();
        let own = &self.knit.bars[bar];
        if self.is_ranked_by_bar {
            let later = most_loops(own).saturating_sub(at + 1);
            return later + behind.map(most_loops).sum::<usize>();
        }
        let later = own.chain().map_or(0, |chain| {
            let needles = chain.lap(course).needles().skip(at + 1);
            needles.filter(|&needle| own.threading.carries(wale - i64::from(needle))).count()
        });
        later + behind.map(|bar| bar.loop_count(wale, course)).sum::<usize>()
    }

    /// The foot of a wale's needle in a course, on the wale's plane.
    fn home(&self, wale: i64, course: i64) -> DVec3 {
        DVec3::new(
            (as_f64(wale) + 0.5) * self.wale_spacing,
            as_f64(course) * self.course_spacing,
            0.0,
        )
    }
}

/// The most needles over which a bar laps at once; 0 for inlays.
fn most_loops(bar: &Bar) -> usize {
    let laps = bar.chain().map_or(&[][..], |chain| chain.laps());
    laps.iter().map(|lap| lap.needles().count()).max().unwrap_or(0)
}

/// The most loops on one needle in one course.
fn most_on_a_needle(fabric: &Fabric, knit: &WarpKnit) -> usize {
    let [wales, courses] =
        [fabric.threading_repeat(), fabric.repeat()].map(|count| i64::from(index32(count)));
    let places = (0..courses).flat_map(|course| (0..wales).map(move |wale| (wale, course)));
    places.map(|(wale, course)| knit.threads_on(wale, course)).max().unwrap_or(0)
}

/// Depths of the layers of all bars, front bar first.
fn layer_depths(bars: &[Bar], ranks: f64, pitch: f64) -> Vec<Vec<f64>> {
    let mut depths = vec![Vec::new(); bars.len()];
    let mut depth = (REAR_LAYER[0] + REAR_LAYER[1] * ranks) * pitch;
    for (bar, layers) in bars.iter().zip(&mut depths).rev() {
        let needles = most_loops(bar).max(1);
        // The later loops of an overlap lie less deep than the first.
        layers.extend((0..needles).rev().map(|above| depth + f64::from(index32(above)) * pitch));
        depth += f64::from(index32(needles)) * pitch;
    }
    depths
}

#[expect(clippy::cast_precision_loss, reason = "wales and courses are counted in thousands")]
fn as_f64(count: i64) -> f64 {
    count as f64
}

//! The loop relaxation: where each wale runs once the underlaps have pulled at it.
//!
//! In: a [`Fabric`]. Out: a [`Lattice`], the control points of one repeat in balance, and places
//! relative to the bent wales. Nodes are masses; the yarn along the wale is a spring, every
//! underlap that changes the wale a spring under tension only, neighbouring wales bear against each
//! other. Source: the mass-spring model of Liu, Kyosev, Jiang 2022 (section 2.2) with the constants
//! of the specification's knit page; the paper prints none. Beyond the page, each thread on a
//! needle stiffens its wale, underlaps pull only so hard, and inlays turn near their wale: without,
//! wales of two-bar cloth zigzag until loops slip off each other. The cell is periodic, so the cost
//! depends on the repeat alone: nodes times steps (up to [`MOST_STEPS`]), about 30 ns each.

use glam::{DVec2, DVec3};

use super::stitch::Layer;
use crate::fabric::{Fabric, WarpKnit};
use crate::ids::index32;

// Constants of the specification, lengths in wale spacings.
const WALE_STIFFNESS: f64 = 1.0;
const UNDERLAP_STIFFNESS: f64 = 0.35;
/// An underlap's rest length over the distance that it spans.
const UNDERLAP_REST: f64 = 0.55;
/// No underlap is stretched by more than this, little more than one to the next wale is. The
/// specification has no such limit; but longer underlaps are fed more yarn, and pulled in
/// proportion they would tilt wales until loops slip off each other.
const MOST_STRETCH: f64 = 0.6;
const BENDING: f64 = 0.08;
const CONTACT_STIFFNESS: f64 = 6.0;
/// Neighbouring wales bear on each other below this gap.
const NEAREST_WALES: f64 = 0.60;
const ANCHOR: f64 = 0.01;
const DAMPING: f64 = 0.85;
const TIME_STEP: f64 = 0.15;
const BALANCED: f64 = 1e-4;
/// The most time steps that are taken.
pub(super) const MOST_STEPS: usize = 5000;

// Narrow gaps press loops together, down to a share of their width: they need so many radii of air,
// and so many times the width of their upper legs.
const AIR: f64 = 2.6;
const LOOP_WIDTH: f64 = 2.25;
const NARROWEST: f64 = 0.5;

/// An inlay turns at least so far from the wale that it holds on to, over W: a little outside its
/// loops.
const TURNS_BESIDE: f64 = 0.4;

/// The control points of a repeat, mm; gap 0 of guide 0 lies at x = 0, course 0 at y = 0.
#[derive(Clone, Debug)]
pub(super) struct Lattice {
    wales: usize,
    courses: usize,
    /// Wale after wale.
    nodes: Vec<DVec2>,
    wale_spacing: f64,
    course_spacing: f64,
}

/// What the nodes exert on each other, lengths in wale spacings.
struct Model {
    /// Threads that form the loops of each node: each adds its stiffness to the wale.
    threads: Vec<f64>,
    /// What each node weighs: its threads, or as much as its underlaps need so that a time step
    /// holds them.
    masses: Vec<f64>,
    springs: Vec<Spring>,
    rest: Vec<DVec2>,
    /// C/W.
    course: f64,
    period: DVec2,
}

/// A spring between two nodes.
struct Spring {
    from: (i64, i64),
    to: (i64, i64),
    rest: f64,
}

impl Lattice {
    /// Straight wales.
    pub(super) fn straight(fabric: &Fabric, wales: usize, courses: usize) -> Self {
        let (wale_spacing, course_spacing) = (fabric.wale_spacing(), fabric.course_spacing());
        let node = |wale: usize, course: usize| {
            DVec2::new(
                (f64::from(index32(wale)) + 0.5) * wale_spacing,
                f64::from(index32(course)) * course_spacing,
            )
        };
        let nodes = (0..wales)
            .flat_map(|wale| (0..courses).map(move |course| node(wale, course)))
            .collect();
        Self { wales, courses, nodes, wale_spacing, course_spacing }
    }

    /// Wales in balance, over one repeat of the fabric.
    pub(super) fn relaxed(fabric: &Fabric, knit: &WarpKnit) -> Self {
        let mut lattice = Self::straight(fabric, fabric.threading_repeat(), fabric.repeat());
        let model = lattice.model(knit);
        if !model.springs.is_empty() {
            lattice.balance(&model);
        }
        lattice
    }

    /// What acts on the straight lattice.
    fn model(&self, knit: &WarpKnit) -> Model {
        let course = self.course_spacing / self.wale_spacing;
        let (threads, springs) = (self.threads(knit), self.springs(knit));
        let mut pulls = vec![0.0; threads.len()];
        for (wale, course) in springs.iter().flat_map(|spring| [spring.from, spring.to]) {
            pulls[self.index(wale, course)] += UNDERLAP_STIFFNESS;
        }
        Model {
            masses: threads.iter().zip(pulls).map(|(threads, pulls)| pulls.max(*threads)).collect(),
            threads,
            springs,
            rest: self.nodes.iter().map(|node| *node / self.wale_spacing).collect(),
            course,
            period: DVec2::new(
                f64::from(index32(self.wales)),
                f64::from(index32(self.courses)) * course,
            ),
        }
    }

    /// How many threads loop on each node, at least one.
    fn threads(&self, knit: &WarpKnit) -> Vec<f64> {
        let places = (0..as_i64(self.wales))
            .flat_map(|wale| (0..as_i64(self.courses)).map(move |course| (wale, course)));
        let threads = |(wale, course)| knit.threads_on(wale, course).max(1);
        places.map(|place| f64::from(index32(threads(place)))).collect()
    }

    /// The underlaps of a repeat that change the wale.
    fn springs(&self, knit: &WarpKnit) -> Vec<Spring> {
        let mut springs = Vec::new();
        let aspect = self.course_spacing / self.wale_spacing;
        let mut tie = |from: (i64, i64), to: (i64, i64)| {
            #[expect(clippy::cast_precision_loss, reason = "wales and courses of one underlap")]
            let span = DVec2::new((to.0 - from.0) as f64, (to.1 - from.1) as f64 * aspect);
            if from.0 != to.0 {
                springs.push(Spring { from, to, rest: UNDERLAP_REST * span.length() });
            }
        };
        for bar in &knit.bars {
            let Some(chain) = bar.chain() else { continue };
            let guides = (0..as_i64(self.wales)).filter(|&guide| bar.threading.carries(guide));
            for (guide, course) in guides
                .flat_map(|guide| (0..as_i64(self.courses)).map(move |course| (guide, course)))
            {
                let (lap, next) = (chain.lap(course), chain.lap(course + 1));
                if lap.overlap() == 0 {
                    // An inlay holds the first and the last wale that it passes.
                    let (low, high) = (lap.from.min(next.from), lap.from.max(next.from));
                    if high - low >= 2 {
                        tie(
                            (guide + i64::from(low), course),
                            (guide + i64::from(high) - 1, course),
                        );
                    }
                    continue;
                }
                let needles: Vec<_> =
                    lap.needles().map(|needle| guide + i64::from(needle)).collect();
                needles.windows(2).for_each(|pair| tie((pair[0], course), (pair[1], course)));
                if let (Some(&last), Some(first)) = (needles.last(), next.needles().next()) {
                    tie((last, course), (guide + i64::from(first), course + 1));
                }
            }
        }
        springs
    }

    /// Steps through time, damped, until nothing moves.
    fn balance(&mut self, model: &Model) {
        self.nodes.clone_from(&model.rest);
        let mut velocities = vec![DVec2::ZERO; self.nodes.len()];
        let mut forces = velocities.clone();
        for _ in 0..MOST_STEPS {
            self.forces(model, &mut forces);
            let mut moves: f64 = 0.0;
            let moving = self.nodes.iter_mut().zip(&mut velocities);
            for ((node, velocity), (&force, &mass)) in moving.zip(forces.iter().zip(&model.masses))
            {
                *velocity = DAMPING * (*velocity + TIME_STEP / mass * force);
                *node += TIME_STEP * *velocity;
                moves = moves
                    .max(force.abs().max_element())
                    .max(TIME_STEP * velocity.abs().max_element());
            }
            let drift: DVec2 =
                self.nodes.iter().zip(&model.rest).map(|(node, rest)| *node - *rest).sum();
            let drift = drift / f64::from(index32(self.nodes.len()));
            self.nodes.iter_mut().for_each(|node| *node -= drift);
            if moves < BALANCED {
                break;
            }
        }
        self.nodes.iter_mut().for_each(|node| *node *= self.wale_spacing);
    }

    /// The force on every node; lengths in wale spacings.
    fn forces(&self, model: &Model, forces: &mut [DVec2]) {
        let at = |wale: i64, course: i64| self.index(wale, course);
        let node = |wale: i64, course: i64| self.image(wale, course, model.period);
        for (force, (node, rest)) in forces.iter_mut().zip(self.nodes.iter().zip(&model.rest)) {
            *force = ANCHOR * (*rest - *node);
        }
        for (w, c) in
            (0..as_i64(self.wales)).flat_map(|w| (0..as_i64(self.courses)).map(move |c| (w, c)))
        {
            let (here, up, down) = (node(w, c), node(w, c + 1), node(w, c - 1));
            let threads = model.threads[at(w, c)];
            let along = up - here;
            let length = along.length().max(1e-9);
            let pull = threads * WALE_STIFFNESS * (length - model.course) / length * along;
            forces[at(w, c)] += pull;
            forces[at(w, c + 1)] -= pull;
            let bend = threads * BENDING * (up.midpoint(down) - here);
            forces[at(w, c)] += bend;
            forces[at(w, c + 1)] -= 0.5 * bend;
            forces[at(w, c - 1)] -= 0.5 * bend;
            let push = CONTACT_STIFFNESS * (NEAREST_WALES - (node(w + 1, c).x - here.x)).max(0.0);
            forces[at(w, c)].x -= push;
            forces[at(w + 1, c)].x += push;
        }
        for spring in &model.springs {
            let span = node(spring.to.0, spring.to.1) - node(spring.from.0, spring.from.1);
            let length = span.length().max(1e-9);
            let pull = UNDERLAP_STIFFNESS * (length - spring.rest).clamp(0.0, MOST_STRETCH)
                / length
                * span;
            forces[at(spring.from.0, spring.from.1)] += pull;
            forces[at(spring.to.0, spring.to.1)] -= pull;
        }
    }

    fn index(&self, wale: i64, course: i64) -> usize {
        let wrap = |at: i64, size: usize| {
            usize::try_from(at.rem_euclid(as_i64(size))).expect("a remainder is not negative")
        };
        wrap(wale, self.wales) * self.courses + wrap(course, self.courses)
    }

    /// A node of any wale and course, `period` (of the repeat) away from the one it repeats.
    fn image(&self, wale: i64, course: i64, period: DVec2) -> DVec2 {
        #[expect(
            clippy::cast_precision_loss,
            reason = "garments have thousands of wales and courses"
        )]
        let turns = DVec2::new(
            wale.div_euclid(as_i64(self.wales)) as f64,
            course.div_euclid(as_i64(self.courses)) as f64,
        );
        self.nodes[self.index(wale, course)] + turns * period
    }

    /// The control point of a wale and a course, mm.
    fn node(&self, wale: i64, course: i64) -> DVec2 {
        let spacing = DVec2::new(self.wale_spacing, self.course_spacing);
        self.image(
            wale,
            course,
            spacing * DVec2::new(f64::from(index32(self.wales)), f64::from(index32(self.courses))),
        )
    }

    /// The axis of a wale (a uniform Catmull-Rom curve through its control points) at `course` and
    /// its unit tangent.
    fn axis(&self, wale: i64, course: f64) -> (DVec2, DVec2) {
        #[expect(clippy::cast_possible_truncation, reason = "courses are counted in thousands")]
        let below = course.floor() as i64;
        let t = course - course.floor();
        let [p0, p1, p2, p3] = [-1, 0, 1, 2].map(|step| self.node(wale, below + step));
        let (a, b, c) =
            (3.0 * p1 - p0 - 3.0 * p2 + p3, 2.0 * p0 - 5.0 * p1 + 4.0 * p2 - p3, p2 - p0);
        let place = p1 + 0.5 * (((a * t) + b) * t + c) * t;
        (place, ((3.0 * a * t + 2.0 * b) * t + c).normalize_or(DVec2::Y))
    }

    /// Where a point of a loop lies: `offset` (x to the right, y along the wale, z) from the
    /// control point of its wale and course.
    ///
    /// y runs along the bent wale and x across it, so that the loop's head turns into the next
    /// segment; where wales are close, loops get narrower. A rigid frame instead lets the loops of
    /// nets cut each other.
    pub(super) fn on_wale(&self, wale: i64, course: i64, offset: DVec3, layer: &Layer) -> DVec3 {
        #[expect(clippy::cast_precision_loss, reason = "courses are counted in thousands")]
        let (axis, tangent) = self.axis(wale, course as f64 + offset.y / self.course_spacing);
        let across = DVec2::new(tangent.y, -tangent.x);
        (axis + across * (offset.x * self.narrowing(wale, course, layer))).extend(offset.z)
    }

    /// How much narrower than drawn the loops of a stitch are.
    fn narrowing(&self, wale: i64, course: i64, layer: &Layer) -> f64 {
        let gap = |wale: i64, course: i64| {
            (self.node(wale + 1, course) - self.node(wale, course)).x / self.wale_spacing
        };
        let beside = [
            gap(wale, course),
            gap(wale - 1, course),
            gap(wale, course + 1),
            gap(wale - 1, course + 1),
        ];
        let gap = beside.into_iter().fold(f64::INFINITY, f64::min);
        ((gap - AIR * layer.radius / self.wale_spacing) / (LOOP_WIDTH * layer.dimensions.w3))
            .clamp(NARROWEST, 1.0)
    }

    /// Where a point between wales lies: `gap` counts gaps of the machine from gap 0, `y` is mm
    /// from course 0 (z as given).
    pub(super) fn between_wales(&self, gap: f64, y: f64, z: f64) -> DVec3 {
        // Wale w stands between gaps w and w + 1.
        let wale = gap - 0.5;
        #[expect(clippy::cast_possible_truncation, reason = "wales are counted in thousands")]
        let left = wale.floor() as i64;
        let course = y / self.course_spacing;
        self.axis(left, course).0.lerp(self.axis(left + 1, course).0, wale - wale.floor()).extend(z)
    }

    /// Where a yarn turns beside the last wale that it passes, to the right (`side` 1) or the left
    /// (-1): in the middle of the gap, but the nearer the more the gap has opened, for out in a
    /// net's mesh nothing holds it.
    pub(super) fn beside_wale(&self, wale: i64, side: i64, y: f64, z: f64) -> DVec3 {
        let course = y / self.course_spacing;
        let (own, other) = (self.axis(wale, course).0, self.axis(wale + side, course).0);
        let gap = own.distance(other).max(1e-9) / self.wale_spacing;
        let reach = (gap / 2.0).min((1.0 - gap / 2.0).max(TURNS_BESIDE));
        own.lerp(other, reach / gap).extend(z)
    }
}

fn as_i64(count: usize) -> i64 {
    i64::from(index32(count))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gaps(name: &str) -> (f64, f64) {
        let fabric = Fabric::named(name).unwrap();
        let lattice = Lattice::relaxed(&fabric, fabric.warp_knit().unwrap());
        let gap =
            |w: i64, c: i64| (lattice.node(w + 1, c) - lattice.node(w, c)).x / lattice.wale_spacing;
        let all = || (0..8).flat_map(|w| (0..24).map(move |c| (w, c))).map(|(w, c)| gap(w, c));
        (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max))
    }

    #[test]
    fn uniform_fabrics_keep_their_gaps() {
        for name in
            ["tricot", "locknit", "satin-lap", "atlas", "double-atlas", "tulle-3", "marquisette"]
        {
            let (low, high) = gaps(name);
            assert!(
                (low - 1.0).abs() < 1e-9 && (high - 1.0).abs() < 1e-9,
                "{name}: {low} to {high}"
            );
        }
    }

    #[test]
    fn nets_open() {
        // The specification: wales of half-set nets close in to about .57 and open to 1.43 of their
        // spacing.
        for name in ["atlas-net", "hex-net-3", "hex-net-5", "power-net"] {
            let (low, high) = gaps(name);
            assert!(
                (0.5..0.7).contains(&low) && (1.3..1.5).contains(&high),
                "{name}: {low} to {high}"
            );
        }
    }

    #[test]
    fn forces_are_in_balance_in_the_end() {
        let fabric = Fabric::named("hex-net-3").unwrap();
        let mut lattice = Lattice::straight(&fabric, fabric.threading_repeat(), fabric.repeat());
        let model = lattice.model(fabric.warp_knit().unwrap());
        lattice.balance(&model);
        lattice.nodes.iter_mut().for_each(|node| *node /= fabric.wale_spacing());
        let mut forces = vec![DVec2::ZERO; lattice.nodes.len()];
        lattice.forces(&model, &mut forces);
        let largest = forces.iter().map(|force| force.length()).fold(0.0, f64::max);
        // The last step moves both wales of a contact by up to BALANCED.
        assert!(largest < (1.0 + 2.0 * CONTACT_STIFFNESS) * BALANCED, "{largest}");
    }

    #[test]
    fn straight_wales_are_left_as_drawn() {
        let fabric = Fabric::named("tricot").unwrap();
        let lattice = Lattice::straight(&fabric, 1, 1);
        let layer = crate::knit::layers(&fabric, fabric.warp_knit().unwrap(), 1.0)[0];
        let offset = DVec3::new(0.1, 0.3, -0.2);
        let expected =
            offset + DVec3::new(2.5 * fabric.wale_spacing(), 3.0 * fabric.course_spacing(), 0.0);
        assert!(lattice.on_wale(2, 3, offset, &layer).distance(expected) < 1e-12);
        let beside = lattice.between_wales(1.0, 0.4, -0.1);
        assert!(beside.distance(DVec3::new(fabric.wale_spacing(), 0.4, -0.1)) < 1e-12);
    }
}

//! The lattice balance: a mass-spring model that bends the wales under the pull of the underlaps.
//!
//! In: a [`Fabric`]. Out: a [`WaleLattice`], the control points of one repeat in balance, which
//! places points relative to the bent wales.
//!
//! Method: control points are point masses. The yarn along the wale is a spring with bending
//! stiffness. Every underlap that changes the wale is a spring under tension only. Neighbouring
//! wales push each other apart below a least gap. Damped time steps (symplectic Euler) lead to the
//! equilibrium. The repeat is periodic in both directions, so the cost depends on the repeat alone:
//! nodes times steps (up to [`MAX_STEPS`]), about 30 ns each.
//!
//! Source: the mass-spring model of Liu, Kyosev and Jiang 2022, "Yarn-level modelling and geometric
//! simulation of warp-knitted clothing elements", section 2.2. The paper prints no constants; these
//! are this project's, and `docs/method.md` lists them. Three things go beyond the paper: each
//! thread on a needle stiffens its wale, the force of an underlap is limited, and inlays turn near
//! their wale. Without them the wales of two-bar cloth zigzag until loops slip off each other.
//!
//! Not promised: convergence within [`MAX_STEPS`]. Common fabrics take some hundred steps.

use glam::{DVec2, DVec3};

use super::{as_i64, wrap};
use crate::fabric::{Bar, Fabric, WarpKnit};
use crate::ids::index32;

// The model has no units: lengths are in wale spacings, and the stiffness of a wale of one thread
// is the unit of stiffness.

/// Stiffness of the yarn along the wale, a thread.
const WALE_STIFFNESS: f64 = 1.0;
/// Stiffness of an underlap. Its ratio to the wale's decides how far nets open: at 0 they stay
/// square, and near 1 underlaps shorten the courses too.
const UNDERLAP_STIFFNESS: f64 = 0.35;
/// An underlap's rest length over the distance that it spans. At 1 nothing pulls; much lower values
/// press all wales of a net to their least gap.
const UNDERLAP_REST: f64 = 0.55;
/// Limit of an underlap's elongation, little more than the elongation of one that goes to the next
/// wale. Machines feed longer underlaps more yarn. If they pulled in proportion to their length,
/// they would tilt wales until loops slip off each other; a limit of 2.3 was too high for random
/// fabrics of two bars. At 0 nothing pulls.
const MAX_ELONGATION: f64 = 0.6;
/// Bending stiffness of a wale, a thread. Without it single nodes leave their wale; much higher
/// values keep nets from opening.
const BENDING_STIFFNESS: f64 = 0.08;
/// Bending stiffness that a thread adds where it stays on its wale from course to course, as in a
/// pillar. Such a chain of loops is pulled tight and stands upright under the long underlaps of a
/// queenscord. At 0 its wales zigzag by a fifth of their spacing; much more needs shorter time
/// steps.
const PILLAR_STIFFNESS: f64 = 1.0;
/// Stiffness of the contact between neighbouring wales. It must be far over the underlaps', or
/// wales close beyond their least gap; the time step bounds it from above.
const CONTACT_STIFFNESS: f64 = 6.0;
/// Neighbouring wales touch below this gap. Wales of half-set nets close to about 0.57. At lower
/// values their loops cut each other; near 1 nets cannot open.
const MIN_WALE_GAP: f64 = 0.60;
/// Stiffness of a spring from each node to its straight place. It fixes the lattice where underlaps
/// pull equally in both directions. At 0 such a lattice may drift; at more it holds nets back.
const ANCHOR_STIFFNESS: f64 = 0.01;
/// Limit of a wale's sideways move from one course to the next, wale spacings. Nets need 0.43.
/// Irregular lappings that drop stitches lean by up to one wale, and the curve of a leg that leans
/// so much may leave the loop through which it is drawn.
const MAX_SLANT: f64 = 0.5;
/// Factor of the velocities in each step. At 1 the lattice oscillates for ever; near 0 it creeps.
const DAMPING: f64 = 0.85;
/// Length of a time step. Explicit steps are stable up to about 2 / sqrt(stiffness / mass) of the
/// stiffest motion: contact acts on a node from both sides, 2 / sqrt(4 * 6) = 0.4. Shorter steps
/// only take longer.
const TIME_STEP: f64 = 0.15;
/// Convergence tolerance of forces, and of a step's motion in wale spacings.
const TOLERANCE: f64 = 1e-4;
/// Limit of time steps, a bound for lattices that converge slowly.
pub(super) const MAX_STEPS: usize = 5000;

/// The control points of a repeat, mm; gap 0 of guide 0 lies at x = 0, course 0 at y = 0.
#[derive(Clone, Debug)]
pub(super) struct WaleLattice {
    wales: usize,
    courses: usize,
    /// Wale after wale.
    nodes: Vec<DVec2>,
    wale_spacing: f64,
    course_spacing: f64,
}

/// The masses and springs of the lattice, lengths in wale spacings.
struct MassSpringModel {
    /// Number of threads that form the loops of each node. Each adds its stiffness to the wale.
    threads: Vec<f64>,
    /// Bending stiffness of the wale at each node.
    bending: Vec<f64>,
    /// Mass of each node: its number of threads, or the stiffness of its underlaps if that is more.
    masses: Vec<f64>,
    springs: Vec<UnderlapSpring>,
    /// The straight lattice.
    rest: Vec<DVec2>,
    /// C/W.
    course: f64,
    /// From a node to its image one repeat to the right and one up.
    period: DVec2,
}

/// A spring between two nodes, each given by its wale and course.
struct UnderlapSpring {
    from: (i64, i64),
    to: (i64, i64),
    rest: f64,
}

impl WaleLattice {
    /// Straight wales.
    pub(super) fn straight(fabric: &Fabric, wales: usize, courses: usize) -> Self {
        let (wale_spacing, course_spacing) = (fabric.wale_spacing(), fabric.course_spacing());
        let mut nodes = Vec::with_capacity(wales * courses);
        for wale in 0..wales {
            let x = (f64::from(index32(wale)) + 0.5) * wale_spacing;
            let course = |course| DVec2::new(x, f64::from(index32(course)) * course_spacing);
            nodes.extend((0..courses).map(course));
        }
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

    /// By how much each control point lies beside that of another lattice of the same repeat, mm.
    pub(super) fn moved_from(&self, other: &Self) -> Vec<DVec2> {
        self.nodes.iter().zip(&other.nodes).map(|(own, other)| *own - *other).collect()
    }

    /// The springs and masses of a fabric, at rest on the straight lattice.
    fn model(&self, knit: &WarpKnit) -> MassSpringModel {
        let course = self.course_spacing / self.wale_spacing;
        let (threads, springs) = (self.threads(knit), self.springs(knit));
        let mut pulls = vec![0.0; threads.len()];
        for (wale, course) in springs.iter().flat_map(|spring| [spring.from, spring.to]) {
            pulls[self.index(wale, course)] += UNDERLAP_STIFFNESS;
        }
        MassSpringModel {
            // The frequency of a node is sqrt(stiffness / mass). A node on which many underlaps end
            // is heavier in proportion, so that the time step stays stable for any lapping. The
            // equilibrium does not depend on masses.
            masses: threads.iter().zip(pulls).map(|(threads, pulls)| pulls.max(*threads)).collect(),
            bending: self.bending(knit, &threads),
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

    /// Number of threads that loop on each node, at least one.
    fn threads(&self, knit: &WarpKnit) -> Vec<f64> {
        self.places()
            .map(|(wale, course)| f64::from(index32(knit.threads_on(wale, course).max(1))))
            .collect()
    }

    /// Bending stiffness of the wale at each node.
    fn bending(&self, knit: &WarpKnit, threads: &[f64]) -> Vec<f64> {
        let pillars =
            self.places().map(|(wale, course)| f64::from(index32(pillars_on(knit, wale, course))));
        let stiffness = threads.iter().zip(pillars);
        stiffness
            .map(|(threads, pillars)| threads * BENDING_STIFFNESS + pillars * PILLAR_STIFFNESS)
            .collect()
    }

    /// Wale and course of every node, in order.
    fn places(&self) -> impl Iterator<Item = (i64, i64)> {
        let (wales, courses) = (as_i64(self.wales), as_i64(self.courses));
        (0..wales).flat_map(move |wale| (0..courses).map(move |course| (wale, course)))
    }

    /// The underlaps of a repeat that change the wale.
    fn springs(&self, knit: &WarpKnit) -> Vec<UnderlapSpring> {
        let mut springs = Vec::new();
        for bar in &knit.bars {
            let Some(chain) = bar.chain() else { continue };
            let guides = (0..as_i64(self.wales)).filter(|&guide| bar.threading.carries(guide));
            for (guide, course) in guides
                .flat_map(|guide| (0..as_i64(self.courses)).map(move |course| (guide, course)))
            {
                let (lap, next) = (chain.lap(course), chain.lap(course + 1));
                if lap.overlap() == 0 {
                    // An inlay pulls at the first and the last wale around which it turns. It
                    // passes those between without a hold on them.
                    let (low, high) = (lap.from.min(next.from), lap.from.max(next.from));
                    if high - low >= 2 {
                        springs.extend(self.spring(
                            (guide + i64::from(low), course),
                            (guide + i64::from(high) - 1, course),
                        ));
                    }
                    continue;
                }
                let needles: Vec<_> =
                    lap.needles().map(|needle| guide + i64::from(needle)).collect();
                // An overlap over two needles ties their wales in its own course.
                springs.extend(
                    needles
                        .windows(2)
                        .filter_map(|pair| self.spring((pair[0], course), (pair[1], course))),
                );
                if let (Some(&last), Some(first)) = (needles.last(), next.needles().next()) {
                    springs.extend(
                        self.spring((last, course), (guide + i64::from(first), course + 1)),
                    );
                }
            }
        }
        springs
    }

    /// The spring of a yarn from one node to another; none within a wale, whose own spring acts
    /// there.
    fn spring(&self, from: (i64, i64), to: (i64, i64)) -> Option<UnderlapSpring> {
        let aspect = self.course_spacing / self.wale_spacing;
        #[expect(clippy::cast_precision_loss, reason = "wales and courses of one underlap")]
        let span = DVec2::new((to.0 - from.0) as f64, (to.1 - from.1) as f64 * aspect);
        (from.0 != to.0).then(|| UnderlapSpring { from, to, rest: UNDERLAP_REST * span.length() })
    }

    /// Takes damped time steps until the lattice is in balance.
    fn balance(&mut self, model: &MassSpringModel) {
        self.nodes.clone_from(&model.rest);
        let mut velocities = vec![DVec2::ZERO; self.nodes.len()];
        let mut forces = velocities.clone();
        for _ in 0..MAX_STEPS {
            self.forces(model, &mut forces);
            let mut residual: f64 = 0.0;
            let moving = self.nodes.iter_mut().zip(&mut velocities);
            for ((node, velocity), (&force, &mass)) in moving.zip(forces.iter().zip(&model.masses))
            {
                // Symplectic Euler: the new velocity moves the node. The old one would add energy
                // and make stiff springs explode at this time step.
                *velocity = DAMPING * (*velocity + TIME_STEP / mass * force);
                *node += TIME_STEP * *velocity;
                // Both are tested: a lattice that swings through its balance has no force there,
                // and one that turns has no velocity.
                residual = residual
                    .max(force.abs().max_element())
                    .max(TIME_STEP * velocity.abs().max_element());
            }
            // Internal forces cancel, but rounding moves the whole lattice. The fabric's place on
            // the panel must not depend on it, so the mean displacement is taken out.
            let drift: DVec2 =
                self.nodes.iter().zip(&model.rest).map(|(node, rest)| *node - *rest).sum();
            let drift = drift / f64::from(index32(self.nodes.len()));
            self.nodes.iter_mut().for_each(|node| *node -= drift);
            if residual < TOLERANCE {
                break;
            }
        }
        self.limit_slant(&model.rest);
        self.nodes.iter_mut().for_each(|node| *node *= self.wale_spacing);
    }

    /// Draws all nodes towards their rest places if a wale leans too much somewhere, lengths in
    /// wale spacings.
    fn limit_slant(&mut self, rest: &[DVec2]) {
        let moved: Vec<_> = self.nodes.iter().zip(rest).map(|(node, rest)| *node - *rest).collect();
        let slants = self.places().map(|(wale, course)| {
            (moved[self.index(wale, course + 1)].x - moved[self.index(wale, course)].x).abs()
        });
        let share = MAX_SLANT / slants.fold(MAX_SLANT, f64::max);
        for (node, (rest, moved)) in self.nodes.iter_mut().zip(rest.iter().zip(moved)) {
            *node = *rest + share * moved;
        }
    }

    /// Computes the force on every node; lengths in wale spacings.
    fn forces(&self, model: &MassSpringModel, forces: &mut [DVec2]) {
        // Nodes of any wale and course, as images of those of the repeat; forces on an image act on
        // the node itself.
        let at = |wale: i64, course: i64| self.index(wale, course);
        let node = |wale: i64, course: i64| self.image(wale, course, model.period);
        for (force, (node, rest)) in forces.iter_mut().zip(self.nodes.iter().zip(&model.rest)) {
            *force = ANCHOR_STIFFNESS * (*rest - *node);
        }
        for (w, c) in self.places() {
            let (here, up, down) = (node(w, c), node(w, c + 1), node(w, c - 1));
            let threads = model.threads[at(w, c)];
            // Hooke's law along the wale, at rest at one course.
            let along = up - here;
            let length = along.length().max(1e-9);
            let pull = threads * WALE_STIFFNESS * (length - model.course) / length * along;
            forces[at(w, c)] += pull;
            forces[at(w, c + 1)] -= pull;
            // Bending draws a node to the middle of its two neighbours, whose reactions keep the
            // sum of forces at zero.
            let bend = model.bending[at(w, c)] * (up.midpoint(down) - here);
            forces[at(w, c)] += bend;
            forces[at(w, c + 1)] -= 0.5 * bend;
            forces[at(w, c - 1)] -= 0.5 * bend;
            // Contact of wales acts across them only, and only by pushing.
            let push = CONTACT_STIFFNESS * (MIN_WALE_GAP - (node(w + 1, c).x - here.x)).max(0.0);
            forces[at(w, c)].x -= push;
            forces[at(w + 1, c)].x += push;
        }
        for spring in &model.springs {
            let span = node(spring.to.0, spring.to.1) - node(spring.from.0, spring.from.1);
            let length = span.length().max(1e-9);
            // A yarn pulls but cannot push: a slack underlap has no force.
            let pull = UNDERLAP_STIFFNESS * (length - spring.rest).clamp(0.0, MAX_ELONGATION)
                / length
                * span;
            forces[at(spring.from.0, spring.from.1)] += pull;
            forces[at(spring.to.0, spring.to.1)] -= pull;
        }
    }

    /// Index of the node that a wale and course repeat.
    fn index(&self, wale: i64, course: i64) -> usize {
        wrap(wale, self.wales) * self.courses + wrap(course, self.courses)
    }

    /// The node of any wale and course: an image of one of the repeat, whose size is `period`.
    fn image(&self, wale: i64, course: i64, period: DVec2) -> DVec2 {
        #[expect(
            clippy::cast_precision_loss,
            reason = "garments have thousands of wales and courses"
        )]
        let image_shift = DVec2::new(
            wale.div_euclid(as_i64(self.wales)) as f64,
            course.div_euclid(as_i64(self.courses)) as f64,
        );
        self.nodes[self.index(wale, course)] + image_shift * period
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

    /// The axis of a wale at `course`: a uniform Catmull-Rom curve through the wale's control points.
    fn axis(&self, wale: i64, course: f64) -> DVec2 {
        #[expect(clippy::cast_possible_truncation, reason = "courses are counted in thousands")]
        let below = course.floor() as i64;
        let t = course - course.floor();
        let [p0, p1, p2, p3] = [-1, 0, 1, 2].map(|step| self.node(wale, below + step));
        // Courses are evenly spaced but for small strains, so uniform knots have no loops or cusps
        // here, and the curve's parameter is the course itself.
        let (a, b, c) =
            (3.0 * p1 - p0 - 3.0 * p2 + p3, 2.0 * p0 - 5.0 * p1 + 4.0 * p2 - p3, p2 - p0);
        p1 + 0.5 * (((a * t) + b) * t + c) * t
    }

    /// Moves a point that is given on straight wales, mm from gap 0 and course 0, onto the bent
    /// ones; z stays as given.
    ///
    /// It is one map of the plane for all points. As long as wales keep their order it is
    /// injective, so what does not cross on straight wales does not cross on bent ones. A frame for
    /// each stitch would let neighbouring stitches cut each other.
    pub(super) fn bend(&self, point: DVec3) -> DVec3 {
        // Wale w stands between gaps w and w + 1.
        let wale = point.x / self.wale_spacing - 0.5;
        #[expect(clippy::cast_possible_truncation, reason = "wales are counted in thousands")]
        let left = wale.floor() as i64;
        let course = point.y / self.course_spacing;
        let [from, to] = [self.axis(left, course), self.axis(left + 1, course)];
        from.lerp(to, wale - wale.floor()).extend(point.z)
    }
}

/// How many threads loop on a needle in a course and in the courses before and after it.
fn pillars_on(knit: &WarpKnit, wale: i64, course: i64) -> usize {
    let stays = |bar: &&Bar| {
        let Some(chain) = bar.chain() else { return false };
        let [before, here, after] = [-1, 0, 1].map(|step| chain.lap(course + step));
        let stays = |needle: &i32| {
            bar.threading.carries(wale - i64::from(*needle))
                && [before, after].iter().all(|lap| lap.needles().any(|other| other == *needle))
        };
        here.needles().any(|needle| stays(&needle))
    };
    knit.bars.iter().filter(stays).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    impl WaleLattice {
        /// The gap to the right of a wale, over W.
        fn gap(&self, wale: i64, course: i64) -> f64 {
            (self.node(wale + 1, course) - self.node(wale, course)).x / self.wale_spacing
        }
    }

    fn gaps(name: &str) -> (f64, f64) {
        let fabric = Fabric::named(name).unwrap();
        let lattice = WaleLattice::relaxed(&fabric, fabric.warp_knit().unwrap());
        let places = || (0..8).flat_map(|w| (0..24).map(move |c| (w, c)));
        let all = || places().map(|(w, c)| lattice.gap(w, c));
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
        // Wales of half-set nets close to about 0.57 and open to 1.43 of their spacing.
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
        let mut lattice =
            WaleLattice::straight(&fabric, fabric.threading_repeat(), fabric.repeat());
        let model = lattice.model(fabric.warp_knit().unwrap());
        lattice.balance(&model);
        lattice.nodes.iter_mut().for_each(|node| *node /= fabric.wale_spacing());
        let mut forces = vec![DVec2::ZERO; lattice.nodes.len()];
        lattice.forces(&model, &mut forces);
        let largest = forces.iter().map(|force| force.length()).fold(0.0, f64::max);
        // The last step moves both wales of a contact by up to TOLERANCE.
        assert!(largest < (1.0 + 2.0 * CONTACT_STIFFNESS) * TOLERANCE, "{largest}");
    }

    #[test]
    fn straight_wales_are_left_as_drawn() {
        let fabric = Fabric::named("tricot").unwrap();
        let lattice = WaleLattice::straight(&fabric, 1, 1);
        let point = DVec3::new(0.31, -1.2, -0.2);
        assert!(lattice.bend(point).distance(point) < 1e-12);
    }
}

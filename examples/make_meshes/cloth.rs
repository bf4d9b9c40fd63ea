//! The cloth: particles, and the constraints that make them a knit.
//!
//! In: a pattern placed in space, unsewn or welded at its seams. Out: where its particles are after
//! a stage of simulation. Source: XPBD (Macklin, Müller, Chentanez 2016) in small steps of one
//! iteration (Macklin et al. 2019). Stretch and shear: a distance along every edge of the irregular
//! triangles. Bending: the quadratic energy of Bergou et al. 2006, whose constraint per inner edge
//! is a weighted sum of four points and so needs no angle. Friction: Coulomb's, on positions. Not
//! promised: physical units of time to rest; the drag is chosen to come to rest soon. The
//! constraints are solved one after the other in a fixed order, so a garment's result does not
//! depend on threads; garments run beside each other.

use glam::{DVec2, DVec3};

use crate::{body::Body, contact::near_pairs, pattern::Garment};

/// One iteration a step makes an edge yield by 2 STEP² / mass at the least, whatever its stiffness.
/// At 1/1200 s the weight of a skirt stretches its waist by 6 % for that reason alone, at 1/2400 s
/// by under 2 %.
const STEP: f64 = 1.0 / 2400.0;
/// Steps between two searches for near particles, which thus may approach each other by 0.3 cm in
/// 1/150 s.
const SEARCH_EVERY: u32 = 16;
/// No particle moves faster, in cm/s: a stop for seams that snap shut, far above the speeds of
/// draping.
const SPEED_LIMIT: f64 = 250.0;
/// The part of a layer's overlap that one step takes back. With all of it, layers pressed together
/// never come to rest.
const CONTACT_PART: f64 = 0.25;
/// The part of their relative movement that two touching particles lose in a step. Without it
/// pressed layers churn.
const RUBBING: f64 = 0.2;
const GRAVITY: DVec3 = DVec3::new(0.0, -981.0, 0.0);

/// What the cloth is like. Centimetre, gram, second: a force is in dyn, about a milligram's weight.
#[derive(Clone, Copy)]
pub(crate) struct Fabric {
    /// g/cm²; 0.02 is a light knit of 200 g/m².
    pub(crate) density: f64,
    /// Stiffness of an edge, dyn/cm. At 2e5 a skirt's own weight stretches it by less than 1 %.
    pub(crate) stretch: f64,
    /// Bending stiffness, dyn cm. A knit has 20 to 100; the more, the longer the folds.
    pub(crate) bending: f64,
    /// Distance kept from the body, and between layers of the cloth, in cm.
    pub(crate) clearance: f64,
    pub(crate) thickness: f64,
    pub(crate) friction: f64,
}

/// A part of the simulation.
#[derive(Clone, Copy)]
pub(crate) struct Stage {
    pub(crate) seconds: f64,
    /// 1 is the earth's.
    pub(crate) gravity: f64,
    /// The rate at which speeds decay, 1/s.
    pub(crate) drag: f64,
    pub(crate) self_contact: bool,
}

/// What the cloth meets: the body at a time, and where a held particle is at a time, given where it
/// started.
pub(crate) struct Scene<'a> {
    pub(crate) body: &'a dyn Fn(f64) -> Body,
    pub(crate) hold: &'a dyn Fn(f64, DVec3) -> DVec3,
}

struct Edge {
    ends: [u32; 2],
    rest: f64,
}

struct Hinge {
    points: [u32; 4],
    weights: [f64; 4],
    /// Compliance over the squared step, added to the constraint's inverse mass.
    softness: f64,
}

/// A seam that is being closed: the distance of its two vertices at the start.
struct Gap {
    ends: [u32; 2],
    rest: f64,
}

pub(crate) struct Cloth {
    pub(crate) position: Vec<DVec3>,
    velocity: Vec<DVec3>,
    previous: Vec<DVec3>,
    inverse_mass: Vec<f64>,
    start: Vec<DVec3>,
    edges: Vec<Edge>,
    hinges: Vec<Hinge>,
    gaps: Vec<Gap>,
    held: Vec<(u32, DVec3)>,
    near: Vec<[u32; 2]>,
    /// How far each particle may still move before it can touch the body; until then the body isn't
    /// asked.
    slack: Vec<f64>,
    fabric: Fabric,
    time: f64,
}

impl Cloth {
    /// The panels apart, each vertex a particle; a stage closes the seams evenly over its duration.
    pub(crate) fn unsewn(garment: &Garment, fabric: Fabric) -> Self {
        let particle_of: Vec<u32> =
            (0..u32::try_from(garment.flat.len()).expect("few vertices")).collect();
        let mut cloth = Self::new(garment, garment.start.clone(), &particle_of, fabric);
        let gap = |&ends: &[u32; 2]| {
            let [a, b] = ends.map(|end| garment.start[end as usize]);
            Gap { ends, rest: a.distance(b) }
        };
        cloth.gaps = garment.seams.iter().map(gap).collect();
        cloth
    }

    /// The garment with its seams closed: sewn vertices are one particle, at the mean of
    /// `positions`, one a vertex.
    pub(crate) fn sewn(garment: &Garment, positions: &[DVec3], fabric: Fabric) -> Self {
        let (particle_of, count) = garment.welded();
        let mut sums = vec![(DVec3::ZERO, 0.0); count];
        for (&particle, &position) in particle_of.iter().zip(positions) {
            sums[particle as usize].0 += position;
            sums[particle as usize].1 += 1.0;
        }
        let means = sums.into_iter().map(|(sum, number)| sum / number).collect();
        Self::new(garment, means, &particle_of, fabric)
    }

    fn new(garment: &Garment, position: Vec<DVec3>, particle_of: &[u32], fabric: Fabric) -> Self {
        let mut mass = vec![0.0; position.len()];
        for &triangle in &garment.triangles {
            for vertex in triangle {
                mass[particle_of[vertex as usize] as usize] +=
                    fabric.density * area(garment, triangle) / 3.0;
            }
        }
        Self {
            velocity: vec![DVec3::ZERO; position.len()],
            previous: position.clone(),
            inverse_mass: mass.iter().map(|mass| mass.recip()).collect(),
            start: position.clone(),
            edges: edges(garment, particle_of),
            hinges: hinges(garment, particle_of, fabric),
            gaps: Vec::new(),
            held: Vec::new(),
            near: Vec::new(),
            slack: vec![0.0; position.len()],
            position,
            fabric,
            time: 0.0,
        }
    }

    /// Holds particles; from now on the scene says where they are.
    pub(crate) fn hold(&mut self, particles: impl IntoIterator<Item = u32>) {
        for particle in particles {
            self.inverse_mass[particle as usize] = 0.0;
            self.held.push((particle, self.position[particle as usize]));
        }
    }

    /// The root of the mean squared speed, in cm/s.
    pub(crate) fn speed(&self) -> f64 {
        let sum: f64 = self.velocity.iter().map(|velocity| velocity.length_squared()).sum();
        (sum / self.velocity.len() as f64).sqrt()
    }

    pub(crate) fn run(&mut self, stage: Stage, scene: &Scene) {
        let steps = DVec2::splat(stage.seconds / STEP).round().as_uvec2().x;
        let mut before = (scene.body)(self.time);
        for step in 0..steps {
            self.time += STEP;
            let body = (scene.body)(self.time).moved_from(&before);
            if stage.self_contact && step % SEARCH_EVERY == 0 {
                self.near = near_pairs(&self.position, &self.start, self.fabric.thickness);
            }
            self.move_freely(stage, scene);
            self.solve_edges();
            self.solve_hinges();
            self.close_gaps(1.0 - f64::from(step + 1) / f64::from(steps));
            if stage.self_contact {
                self.keep_layers_apart();
            }
            self.keep_off(&body);
            self.take_speeds();
            before = body;
        }
    }

    fn move_freely(&mut self, stage: Stage, scene: &Scene) {
        let kept = (-stage.drag * STEP).exp();
        for (index, position) in self.position.iter_mut().enumerate() {
            self.previous[index] = *position;
            if self.inverse_mass[index] > 0.0 {
                *position += STEP * kept * (self.velocity[index] + STEP * stage.gravity * GRAVITY);
            }
        }
        for &(particle, start) in &self.held {
            self.position[particle as usize] = (scene.hold)(self.time, start);
        }
    }

    fn solve_edges(&mut self) {
        let softness = 1.0 / (self.fabric.stretch * STEP * STEP);
        for edge in &self.edges {
            pull(&mut self.position, &self.inverse_mass, edge.ends, edge.rest, softness);
        }
    }

    /// The constraint is the weighted sum itself, a vector that is zero where the two triangles lie
    /// flat.
    fn solve_hinges(&mut self) {
        for hinge in &self.hinges {
            let points = hinge.points.map(|point| point as usize);
            let mut sum = DVec3::ZERO;
            let mut resistance = hinge.softness;
            for (&point, weight) in points.iter().zip(hinge.weights) {
                sum += weight * self.position[point];
                resistance += self.inverse_mass[point] * weight * weight;
            }
            let push = sum / resistance;
            for (&point, weight) in points.iter().zip(hinge.weights) {
                self.position[point] -= self.inverse_mass[point] * weight * push;
            }
        }
    }

    /// Draws the seams together to the given part of their first distance.
    fn close_gaps(&mut self, part: f64) {
        for gap in &self.gaps {
            pull(&mut self.position, &self.inverse_mass, gap.ends, gap.rest * part, 0.0);
        }
    }

    fn keep_layers_apart(&mut self) {
        for &[i, j] in &self.near {
            let (i, j) = (i as usize, j as usize);
            let apart = self.position[i] - self.position[j];
            let (distance, sum) = (apart.length(), self.inverse_mass[i] + self.inverse_mass[j]);
            if distance < self.fabric.thickness && distance > 0.0 && sum > 0.0 {
                let push =
                    apart * (CONTACT_PART * (self.fabric.thickness - distance) / (distance * sum));
                self.position[i] += self.inverse_mass[i] * push;
                self.position[j] -= self.inverse_mass[j] * push;
                let moved =
                    [i, j].map(|particle| self.position[particle] - self.previous[particle]);
                let rub = (moved[0] - moved[1]) * (RUBBING / sum);
                self.position[i] -= self.inverse_mass[i] * rub;
                self.position[j] += self.inverse_mass[j] * rub;
            }
        }
    }

    /// Pushes particles out of the body; friction takes back their sliding, up to a part of how
    /// deep they were.
    fn keep_off(&mut self, body: &Body) {
        let farthest = body.farthest_drift();
        for (index, position) in self.position.iter_mut().enumerate() {
            self.slack[index] -= position.distance(self.previous[index]) + farthest;
            if self.inverse_mass[index] == 0.0 || self.slack[index] > 0.0 {
                continue;
            }
            let touch = body.touch(*position);
            let depth = self.fabric.clearance - touch.distance;
            self.slack[index] = -depth;
            if depth <= 0.0 {
                continue;
            }
            *position += depth * touch.normal;
            let moved = *position - self.previous[index] - touch.drift;
            let sliding = moved - moved.dot(touch.normal) * touch.normal;
            let grip = self.fabric.friction * depth;
            *position -= sliding * (grip / sliding.length().max(grip));
        }
    }

    fn take_speeds(&mut self) {
        for (index, position) in self.position.iter().enumerate() {
            self.velocity[index] =
                ((*position - self.previous[index]) / STEP).clamp_length_max(SPEED_LIMIT);
        }
    }
}

/// Moves two particles towards the distance `rest`.
fn pull(position: &mut [DVec3], inverse_mass: &[f64], ends: [u32; 2], rest: f64, softness: f64) {
    let [i, j] = ends.map(|end| end as usize);
    let sum = inverse_mass[i] + inverse_mass[j];
    let apart = position[i] - position[j];
    let distance = apart.length();
    if sum == 0.0 || distance == 0.0 {
        return;
    }
    let push = apart * ((distance - rest) / (distance * (sum + softness)));
    position[i] -= inverse_mass[i] * push;
    position[j] += inverse_mass[j] * push;
}

fn area(garment: &Garment, triangle: [u32; 3]) -> f64 {
    let [a, b, c] = triangle.map(|vertex| garment.flat[vertex as usize]);
    0.5 * (b - a).perp_dot(c - a)
}

/// Every edge of the pattern once. At a seam both panels' edges are there, so that each keeps its
/// own length.
fn edges(garment: &Garment, particle_of: &[u32]) -> Vec<Edge> {
    let mut pairs: Vec<[u32; 2]> = Vec::new();
    for &[a, b, c] in &garment.triangles {
        pairs.extend([[a.min(b), a.max(b)], [b.min(c), b.max(c)], [c.min(a), c.max(a)]]);
    }
    pairs.sort_unstable();
    pairs.dedup();
    let edge = |[a, b]: [u32; 2]| Edge {
        ends: [particle_of[a as usize], particle_of[b as usize]],
        rest: garment.flat[a as usize].distance(garment.flat[b as usize]),
    };
    pairs.into_iter().map(edge).collect()
}

/// One hinge for every two triangles that share an edge, be it within a panel or along a closed
/// seam.
fn hinges(garment: &Garment, particle_of: &[u32], fabric: Fabric) -> Vec<Hinge> {
    // For each triangle's edge: its particles, the triangle, and which corner lies opposite.
    let mut sides: Vec<([u32; 2], usize, usize)> = Vec::new();
    for (index, triangle) in garment.triangles.iter().enumerate() {
        for corner in 0..3 {
            let [a, b] = [1, 2].map(|step| particle_of[triangle[(corner + step) % 3] as usize]);
            sides.push(([a.min(b), a.max(b)], index, corner));
        }
    }
    sides.sort_unstable();
    let mut hinges: Vec<Hinge> = Vec::new();
    for pair in sides.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
        let ends = pair[0].0;
        let opposite =
            |side: usize| particle_of[garment.triangles[pair[side].1][pair[side].2] as usize];
        let (first, second) =
            (cotangents(garment, particle_of, pair[0]), cotangents(garment, particle_of, pair[1]));
        let both_areas = area(garment, garment.triangles[pair[0].1])
            + area(garment, garment.triangles[pair[1].1]);
        hinges.push(Hinge {
            points: [ends[0], ends[1], opposite(0), opposite(1)],
            weights: [
                first[1] + second[1],
                first[0] + second[0],
                -(first[0] + first[1]),
                -(second[0] + second[1]),
            ],
            softness: both_areas / (3.0 * fabric.bending * STEP * STEP),
        });
    }
    hinges
}

/// The cotangents of a triangle's angles at the two ends of a side, the end with the lower particle
/// number first.
fn cotangents(garment: &Garment, particle_of: &[u32], side: ([u32; 2], usize, usize)) -> [f64; 2] {
    let (ends, triangle, corner) = side;
    let vertices = garment.triangles[triangle];
    let [a, b] = [1, 2].map(|step| vertices[(corner + step) % 3]);
    let [low, high] = if particle_of[a as usize] == ends[0] { [a, b] } else { [b, a] };
    let [top, low, high] =
        [vertices[corner], low, high].map(|vertex| garment.flat[vertex as usize]);
    let cotangent = |from: DVec2, other: DVec2| {
        let (u, v) = (other - from, top - from);
        u.dot(v) / u.perp_dot(v).abs()
    };
    [cotangent(low, high), cotangent(high, low)]
}

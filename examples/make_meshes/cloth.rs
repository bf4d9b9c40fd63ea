//! The cloth simulation: particles, and the constraints that make them behave like a knit.
//!
//! In: a pattern placed in space, with open or welded seams. Out: the positions of its particles
//! after a stage of simulation.
//!
//! Method: extended position-based dynamics (Macklin, Müller and Chentanez 2016, "XPBD:
//! position-based simulation of compliant constrained dynamics") in small steps of one iteration
//! (Macklin et al. 2019, "Small steps in physics simulation"). Stretch and shear: a distance
//! constraint along every edge of the irregular triangles. Bending: the quadratic energy of Bergou
//! et al. 2006, "A quadratic bending model for inextensible surfaces", whose constraint for an
//! inner edge is a weighted sum of four points and so needs no angle. Friction: Coulomb's law,
//! applied to positions.
//!
//! Constraints are solved one after the other in a fixed order (Gauss-Seidel), so the result does
//! not depend on threads; several garments run in parallel. Not promised: a realistic time to come
//! to rest, since the drag is chosen so that it is short.

use glam::{DVec2, DVec3};

use crate::{body::Body, contact::near_pairs, pattern::Garment};

/// Time step, s. With one iteration a step, an edge has a compliance of at least 2 STEP² / mass,
/// whatever its stiffness. At 1/1200 s the weight of a skirt stretches its waist by 6 % for that
/// reason alone, at 1/2400 s by under 2 %.
const STEP: f64 = 1.0 / 2400.0;
/// Steps between two updates of the neighbour list. Particles may approach each other by the list's
/// margin of 0.3 cm in these 1/150 s.
const SEARCH_EVERY: u32 = 16;
/// Limit of a particle's speed, cm/s. It restrains seams that snap shut, and lies far above the
/// speeds of draping.
const SPEED_LIMIT: f64 = 250.0;
/// Share of the overlap of two layers that one step corrects (under-relaxation). With all of it,
/// layers that are pressed together never come to rest.
const CONTACT_PART: f64 = 0.25;
/// Share of their relative displacement that two touching particles lose in a step. Without this
/// friction, layers that are pressed together keep moving.
const RUBBING: f64 = 0.2;
const GRAVITY: DVec3 = DVec3::new(0.0, -981.0, 0.0);

/// Material parameters, in centimetre, gram and second: a force is in dyn, about the weight of a
/// milligram.
#[derive(Clone, Copy)]
pub(crate) struct Fabric {
    /// g/cm²; 0.02 is a light knit of 200 g/m².
    pub(crate) density: f64,
    /// Stiffness of an edge, dyn/cm. At 2e5 a skirt's own weight stretches it by less than 1 %.
    pub(crate) stretch: f64,
    /// Bending stiffness, dyn cm. A knit has 20 to 100. A stiffer cloth has longer folds.
    pub(crate) bending: f64,
    /// Distance from the body, cm.
    pub(crate) clearance: f64,
    /// Distance between layers of the cloth, cm.
    pub(crate) thickness: f64,
    /// Coulomb's friction coefficient between cloth and body.
    pub(crate) friction: f64,
}

/// A stage of the simulation.
#[derive(Clone, Copy)]
pub(crate) struct Stage {
    pub(crate) seconds: f64,
    /// Gravity as a factor of the earth's.
    pub(crate) gravity: f64,
    /// Rate at which velocities decay, 1/s.
    pub(crate) drag: f64,
    pub(crate) self_contact: bool,
}

/// The boundary conditions: the body at a time, and the position of a fixed particle at a time,
/// given its first position.
pub(crate) struct Scene<'a> {
    pub(crate) body: &'a dyn Fn(f64) -> Body,
    pub(crate) hold: &'a dyn Fn(f64, DVec3) -> DVec3,
}

/// A distance constraint.
struct Edge {
    ends: [u32; 2],
    rest: f64,
}

/// A bending constraint of two triangles that share an edge.
struct Hinge {
    points: [u32; 4],
    weights: [f64; 4],
    /// Compliance over the squared step, added to the constraint's inverse mass.
    softness: f64,
}

/// A pair of vertices of a seam that is being closed, with their distance at the start.
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
    /// The neighbour list: pairs of particles that may touch before its next update.
    near: Vec<[u32; 2]>,
    /// Distance that each particle may still move before it can touch the body. Until then the
    /// body's distance field is not evaluated.
    slack: Vec<f64>,
    fabric: Fabric,
    time: f64,
}

impl Cloth {
    /// The cloth with open seams: each vertex is a particle. The next stage closes the seams evenly
    /// over its duration.
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

    /// The cloth with closed seams: sewn vertices are one particle, at the mean of their positions.
    /// `positions` has one for each vertex.
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
        // Lumped masses: each triangle gives a third of its mass to each of its corners.
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

    /// Fixes particles: from now on the scene gives their positions. Their inverse mass is 0, so
    /// that constraints don't move them.
    pub(crate) fn hold(&mut self, particles: impl IntoIterator<Item = u32>) {
        for particle in particles {
            self.inverse_mass[particle as usize] = 0.0;
            self.held.push((particle, self.position[particle as usize]));
        }
    }

    /// Root mean square of the speeds, cm/s.
    pub(crate) fn speed(&self) -> f64 {
        let sum: f64 = self.velocity.iter().map(|velocity| velocity.length_squared()).sum();
        (sum / self.velocity.len() as f64).sqrt()
    }

    /// Simulates a stage.
    pub(crate) fn run(&mut self, stage: Stage, scene: &Scene) {
        let steps = DVec2::splat(stage.seconds / STEP).round().as_uvec2().x;
        let mut before = (scene.body)(self.time);
        for step in 0..steps {
            self.time += STEP;
            let body = (scene.body)(self.time).moved_from(&before);
            if stage.self_contact && step % SEARCH_EVERY == 0 {
                self.near = near_pairs(&self.position, &self.start, self.fabric.thickness);
            }
            // Position-based dynamics: predict positions, project the constraints once, and take
            // the velocities from the change of positions. The body comes last, so that no other
            // constraint can push a particle back into it.
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

    /// The prediction: moves particles by their velocities, gravity and drag, and fixed ones to
    /// their places.
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

    /// Projects the distance constraints.
    fn solve_edges(&mut self) {
        // XPBD's compliance over the squared time step (Macklin et al. 2016, α̃ = α / Δt²).
        let softness = 1.0 / (self.fabric.stretch * STEP * STEP);
        for edge in &self.edges {
            pull(&mut self.position, &self.inverse_mass, edge.ends, edge.rest, softness);
        }
    }

    /// Projects the bending constraints. A constraint is the weighted sum of the four points, a
    /// vector that is 0 where the two triangles lie in one plane.
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

    /// Pulls the seams together to the given share of their first distance.
    fn close_gaps(&mut self, part: f64) {
        for gap in &self.gaps {
            pull(&mut self.position, &self.inverse_mass, gap.ends, gap.rest * part, 0.0);
        }
    }

    /// Projects the contacts between layers of the cloth, with friction.
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
                // Friction takes back a share of the relative displacement in this step.
                let moved =
                    [i, j].map(|particle| self.position[particle] - self.previous[particle]);
                let rub = (moved[0] - moved[1]) * (RUBBING / sum);
                self.position[i] -= self.inverse_mass[i] * rub;
                self.position[j] += self.inverse_mass[j] * rub;
            }
        }
    }

    /// Projects the contacts with the body. Friction takes back the sliding, up to the friction
    /// coefficient times the depth (Coulomb's law on positions).
    fn keep_off(&mut self, body: &Body) {
        let farthest = body.farthest_drift();
        for (index, position) in self.position.iter_mut().enumerate() {
            self.slack[index] -= position.distance(self.previous[index]) + farthest;
            if self.inverse_mass[index] == 0.0 || self.slack[index] > 0.0 {
                continue;
            }
            // Conservative bound: a distance field changes by at most the distance moved, so most
            // particles need no evaluation in most steps.
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

    /// Takes the velocities from the change of positions.
    fn take_speeds(&mut self) {
        for (index, position) in self.position.iter().enumerate() {
            self.velocity[index] =
                ((*position - self.previous[index]) / STEP).clamp_length_max(SPEED_LIMIT);
        }
    }
}

/// Projects a distance constraint: moves two particles toward the distance `rest`, in proportion to
/// their inverse masses.
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

/// The area of a flat triangle.
fn area(garment: &Garment, triangle: [u32; 3]) -> f64 {
    let [a, b, c] = triangle.map(|vertex| garment.flat[vertex as usize]);
    0.5 * (b - a).perp_dot(c - a)
}

/// Every edge of the pattern once. At a seam the edges of both panels are kept, so that each keeps
/// its own length.
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

/// One hinge for every two triangles that share an edge, within a panel or along a closed seam.
fn hinges(garment: &Garment, particle_of: &[u32], fabric: Fabric) -> Vec<Hinge> {
    // For each side of each triangle: its particles, the triangle, and the opposite corner. After
    // sorting, the two sides of an inner edge are neighbours.
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
        // Bergou et al. 2006: the weights are sums of cotangents of the angles at the edge, and the
        // energy is 3 / (A0 + A1) times the squared sum.
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

/// The cotangents of a triangle's angles at the two ends of a side. The end with the lower particle
/// number comes first.
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

//! Self-contact of the cloth: the neighbour list of particles.
//!
//! In: particle positions, now and at the start. Out: the pairs that are too near or may soon be.
//!
//! Method: a spatial hash grid (Teschner et al. 2003, "Optimized spatial hashing for collision
//! detection of deformable objects"), and repulsion between particles as in Müller 2022, "Ten
//! Minute Physics 15: self-collision". A pair that was about as near as the thickness at the start
//! is left alone, since it is near within the cloth. Cost: linear in particles and pairs.
//!
//! Not promised: a full collision response. Layers stay apart as long as the thickness is over 0.6
//! edge lengths (the distance from a triangle's centre to its corners), but two layers that have
//! passed through each other stay so.

use glam::{DVec3, IVec3};

/// Margin of the neighbour list, cm, as in a Verlet list: with it, one list serves several steps. A
/// larger margin makes the list longer, a smaller one misses fast particles.
const MARGIN: f64 = 0.3;

/// A grid of cubes, hashed into a table. The particles of a table entry lie side by side in
/// `members` (counting sort).
struct Grid {
    cell: f64,
    starts: Vec<u32>,
    members: Vec<u32>,
}

impl Grid {
    fn new(positions: &[DVec3], cell: f64) -> Self {
        let mut grid =
            Self { cell, starts: vec![0; positions.len() + 1], members: vec![0; positions.len()] };
        let slots: Vec<usize> =
            positions.iter().map(|&position| grid.slot(grid.cube(position))).collect();
        // Counting sort: counts, their running sum, and then each entry is filled from its end.
        for &slot in &slots {
            grid.starts[slot] += 1;
        }
        let mut sum = 0;
        for start in &mut grid.starts {
            sum += *start;
            *start = sum;
        }
        for (particle, &slot) in (0_u32..).zip(&slots) {
            grid.starts[slot] -= 1;
            grid.members[grid.starts[slot] as usize] = particle;
        }
        grid
    }

    /// The cube that contains a position.
    fn cube(&self, position: DVec3) -> IVec3 {
        (position / self.cell).floor().as_ivec3()
    }

    /// The table entry of a cube, with the primes of Müller's implementation.
    fn slot(&self, cube: IVec3) -> usize {
        let mixed = cube.as_i64vec3() * glam::I64Vec3::new(92_837_111, 689_287_499, 283_923_481);
        let hash = (mixed.x ^ mixed.y ^ mixed.z).unsigned_abs();
        usize::try_from(hash % self.members.len() as u64)
            .expect("less than the number of particles")
    }

    /// The particles in a cube's table entry.
    fn members(&self, cube: IVec3) -> &[u32] {
        let slot = self.slot(cube);
        &self.members[self.starts[slot] as usize..self.starts[slot + 1] as usize]
    }
}

/// Offsets to half of the 27 cubes around a cube. Taken for every cube, they meet each pair of
/// cubes once. The first one is the cube itself.
fn half_of_neighbours() -> impl Iterator<Item = IVec3> {
    (0..27).map(|index| IVec3::new(index % 3, index / 3 % 3, index / 9) - 1).skip(13)
}

/// All pairs nearer than `thickness` plus the margin, whose distance in `start` was well over
/// `thickness`.
pub(crate) fn near_pairs(positions: &[DVec3], start: &[DVec3], thickness: f64) -> Vec<[u32; 2]> {
    let reach = thickness + MARGIN;
    let grid = Grid::new(positions, reach);
    let mut pairs = Vec::new();
    for (i, &position) in (0_u32..).zip(positions) {
        let cube = grid.cube(position);
        for step in half_of_neighbours() {
            let other_cube = cube + step;
            for &j in grid.members(other_cube) {
                let other = positions[j as usize];
                // Two cubes may share a table entry (a hash collision), so the cube is compared.
                let listed = grid.cube(other) == other_cube && (step != IVec3::ZERO || i < j);
                if listed && position.distance_squared(other) < reach * reach {
                    let apart = start[i as usize].distance(start[j as usize]);
                    if apart > 1.5 * thickness {
                        pairs.push([i, j]);
                    }
                }
            }
        }
    }
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::triangulate::noise;

    #[test]
    fn the_grid_finds_the_pairs_that_comparing_all_finds() {
        let place = |seed: u64, i: u64| {
            4.0 * DVec3::new(noise(seed, 3 * i), noise(seed, 3 * i + 1), noise(seed, 3 * i + 2))
        };
        let now: Vec<DVec3> = (0..300).map(|i| place(1, i)).collect();
        let start: Vec<DVec3> = (0..300).map(|i| place(2, i)).collect();
        let mut found = near_pairs(&now, &start, 0.5);
        found.iter_mut().for_each(|pair| pair.sort_unstable());
        found.sort_unstable();
        let mut expected = Vec::new();
        for i in 0..300_u32 {
            for j in i + 1..300 {
                let near = now[i as usize].distance(now[j as usize]) < 0.5 + MARGIN;
                if near && start[i as usize].distance(start[j as usize]) > 0.75 {
                    expected.push([i, j]);
                }
            }
        }
        assert_eq!(found, expected);
    }
}

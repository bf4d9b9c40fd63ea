//! The frames of a tube's rings, four rings at a time.
//!
//! In: a [`RingStation`] for each ring. Out: [`Ring`]s.
//!
//! Method: the rotation-minimising frame of [`super::frame`], in a form in which only two numbers
//! of a ring depend on the ring before. Each tangent has a pair of perpendicular vectors of its own
//! (`lanes`). The double reflection carries the first vector of a ring's pair to the next ring, where
//! it lies at some angle in that ring's pair. All this is done for four rings at once. The frame's
//! own angle is the sum of these angles, so a ring waits only for one product of complex numbers.
//!
//! A round section takes that frame. A flattened one lies in the fabric's plane; where the yarn runs
//! along the fabric's normal that plane gives no direction, and the frame is carried on.
//!
//! Cost: a tube of five edges takes 21 ns a vertex this way, and 26 with one ring after the other.
//! Not promised: the bits of [`double_reflection`]; both agree to rounding.
//!
//! [`double_reflection`]: super::frame::double_reflection

use glam::{Vec2, Vec3A, Vec4};

use super::lanes::{LANES, Vectors, inverse_or_zero};

/// Sine of the angle between yarn and fabric's normal under which a flattened section doesn't follow
/// the fabric: 0.06 degrees. A smaller limit would let rounding choose the direction, a larger one
/// would make steep underlaps turn over visibly.
const MIN_SINE: f32 = 1e-3;
/// Squared length under which a vector has no direction; what is carried has a length of about 1.
const NO_DIRECTION: f32 = 1e-12;

/// What the frame of a ring is made of.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RingStation {
    /// The ring's middle, mm.
    pub(super) center: Vec3A,
    /// Vector from the ring before, mm. It has no meaning for a strand's first ring.
    pub(super) chord: Vec3A,
    /// The curve's derivative, of any length.
    pub(super) along: Vec3A,
    /// The fabric's normal, of about unit length.
    pub(super) up: Vec3A,
    /// Ratio of the section's width to its height.
    pub(super) ratio: f32,
}

/// The position and the frame of a ring. The three directions are unit vectors.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ring {
    /// Its middle, mm.
    pub(super) center: Vec3A,
    pub(super) tangent: Vec3A,
    pub(super) normal: Vec3A,
    pub(super) binormal: Vec3A,
    /// Yarn length from the strand's start, mm.
    pub(super) length: f64,
    /// Ratio of the section's width to its height.
    pub(super) ratio: f32,
}

/// Carries a frame along a strand.
#[derive(Clone, Copy, Debug)]
pub(super) struct FrameCarrier {
    /// Whether the section lies in the fabric's plane.
    is_flattened: bool,
    last: Option<Carried>,
}

/// What the next ring needs to know of the last one.
#[derive(Clone, Copy, Debug)]
struct Carried {
    tangent: Vec3A,
    /// The first vector of the tangent's pair.
    across: Vec3A,
    /// The normal in that pair, as a complex number of unit length.
    turn: Vec2,
    /// Yarn length from the strand's start, mm.
    length: f64,
}

impl FrameCarrier {
    /// Starts a strand.
    pub(super) fn new(is_flattened: bool) -> Self {
        Self { is_flattened, last: None }
    }

    /// The frames of the next rings.
    #[inline]
    pub(super) fn next(&mut self, mut stations: [RingStation; LANES]) -> [Ring; LANES] {
        let last = *self.last.get_or_insert_with(|| {
            // The first ring is carried from itself, which turns nothing.
            stations[0].chord = Vec3A::ZERO;
            Carried::start(&stations[0])
        });
        let tangents = unit_tangents(stations.map(|station| station.along), last.tangent);
        let pair = tangents.perpendicular_pairs();
        let chords = Vectors::new(stations.map(|station| station.chord));
        let squares = chords.length_squared();
        let across = reflect(pair[0].before(last.across), chords, squares);
        let mirror = tangents - reflect(tangents.before(last.tangent), chords, squares);
        let steps = Turns::of(reflect(across, mirror, mirror.length_squared()), &pair);
        let flat = self
            .is_flattened
            .then(|| Turns::of(Vectors::new(stations.map(|station| station.up)), &pair));
        let mut turn = last.turn;
        let turns: [Vec2; LANES] = std::array::from_fn(|lane| {
            turn = match &flat {
                Some(flat) if flat.squares[lane] >= MIN_SINE * MIN_SINE => flat.at(lane),
                _ => carried_on(turn, steps.at(lane)),
            };
            turn
        });
        let rings = rings(&stations, tangents, &pair, turns, squares.sqrt(), last.length);
        let Ring { tangent, length, .. } = rings[LANES - 1];
        let across = pair[0].to_array()[LANES - 1];
        self.last = Some(Carried { tangent, across, turn, length });
        rings
    }
}

/// Rings from their frames' angles and the lengths of their chords.
#[inline]
fn rings(
    stations: &[RingStation; LANES],
    tangents: Vectors,
    pair: &[Vectors; 2],
    turns: [Vec2; LANES],
    chords: Vec4,
    mut length: f64,
) -> [Ring; LANES] {
    let (cos, sin) = (turns.map(|turn| turn.x).into(), turns.map(|turn| turn.y).into());
    let tangents = tangents.to_array();
    let normals = (pair[0] * cos + pair[1] * sin).to_array();
    let binormals = (pair[1] * cos - pair[0] * sin).to_array();
    std::array::from_fn(|lane| {
        length += f64::from(chords[lane]);
        Ring {
            center: stations[lane].center,
            tangent: tangents[lane],
            normal: normals[lane],
            binormal: binormals[lane],
            length,
            ratio: stations[lane].ratio,
        }
    })
}

impl Carried {
    /// The frame of a strand's first ring: its normal is nearest to the fabric's.
    fn start(station: &RingStation) -> Self {
        let tangent = station.along.normalize_or(Vec3A::X);
        let pair = Vectors::new([tangent; LANES]).perpendicular_pairs();
        let turn = Turns::of(Vectors::new([station.up; LANES]), &pair).at(0);
        Self { tangent, across: pair[0].to_array()[0], turn, length: 0.0 }
    }
}

/// Unit tangents. Where data points coincide the curve has none, and the last one is kept.
#[inline]
fn unit_tangents(along: [Vec3A; LANES], last: Vec3A) -> Vectors {
    let vectors = Vectors::new(along);
    let inverse = vectors.length_squared().sqrt().recip();
    if inverse.is_finite() {
        return vectors * inverse;
    }
    let mut tangent = last;
    Vectors::new(along.map(|along| {
        tangent = along.normalize_or(tangent);
        tangent
    }))
}

/// Mirrors vectors in the planes across `mirrors`, whose squared lengths are given. A mirror of no
/// length changes nothing.
#[inline]
fn reflect(vectors: Vectors, mirrors: Vectors, squares: Vec4) -> Vectors {
    vectors - mirrors * (2.0 * inverse_or_zero(squares) * mirrors.dot(vectors))
}

/// Angles of four vectors within the planes of four pairs, as complex numbers.
struct Turns {
    cos: Vec4,
    sin: Vec4,
    /// Squared length of the complex numbers, before they were given length 1.
    squares: Vec4,
}

impl Turns {
    #[inline]
    fn of(vectors: Vectors, pair: &[Vectors; 2]) -> Self {
        let [cos, sin] = [pair[0].dot(vectors), pair[1].dot(vectors)];
        let squares = cos * cos + sin * sin;
        let inverse = squares.max(Vec4::splat(NO_DIRECTION)).sqrt().recip();
        Self { cos: cos * inverse, sin: sin * inverse, squares }
    }

    /// One of them. A vector across its plane has no angle, and counts as the pair's first.
    #[inline]
    fn at(&self, lane: usize) -> Vec2 {
        if self.squares[lane] > NO_DIRECTION {
            Vec2::new(self.cos[lane], self.sin[lane])
        } else {
            Vec2::X
        }
    }
}

/// The angle after a step, both as complex numbers of unit length.
#[inline]
fn carried_on(turn: Vec2, step: Vec2) -> Vec2 {
    let next = turn.rotate(step);
    // One Newton step for the inverse square root. Without it roundings would add up over the
    // thousands of rings of a yarn.
    next * (1.5 - 0.5 * next.length_squared())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::yarn::frame::{double_reflection, perpendicular_unit};

    /// A curve that turns in all directions, stops now and then, and has chords straight across two
    /// equal tangents.
    fn stations(count: usize) -> Vec<RingStation> {
        let mut center = Vec3A::ZERO;
        let mut along = Vec3A::X;
        let mut stations = Vec::new();
        for step in 0..count {
            let angle = 0.37 * (step % 977) as f32;
            let chord = match step % 16 {
                7 => along.any_orthonormal_vector() * 0.7,
                11 => Vec3A::ZERO,
                _ => along * 0.1,
            };
            center += chord;
            stations.push(RingStation { center, chord, along, up: Vec3A::Z, ratio: 1.0 });
            if !matches!(step % 16, 6 | 10) {
                along = Vec3A::new(angle.cos(), angle.sin(), 0.8 * (0.7 * angle).sin());
            }
        }
        stations
    }

    fn frames(stations: &[RingStation], is_flattened: bool) -> Vec<Ring> {
        let mut frames = FrameCarrier::new(is_flattened);
        let groups = stations.as_chunks::<LANES>().0;
        groups.iter().flat_map(|group| frames.next(*group)).collect()
    }

    #[test]
    fn frames_are_those_of_one_ring_after_the_other() {
        let stations = stations(4000);
        let rings = frames(&stations, false);
        let mut normal = perpendicular_unit(Vec3A::Z, rings[0].tangent);
        let mut length = 0.0;
        for (at, (before, ring)) in rings.iter().zip(&rings[1..]).enumerate() {
            let station = &stations[at + 1];
            length += f64::from(station.chord.length());
            normal = double_reflection(before.normal, station.chord, before.tangent, ring.tangent);
            // Across two equal tangents the second mirror is rounding, and either way is as good.
            if (at + 1) % 16 != 7 {
                assert!(normal.distance(ring.normal) < 1e-4, "{at}: {normal}, {}", ring.normal);
            }
            assert!(ring.tangent.cross(ring.normal).distance(ring.binormal) < 1e-5);
            assert!((ring.length - length).abs() < 1e-4 * length);
        }
        assert!(normal.is_finite());
    }

    #[test]
    fn a_frame_stays_of_unit_length_however_long_the_yarn() {
        for ring in frames(&stations(100_000), false) {
            let upright = ring.normal.dot(ring.tangent).abs();
            assert!((ring.normal.length() - 1.0).abs() < 1e-5 && upright < 1e-5);
        }
    }

    #[test]
    fn a_flattened_section_lies_in_the_fabrics_plane_and_is_carried_where_there_is_none() {
        let mut stations = stations(64);
        // A yarn along the fabric's normal.
        for station in &mut stations[20..24] {
            station.along = Vec3A::Z;
        }
        for (at, ring) in frames(&stations, true).into_iter().enumerate() {
            if !(20..24).contains(&at) {
                let flat = perpendicular_unit(Vec3A::Z, ring.tangent);
                assert!(ring.normal.distance(flat) < 1e-4, "{at}");
            }
            assert!((ring.normal.length() - 1.0).abs() < 1e-5);
        }
    }

    #[test]
    fn a_strand_of_one_place_has_frames_too() {
        let station = RingStation { up: Vec3A::X, ..RingStation::default() };
        for ring in frames(&[station; 8], false) {
            assert!(ring.normal.is_normalized() && ring.tangent == Vec3A::X && ring.length == 0.0);
        }
    }
}

//! Steps 3 and 4, colours: yarns of several colours on one scale of light, and which yarns are of
//! one.
//!
//! In: the mean cell in each of red, green and blue (linear light). Out: [`levelled`], a cell whose
//! light is that of yarns of one colour: where places fall into two clusters by their chroma (of
//! CIE Lab, over the lightness, which shade changes), each is as light as the lighter one. And for
//! the segments that are seen [`Colors`]: a colour a segment, the mean of its group. Segments whose
//! colours differ by less than [`SAME`] are of one yarn (single linkage). A photo's light is taken
//! for even and white.
//!
//! Not promised: yarns that differ in lightness alone, as black and white do: in a photo a dark
//! yarn is a deep one.

use glam::{DVec2, DVec3};

use super::cell::Cell;
use super::segment::Segment;
use crate::plane::{Plane, double, percentile};

/// Chroma over lightness of two clusters differ by so much at least, and by so many of their own
/// spreads; each has this share of the cell.
const DIFFERENT: f64 = 0.25;
const SPREADS: f64 = 3.0;
const LEAST_SHARE: f64 = 0.12;
/// Darker places have no chroma to be told by.
const DARK: f64 = 18.0;
/// Rounds in which clusters find their centres.
const ROUNDS: usize = 12;
/// Darker yarns are made lighter by this factor at most.
const MOST_GAIN: f32 = 6.0;
/// Shares of the places below the ground, and below a cluster's tops.
const GROUND: f32 = 0.04;
const TOPS: f32 = 0.9;
/// Colours of yarns that differ by less, in CIE Lab, are one: shading alone makes up half of it.
const SAME: f64 = 14.0;
/// Part of a segment's width and length whose mean is its colour: edges lie in the shade.
const INNER: [f64; 2] = [0.5, 0.8];
/// Places each way at which a segment's colour is asked.
const ASKED: usize = 16;

/// A cell of light with yarns of both colours equally light, if there are two; `cells` are its
/// colours.
pub(super) fn levelled(cell: Cell, cells: &[Cell; 3]) -> Cell {
    let Some(clusters) = clusters(cells) else { return cell };
    let values = &cell.plane.values;
    let ground = percentile(&mut values.clone(), GROUND);
    let tops = [0, 1].map(|cluster| {
        let own = values
            .iter()
            .zip(&clusters)
            .filter(|(_, own)| **own == Some(cluster))
            .map(|(value, _)| *value);
        percentile(&mut own.collect::<Vec<_>>(), TOPS) - ground
    });
    let top = tops[0].max(tops[1]);
    let gains = tops.map(|own| top / own.max(top / MOST_GAIN).max(f32::MIN_POSITIVE));
    let level = |(value, cluster): (&f32, &Option<usize>)| {
        cluster.map_or(*value, |own| ground + (value - ground) * gains[own])
    };
    let values = values.iter().zip(&clusters).map(level).collect();
    Cell { plane: Plane { values, ..cell.plane }, ..cell }
}

/// The cluster of each place, none for dark ones; nothing where all are of one colour.
fn clusters(cells: &[Cell; 3]) -> Option<Vec<Option<usize>>> {
    let [red, green, blue] = cells.each_ref().map(|cell| &cell.plane.values);
    let places = red.iter().zip(green).zip(blue).map(|((red, green), blue)| {
        let lab = lab(DVec3::new((*red).into(), (*green).into(), (*blue).into()).max(DVec3::ZERO));
        (lab.x > DARK).then(|| DVec2::new(lab.y, lab.z) / lab.x)
    });
    let places: Vec<Option<DVec2>> = places.collect();
    let told = || places.iter().flatten();
    let mean = told().sum::<DVec2>() / double(told().count().max(1));
    // From the place that is farthest from the mean, and from that which is farthest from it.
    let farthest =
        |from: DVec2| told().copied().max_by(|p, q| p.distance(from).total_cmp(&q.distance(from)));
    let first = farthest(mean)?;
    let mut centres = [first, farthest(first)?];
    let nearest = |place: DVec2, [p, q]: [DVec2; 2]| {
        usize::from(place.distance_squared(q) < place.distance_squared(p))
    };
    let mut counts = [0; 2];
    for _ in 0..ROUNDS {
        let mut sums = [DVec2::ZERO; 2];
        counts = [0; 2];
        for &place in told() {
            let cluster = nearest(place, centres);
            sums[cluster] += place;
            counts[cluster] += 1;
        }
        centres = [0, 1].map(|cluster| sums[cluster] / double(counts[cluster].max(1)));
    }
    let spread =
        told().map(|place| place.distance_squared(centres[nearest(*place, centres)])).sum::<f64>()
            / double(told().count());
    let apart = centres[0].distance(centres[1]);
    let least = LEAST_SHARE * double(places.len());
    (apart > DIFFERENT
        && apart > SPREADS * spread.sqrt()
        && counts.iter().all(|&count| double(count) > least))
    .then(|| places.iter().map(|place| place.map(|place| nearest(place, centres))).collect())
}

/// What colours the segments of a cell have.
#[derive(Clone, Debug)]
pub(super) struct Colors {
    /// The group of each segment, from 0.
    pub(super) groups: Vec<usize>,
    /// The colour of each group, linear red, green and blue, 0..1.
    pub(super) linear: Vec<DVec3>,
}

impl Colors {
    /// The colours of segments, in pixels of the cells.
    pub(super) fn of(cells: &[Cell; 3], segments: &[Segment]) -> Self {
        let own: Vec<DVec3> = segments.iter().map(|segment| mean(cells, segment)).collect();
        let labs: Vec<DVec3> = own.iter().map(|linear| lab(*linear)).collect();
        let mut groups: Vec<usize> = (0..segments.len()).collect();
        for first in 0..segments.len() {
            for second in first + 1..segments.len() {
                if labs[first].distance(labs[second]) < SAME {
                    let (keep, merge) =
                        (groups[first].min(groups[second]), groups[first].max(groups[second]));
                    groups
                        .iter_mut()
                        .filter(|group| **group == merge)
                        .for_each(|group| *group = keep);
                }
            }
        }
        let mut known: Vec<usize> = groups.clone();
        known.sort_unstable();
        known.dedup();
        let number = |group: &usize| known.binary_search(group).expect("each group is known");
        let groups: Vec<usize> = groups.iter().map(number).collect();
        let linear = (0..known.len()).map(|group| {
            let members = own
                .iter()
                .zip(&groups)
                .filter(|(_, own)| **own == group)
                .map(|(linear, _)| *linear);
            members.clone().sum::<DVec3>() / double(members.count())
        });
        Self { linear: linear.collect(), groups }
    }
}

/// The mean colour of a segment's middle.
fn mean(cells: &[Cell; 3], segment: &Segment) -> DVec3 {
    let inverse = cells[0].lattice.matrix().inverse();
    let share = |step: usize| (double(step) + 0.5) / double(ASKED) - 0.5;
    let mut sum = DVec3::ZERO;
    for at in 0..ASKED * ASKED {
        let (along, across) = (
            share(at % ASKED) * INNER[1] * segment.length,
            share(at / ASKED) * INNER[0] * segment.width,
        );
        let count = inverse * segment.beside(along, across);
        sum += DVec3::from(cells.each_ref().map(|cell| f64::from(cell.at(count))));
    }
    (sum / double(ASKED * ASKED)).max(DVec3::ZERO)
}

/// CIE Lab under D65 of linear sRGB.
fn lab(linear: DVec3) -> DVec3 {
    let rows = [
        DVec3::new(0.412_456, 0.357_576, 0.180_437) / 0.950_47,
        DVec3::new(0.212_673, 0.715_152, 0.072_175),
        DVec3::new(0.019_334, 0.119_192, 0.950_304) / 1.088_83,
    ];
    let [x, y, z] = rows.map(|row| {
        let t = row.dot(linear);
        if t > 0.008_856 { t.cbrt() } else { 7.787 * t + 16.0 / 116.0 }
    });
    DVec3::new(116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z))
}

#[cfg(test)]
mod tests {
    use super::super::lattice::Lattice;
    use super::*;
    use crate::plane::narrow;

    /// Stripes of three colours, ten pixels each, darker towards their edges.
    fn striped(stripes: [DVec3; 3]) -> ([Cell; 3], Cell) {
        let lattice = Lattice { a: DVec2::new(30.0, 0.0), b: DVec2::new(0.0, 20.0) };
        let shade = |x: usize| 1.0 - 0.08 * (double(x % 20) - 9.5).abs();
        let cell = |of: &(dyn Fn(usize) -> f64 + Sync)| Cell {
            lattice,
            plane: Plane::from_fn(60, 40, |x, _| narrow(shade(x) * of(x / 20))),
        };
        (
            [0, 1, 2].map(|channel| cell(&|stripe| stripes[stripe][channel])),
            cell(&|stripe| stripes[stripe].element_sum()),
        )
    }

    #[test]
    fn two_colours_are_levelled_and_one_in_some_shade_is_left() {
        let (cells, light) = striped([
            DVec3::new(0.5, 0.1, 0.1),
            DVec3::new(0.1, 0.1, 0.2),
            DVec3::new(0.5, 0.1, 0.1),
        ]);
        let level = levelled(light.clone(), &cells);
        let top = |stripe: usize, cell: &Cell| cell.plane.at(20 * stripe + 9, 5);
        assert!(
            top(1, &light) < 0.7 * top(0, &light)
                && (top(1, &level) / top(0, &level) - 1.0).abs() < 0.05
        );
        assert!(level.plane.at(20, 5) < 0.5 * level.plane.at(29, 5), "edges stay dark");
        let (cells, light) = striped([
            DVec3::new(0.5, 0.3, 0.2),
            DVec3::new(0.3, 0.18, 0.12),
            DVec3::new(0.45, 0.27, 0.18),
        ]);
        assert_eq!(levelled(light.clone(), &cells).plane, light.plane);
    }

    #[test]
    fn white_is_light_and_grey_and_red_is_neither() {
        let white = lab(DVec3::ONE);
        assert!((white - DVec3::new(100.0, 0.0, 0.0)).length() < 0.05, "{white}");
        let red = lab(DVec3::X);
        assert!((red - DVec3::new(53.24, 80.09, 67.20)).length() < 0.1, "{red}");
    }

    #[test]
    fn a_red_stripe_and_two_blue_ones_are_two_yarns() {
        let lattice = Lattice { a: DVec2::new(30.0, 0.0), b: DVec2::new(0.0, 20.0) };
        let segment = |x: f64| {
            Segment::straight(DVec2::new(x, 10.0), std::f64::consts::FRAC_PI_2, 8.0, 18.0, 1.0)
        };
        // The third is the second in some shade.
        let stripes =
            [DVec3::new(0.5, 0.1, 0.1), DVec3::new(0.1, 0.1, 0.5), DVec3::new(0.09, 0.09, 0.45)];
        let cell = |channel: usize| Cell {
            lattice,
            plane: Plane::from_fn(60, 40, |x, _| narrow(stripes[x / 20][channel])),
        };
        let colors =
            Colors::of(&[cell(0), cell(1), cell(2)], &[segment(5.0), segment(15.0), segment(25.0)]);
        assert_eq!(colors.groups, [0, 1, 1]);
        assert!(
            colors.linear[0].distance(stripes[0]) < 0.01 && colors.linear[1].z > 0.46,
            "{colors:?}"
        );
    }
}

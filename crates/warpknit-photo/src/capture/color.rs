//! Steps 3 and 4, colours: yarns of several colours on one scale of light, and the colour of each
//! yarn.
//!
//! In: the mean cell in each of red, green and blue (linear light). Out: [`level_colors`], a cell
//! whose lightness is that of yarns of one colour, and [`SegmentColors`], a colour for each visible
//! segment.
//!
//! Method: k-means with two clusters (Lloyd's algorithm) on the chroma of CIE L*a*b*, divided by
//! L + 16, which shading changes as much. If the clusters are distinct, both are scaled to the
//! lightness of the lighter one. Segments whose colours differ by less than [`SAME_COLOR`] are of
//! one yarn (single-linkage clustering); its colour is their mean.
//!
//! Not promised: yarns that differ in lightness alone, such as black and white: in a photo a dark
//! yarn is a deep one. Nor the colour of the light: it is taken for even and white.

use glam::{DVec2, DVec3};

use super::cell::Cell;
use super::segment::Segment;
use crate::plane::{Plane, double, percentile};

/// Least distance of the two clusters, as chroma over lightness. Much smaller, noise would split a
/// single colour; much larger, pale colours would not be told apart.
const MIN_DISTANCE: f64 = 0.25;
/// The same in standard deviations of the clusters.
const MIN_DEVIATIONS: f64 = 3.0;
/// Least share of the cell of each cluster. Smaller ones are specks or single fibres.
const MIN_SHARE: f64 = 0.12;
/// Lightness L* below which the chroma is mostly noise.
const DARK: f64 = 18.0;
/// Iterations of Lloyd's algorithm: with two clusters it converges in fewer.
const ITERATIONS: usize = 12;
/// The largest gain of the darker cluster. A black yarn would otherwise become noise.
const MAX_GAIN: f32 = 6.0;
/// Quantiles of the lightness that are taken for the ground and for the top of a cluster's yarns.
const GROUND: f32 = 0.04;
const TOPS: f32 = 0.9;
/// Distance in CIE L*a*b* below which two colours are of one yarn. Shading alone makes up half of
/// it. A larger one would merge shades of one hue.
const SAME_COLOR: f64 = 14.0;
/// The inner part of a segment's width and of its length whose mean is its colour. Edges and ends
/// lie in the shade.
const INNER_WIDTH: f64 = 0.5;
const INNER_LENGTH: f64 = 0.8;
/// Samples each way of that inner part.
const SAMPLES: usize = 16;

/// A cell of light with the yarns of both colours equally light, if there are two colours. `cells`
/// are its channels.
pub(super) fn level_colors(cell: Cell, cells: &[Cell; 3]) -> Cell {
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
    let gains = tops.map(|own| top / own.max(top / MAX_GAIN).max(f32::MIN_POSITIVE));
    // Dark points without a cluster are ground, which both colours share.
    let values = values
        .iter()
        .zip(&clusters)
        .map(|(value, cluster)| {
            cluster.map_or(*value, |own| ground + (value - ground) * gains[own])
        })
        .collect();
    Cell { plane: Plane { values, ..cell.plane }, ..cell }
}

/// The cluster of each point, `None` for dark ones; nothing where all are of one colour.
fn clusters(cells: &[Cell; 3]) -> Option<Vec<Option<usize>>> {
    let chromas = relative_chromas(cells);
    let known = || chromas.iter().flatten().copied();
    let count = known().count();
    let mean = known().sum::<DVec2>() / double(count.max(1));
    // Farthest-point start: the point that is farthest from the mean, and the point that is
    // farthest from that one. Unlike random starts it gives the same result each time.
    let first = farthest(known(), mean)?;
    let mut centres = [first, farthest(known(), first)?];
    let mut counts = [0; 2];
    for _ in 0..ITERATIONS {
        let mut sums = [DVec2::ZERO; 2];
        counts = [0; 2];
        for chroma in known() {
            let cluster = nearest(chroma, centres);
            sums[cluster] += chroma;
            counts[cluster] += 1;
        }
        centres = [0, 1].map(|cluster| sums[cluster] / double(counts[cluster].max(1)));
    }
    let variance = known()
        .map(|chroma| chroma.distance_squared(centres[nearest(chroma, centres)]))
        .sum::<f64>()
        / double(count);
    // k-means always gives two clusters. These tests tell two colours from one.
    let distance = centres[0].distance(centres[1]);
    let least = MIN_SHARE * double(chromas.len());
    (distance > MIN_DISTANCE
        && distance > MIN_DEVIATIONS * variance.sqrt()
        && counts.iter().all(|&count| double(count) > least))
    .then(|| chromas.iter().map(|chroma| chroma.map(|chroma| nearest(chroma, centres))).collect())
}

/// Chroma over lightness of each point of the cells; `None` where it is dark. The lightness counts
/// from -16, where its cube root begins: a and b over L + 16 are ratios of cube roots, which no
/// shade changes. Over L alone a saturated cloth in shade would be of two colours.
fn relative_chromas(cells: &[Cell; 3]) -> Vec<Option<DVec2>> {
    let [red, green, blue] = cells.each_ref().map(|cell| &cell.plane.values);
    red.iter()
        .zip(green)
        .zip(blue)
        .map(|((red, green), blue)| {
            let linear = DVec3::new((*red).into(), (*green).into(), (*blue).into());
            let lab = lab(linear.max(DVec3::ZERO));
            (lab.x > DARK).then(|| DVec2::new(lab.y, lab.z) / (lab.x + 16.0))
        })
        .collect()
}

/// The point that is farthest from another one.
fn farthest(points: impl Iterator<Item = DVec2>, from: DVec2) -> Option<DVec2> {
    points.max_by(|p, q| p.distance(from).total_cmp(&q.distance(from)))
}

/// The index of the nearer one of two centres.
fn nearest(point: DVec2, [p, q]: [DVec2; 2]) -> usize {
    usize::from(point.distance_squared(q) < point.distance_squared(p))
}

/// The colours of a cell's segments.
#[derive(Clone, Debug)]
pub(super) struct SegmentColors {
    /// The group of each segment, from 0.
    pub(super) groups: Vec<usize>,
    /// The colour of each group, linear red, green and blue, 0..1.
    pub(super) linear: Vec<DVec3>,
}

impl SegmentColors {
    /// The colours of segments, which are in pixels of the cells.
    pub(super) fn new(cells: &[Cell; 3], segments: &[Segment]) -> Self {
        let own: Vec<DVec3> = segments.iter().map(|segment| mean_color(cells, segment)).collect();
        let groups = linked_groups(&own);
        let count = groups.iter().max().map_or(0, |last| last + 1);
        let linear = (0..count).map(|group| {
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

/// Single-linkage clustering of colours: the group of each, numbered from 0 in order of appearance.
fn linked_groups(colors: &[DVec3]) -> Vec<usize> {
    let labs: Vec<DVec3> = colors.iter().map(|linear| lab(*linear)).collect();
    let mut groups: Vec<usize> = (0..colors.len()).collect();
    for first in 0..colors.len() {
        for second in first + 1..colors.len() {
            if labs[first].distance(labs[second]) < SAME_COLOR {
                let (keep, merge) =
                    (groups[first].min(groups[second]), groups[first].max(groups[second]));
                groups.iter_mut().filter(|group| **group == merge).for_each(|group| *group = keep);
            }
        }
    }
    // Merged groups leave gaps in the numbers.
    let mut known: Vec<usize> = groups.clone();
    known.sort_unstable();
    known.dedup();
    groups.iter().map(|group| known.binary_search(group).expect("each group is known")).collect()
}

/// The mean colour of a segment's inner part.
fn mean_color(cells: &[Cell; 3], segment: &Segment) -> DVec3 {
    let inverse = cells[0].lattice.matrix().inverse();
    let share = |step: usize| (double(step) + 0.5) / double(SAMPLES) - 0.5;
    let mut sum = DVec3::ZERO;
    for at in 0..SAMPLES * SAMPLES {
        let along = share(at % SAMPLES) * INNER_LENGTH * segment.length;
        let across = share(at / SAMPLES) * INNER_WIDTH * segment.width;
        let coordinates = inverse * segment.offset_point(along, across);
        sum += DVec3::from(cells.each_ref().map(|cell| f64::from(cell.at(coordinates))));
    }
    (sum / double(SAMPLES * SAMPLES)).max(DVec3::ZERO)
}

/// CIE L*a*b* under D65 of linear sRGB.
fn lab(linear: DVec3) -> DVec3 {
    // The rows of the sRGB to XYZ matrix (IEC 61966-2-1) over the white point.
    let rows = [
        DVec3::new(0.412_456, 0.357_576, 0.180_437) / 0.950_47,
        DVec3::new(0.212_673, 0.715_152, 0.072_175),
        DVec3::new(0.019_334, 0.119_192, 0.950_304) / 1.088_83,
    ];
    let [x, y, z] = rows.map(|row| {
        let t = row.dot(linear);
        // Linear near black, where the cube root is infinitely steep.
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
        let level = level_colors(light.clone(), &cells);
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
        assert_eq!(level_colors(light.clone(), &cells).plane, light.plane);
    }

    #[test]
    fn a_saturated_cloth_in_shade_is_of_one_colour() {
        for hue in [DVec3::new(0.6, 0.02, 0.03), DVec3::new(0.02, 0.05, 0.7)] {
            let (cells, light) = striped([hue, 0.35 * hue, 0.15 * hue]);
            assert_eq!(level_colors(light.clone(), &cells).plane, light.plane, "{hue}");
        }
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
        let colors = SegmentColors::new(
            &[cell(0), cell(1), cell(2)],
            &[segment(5.0), segment(15.0), segment(25.0)],
        );
        assert_eq!(colors.groups, [0, 1, 1]);
        assert!(
            colors.linear[0].distance(stripes[0]) < 0.01 && colors.linear[1].z > 0.46,
            "{colors:?}"
        );
    }
}

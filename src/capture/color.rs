//! Steps 3 and 4, colours: which yarns of a cell are of one colour.
//!
//! In: the mean cell in each of red, green and blue (linear light), and the segments that are seen. Out: [`Colors`]: a colour a segment, the mean of its group. Segments whose colours in CIE Lab
//! differ by less than [`SAME`] are of one yarn (single linkage). A photo's light is taken for even and white.

use glam::{DVec2, DVec3};

use super::cell::Cell;
use super::segment::Segment;
use crate::plane::double;

/// Colours of yarns that differ by less, in CIE Lab, are one: shading alone makes up half of it.
const SAME: f64 = 14.0;
/// Part of a segment's width and length whose mean is its colour: edges lie in the shade.
const INNER: [f64; 2] = [0.5, 0.8];
/// Places each way at which a segment's colour is asked.
const ASKED: usize = 16;

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
                    let (keep, merge) = (groups[first].min(groups[second]), groups[first].max(groups[second]));
                    groups.iter_mut().filter(|group| **group == merge).for_each(|group| *group = keep);
                }
            }
        }
        let mut known: Vec<usize> = groups.clone();
        known.sort_unstable();
        known.dedup();
        let number = |group: &usize| known.binary_search(group).expect("each group is known");
        let groups: Vec<usize> = groups.iter().map(number).collect();
        let linear = (0..known.len()).map(|group| {
            let members = own.iter().zip(&groups).filter(|(_, own)| **own == group).map(|(linear, _)| *linear);
            members.clone().sum::<DVec3>() / double(members.count())
        });
        Self { linear: linear.collect(), groups }
    }
}

/// The mean colour of a segment's middle.
fn mean(cells: &[Cell; 3], segment: &Segment) -> DVec3 {
    let way = DVec2::from_angle(segment.angle);
    let inverse = cells[0].lattice.matrix().inverse();
    let share = |step: usize| (double(step) + 0.5) / double(ASKED) - 0.5;
    let mut sum = DVec3::ZERO;
    for at in 0..ASKED * ASKED {
        let (along, across) = (share(at % ASKED) * INNER[1] * segment.length, share(at / ASKED) * INNER[0] * segment.width);
        let count = inverse * (segment.centre + way * along + way.perp() * across);
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
    use crate::plane::{Plane, narrow};

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
        let segment = |x: f64| Segment {
            centre: DVec2::new(x, 10.0),
            angle: std::f64::consts::FRAC_PI_2,
            width: 8.0,
            length: 18.0,
            top: 1.0,
            round: 0.5,
            sag: 0.2,
            tilt: 0.0,
        };
        // The third is the second in some shade.
        let stripes = [DVec3::new(0.5, 0.1, 0.1), DVec3::new(0.1, 0.1, 0.5), DVec3::new(0.09, 0.09, 0.45)];
        let cell = |channel: usize| Cell { lattice, plane: Plane::from_fn(60, 40, |x, _| narrow(stripes[x / 20][channel])) };
        let colors = Colors::of(&[cell(0), cell(1), cell(2)], &[segment(5.0), segment(15.0), segment(25.0)]);
        assert_eq!(colors.groups, [0, 1, 1]);
        assert!(colors.linear[0].distance(stripes[0]) < 0.01 && colors.linear[1].z > 0.46, "{colors:?}");
    }
}

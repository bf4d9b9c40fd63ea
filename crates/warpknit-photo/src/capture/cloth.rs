//! From a captured layout to a fabric that can be draped.
//!
//! In: a layout with its shapes, twists and colours. Out: a laid [`Fabric`]: the strands of a
//! rectangular cell, in mm. Yarns are round and as wide as in the photo. Their count follows from
//! the width and from the density and the packing of spun cotton.
//!
//! Not promised: the weight. A photo doesn't show what a yarn is made of.

use std::f64::consts::PI;

use glam::DVec3;

use super::color::SegmentColors;
use super::fibres::Twist;
use super::lattice::Lattice;
use super::layout::Layout;
use super::relief::Relief;
use super::shape::CylinderShape;
use super::strands::{JoinedStrand, PlacedSegment, strands};
use super::upright::Upright;
use crate::plane::double;
use warpknit_core::fabric::yarn::{Color, Count, MOST_TWIST, Yarn};
use warpknit_core::fabric::{Fabric, Finish, LaidCloth, LaidStrand, StrandDirection, Structure};

/// Name of the fabric until a person gives it one.
const NAME: &str = "captured";
/// Density of cotton fibre, g/cm³.
const COTTON_DENSITY: f64 = 1.5;
/// Share of a yarn's section that fibres fill, as in Wu et al..
const PACKING: f64 = 0.6;
/// Share of the light that the yarns' fibres mirror: that of dull cotton. A person who knows better
/// changes it.
const SHEEN: f64 = 0.2;

/// What is known about the visible segments, in the layout's order.
pub(super) struct SegmentYarns<'a> {
    pub(super) shapes: &'a [CylinderShape],
    pub(super) twists: &'a [Twist],
    pub(super) colors: &'a SegmentColors,
}

/// The fabric of a layout; `pixel` is the size of its pixels in mm.
pub(super) fn fabric(
    lattice: &Lattice,
    layout: &Layout,
    yarns: &SegmentYarns,
    pixel: f64,
) -> Fabric {
    let upright = Upright::new(lattice, &layout.visible);
    let cell = upright.size() * pixel;
    let placed: Vec<PlacedSegment> = upright
        .copies
        .iter()
        .flat_map(|&corner| (0..layout.visible.len()).map(move |segment| (corner, segment)))
        .map(|(corner, segment)| {
            let own = &layout.visible[segment];
            let along = [-0.5, -0.25, 0.0, 0.25, 0.5].map(|share| share * own.length);
            let relief = Relief::new(own);
            PlacedSegment {
                segment,
                source: layout.sources[segment],
                axis: along.map(|along| upright.count(own.axis(along).0 + corner) * cell),
                descent: along.map(|along| relief.descent(along)),
                shape: yarns.shapes[segment],
            }
        })
        .collect();
    let strands = strands(&placed, cell);
    Fabric {
        wales_per_cm: rounded(10.0 / cell.x),
        courses_per_cm: rounded(10.0 / cell.y),
        structure: Structure::Laid(LaidCloth {
            strands: strands
                .iter()
                .map(|strand| laid(strand, &strands, yarns, cell.extend(1.0)))
                .collect(),
        }),
        name: NAME.to_owned(),
        about: String::new(),
        gauge: None,
        finish: Finish::default(),
        panels: Vec::new(),
        enlargement: 1.0,
    }
}

/// A number that a person can read: a hundred-thousandth of a cell or a mm is far below what a
/// photo shows.
fn rounded(number: f64) -> f64 {
    (1e5 * number).round() / 1e5
}

/// A strand as the fabric holds it, its path in cells. Strands of one colour that run the same way
/// are of one yarn, and get its mean width and twist.
fn laid(
    strand: &JoinedStrand,
    strands: &[JoinedStrand],
    yarns: &SegmentYarns,
    cell: DVec3,
) -> LaidStrand {
    let colors = yarns.colors;
    let own_color = majority_color(strand, colors);
    let alike = strands.iter().filter(|other| {
        other.across == strand.across && majority_color(other, colors) == own_color
    });
    let width = alike.clone().map(|other| other.width).sum::<f64>() / double(alike.clone().count());
    let twist = mean_twist(
        alike.flat_map(|strand| &strand.segments).map(|&segment| &yarns.twists[segment]),
    );
    let color = Color::from_linear(colors.linear[own_color].as_vec3().into());
    LaidStrand {
        path: strand
            .path
            .iter()
            .map(|&point| DVec3::from((point / cell).to_array().map(rounded)))
            .collect(),
        direction: if strand.across { StrandDirection::Across } else { StrandDirection::Along },
        yarn: yarn(width, twist, color),
    }
}

/// The colour group of most of a strand's segments; of equally frequent ones the first.
fn majority_color(strand: &JoinedStrand, colors: &SegmentColors) -> usize {
    (0..colors.linear.len())
        .max_by_key(|&group| {
            let members =
                strand.segments.iter().filter(|&&segment| colors.groups[segment] == group);
            (members.count(), colors.linear.len() - group)
        })
        .unwrap_or(0)
}

/// The mean of the measured twists, or of the guesses where none was measured, radians.
fn mean_twist<'a>(twists: impl Iterator<Item = &'a Twist> + Clone) -> f64 {
    let any_measured = twists.clone().any(|twist| !twist.is_guess);
    let counted = twists.filter(|twist| twist.is_guess != any_measured);
    counted.clone().map(|twist| twist.degrees.to_radians()).sum::<f64>()
        / double(counted.count()).max(1.0)
}

/// A yarn of a width in mm whose outermost fibres run at an angle to it: the inverse of
/// [`Yarn::diameter`] and of [`Yarn::twist_slope`].
fn yarn(width: f64, twist: f64, color: Color) -> Yarn {
    let turns_per_m = 1000.0 * twist.tan() / (PI * width);
    let with_tex = |tex: f64| Yarn {
        plies: Some(1),
        twist: Some(turns_per_m.clamp(-MOST_TWIST, MOST_TWIST).round()),
        sheen: Some(SHEEN),
        ..Yarn::plain(Count::from_tex(tex), COTTON_DENSITY, PACKING, color)
    };
    // The diameter grows with the square root of the count.
    with_tex((width / with_tex(1.0).diameter()).powi(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_yarn_is_as_wide_and_as_twisted_as_in_the_photo() {
        let yarn = yarn(0.25, -0.3, Color([200, 100, 50]));
        assert!(
            (yarn.diameter() - 0.25).abs() < 1e-4
                && (yarn.twist_slope().unwrap() + 0.3_f64.tan()).abs() < 1e-3,
            "{yarn:?}"
        );
    }

    #[test]
    fn measured_twists_go_before_guesses() {
        let twist = |degrees: f64, is_guess: bool| Twist { degrees, is_guess, ..Twist::guess(1.0) };
        let all = [twist(10.0, false), twist(90.0, true), twist(20.0, false)];
        assert!((mean_twist(all.iter()) - 15_f64.to_radians()).abs() < 1e-12);
        assert!((mean_twist(all[1..2].iter()) - 90_f64.to_radians()).abs() < 1e-12);
    }
}

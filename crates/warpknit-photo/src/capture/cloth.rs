//! From what a photo says to a fabric that can be draped.
//!
//! In: a layout with its shapes and colours. Out: a laid [`Fabric`]: the strands of a rectangular
//! cell, in mm. Its yarns are as thick as they are wide in the photo; their count follows from
//! that, and from the density and the packing of spun cotton.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::color::Colors;
use super::fibres::Twist;
use super::lattice::Lattice;
use super::layout::Layout;
use super::shape::Shape;
use super::strands::{Piece, Strand, strands};
use super::upright::Upright;
use crate::plane::double;
use warpknit_core::fabric::yarn::{Color, Count, MOST_TWIST, Yarn};
use warpknit_core::fabric::{Fabric, LaidCloth, LaidStrand, StrandDirection, Structure};

/// What the fabric is called until a person gives it a name.
const NAME: &str = "captured";
/// Density of the fibre, g/cm³, and the share of a yarn's section that it fills (the paper's .6).
const COTTON: (f64, f64) = (1.5, 0.6);
/// How much of the light its yarns' fibres mirror: what dull cotton does; a person who knows better
/// changes it.
const SHEEN: f64 = 0.2;

/// What is known of the segments that are seen, one after another.
pub(super) struct Yarns<'a> {
    pub(super) shapes: &'a [Shape],
    pub(super) twists: &'a [Twist],
    pub(super) colors: &'a Colors,
}

/// The fabric of a layout in pixels, so many mm each.
pub(super) fn fabric(lattice: &Lattice, layout: &Layout, yarns: &Yarns, pixel: f64) -> Fabric {
    let Yarns { shapes, twists, colors } = *yarns;
    let upright = Upright::of(lattice, &layout.seen);
    let cell = upright.size() * pixel;
    let piece = &|corner: DVec2, segment: usize| {
        let own = &layout.seen[segment];
        let along = [-0.5, -0.25, 0.0, 0.25, 0.5].map(|share| share * own.length);
        let axis = along.map(|along| upright.count(own.axis(along).0 + corner) * cell);
        let fallen = along.map(|along| own.fallen(along));
        Piece { segment, number: layout.numbers[segment], axis, fallen, shape: shapes[segment] }
    };
    let corners = upright.copies.iter();
    let pieces: Vec<Piece> = corners
        .flat_map(|&corner| (0..layout.seen.len()).map(move |segment| piece(corner, segment)))
        .collect();
    let strands = strands(&pieces, cell);
    // Numbers that a person can read: a hundred-thousandth of a cell or a mm is far under what a
    // photo tells.
    let round = |number: f64| (1e5 * number).round() / 1e5;
    let rounded = |point: DVec3| DVec3::from(point.to_array().map(round));
    let laid = |strand: &Strand| {
        // All strands of a colour that run one way are of one yarn.
        let alike = strands.iter().filter(|other| {
            other.across == strand.across && group(other, colors) == group(strand, colors)
        });
        let width =
            alike.clone().map(|other| other.width).sum::<f64>() / double(alike.clone().count());
        let twist =
            mean_twist(alike.flat_map(|strand| &strand.segments).map(|&segment| &twists[segment]));
        let direction =
            if strand.across { StrandDirection::Across } else { StrandDirection::Along };
        let path = strand.path.iter().map(|&point| rounded(point / cell.extend(1.0))).collect();
        let yarn = yarn(
            width,
            twist,
            Color::from_linear(colors.linear[group(strand, colors)].as_vec3().into()),
        );
        LaidStrand { path, direction, yarn }
    };
    Fabric {
        wales_per_cm: round(10.0 / cell.x),
        courses_per_cm: round(10.0 / cell.y),
        structure: Structure::Laid(LaidCloth { strands: strands.iter().map(laid).collect() }),
        name: NAME.to_owned(),
        about: String::new(),
        gauge: None,
        panels: Vec::new(),
        enlargement: 1.0,
    }
}

/// The colour of most of a strand's segments.
fn group(strand: &Strand, colors: &Colors) -> usize {
    let count = |group: usize| {
        strand.segments.iter().filter(|&&segment| colors.groups[segment] == group).count()
    };
    (0..colors.linear.len())
        .max_by_key(|&group| (count(group), colors.linear.len() - group))
        .unwrap_or(0)
}

/// The mean of what was measured, or of the guesses where nothing was, radians.
fn mean_twist<'a>(twists: impl Iterator<Item = &'a Twist> + Clone) -> f64 {
    let any_told = twists.clone().any(|twist| !twist.is_guess);
    let counted = twists.filter(|twist| twist.is_guess != any_told);
    counted.clone().map(|twist| twist.degrees.to_radians()).sum::<f64>()
        / double(counted.count()).max(1.0)
}

/// A yarn so many mm wide whose fibres run at an angle to it: the inverse of [`Yarn::diameter`] and
/// of [`Yarn::twist_slope`].
fn yarn(width: f64, twist: f64, color: Color) -> Yarn {
    let (density, packing) = COTTON;
    let turns_per_m = 1000.0 * twist.tan() / (PI * width);
    let of = |tex: f64| Yarn {
        plies: Some(1),
        twist: Some(turns_per_m.clamp(-MOST_TWIST, MOST_TWIST).round()),
        sheen: Some(SHEEN),
        ..Yarn::plain(Count::from_tex(tex), density, packing, color)
    };
    of((width / of(1.0).diameter()).powi(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_yarn_is_as_wide_and_as_twisted_as_was_seen() {
        let yarn = yarn(0.25, -0.3, Color([200, 100, 50]));
        assert!(
            (yarn.diameter() - 0.25).abs() < 1e-4
                && (yarn.twist_slope().unwrap() + 0.3_f64.tan()).abs() < 1e-3,
            "{yarn:?}"
        );
    }

    #[test]
    fn what_is_told_goes_before_what_is_guessed() {
        let told = |degrees: f64, is_guess: bool| Twist { degrees, is_guess, ..Twist::guess(1.0) };
        let all = [told(10.0, false), told(90.0, true), told(20.0, false)];
        assert!((mean_twist(all.iter()) - 15_f64.to_radians()).abs() < 1e-12);
        assert!((mean_twist(all[1..2].iter()) - 90_f64.to_radians()).abs() < 1e-12);
    }
}

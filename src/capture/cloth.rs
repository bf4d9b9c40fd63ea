//! From what a photo says to a fabric that can be draped.
//!
//! In: a layout with its shapes and colours. Out: a laid [`Fabric`]: the strands of a rectangular cell, in mm. Its yarns are as thick as they are wide in the photo; their count follows from that, and
//! from the density and the packing of spun cotton.

use glam::DVec2;

use super::color::Colors;
use super::lattice::Lattice;
use super::layout::Layout;
use super::shape::Shape;
use super::strands::{Piece, Strand, strands};
use super::upright::Upright;
use crate::fabric::yarn::{Color, Count, Yarn};
use crate::fabric::{Bar, BarKind, Dimensions, Fabric};
use crate::plane::double;

/// What the fabric is called until a person gives it a name.
const NAME: &str = "captured";
/// Density of the fibre, g/cm³, and the share of a yarn's section that it fills (the paper's .6).
const COTTON: (f64, f64) = (1.5, 0.6);
/// How much of the light its yarns' fibres mirror: what dull cotton does; a person who knows better changes it.
const SHEEN: f64 = 0.2;

/// The fabric of a layout in pixels, so many mm each; `shapes` are those of the segments that are seen.
pub(super) fn fabric(lattice: &Lattice, layout: &Layout, shapes: &[Shape], colors: &Colors, pixel: f64) -> Fabric {
    let upright = Upright::of(lattice, &layout.seen);
    let cell = upright.size() * pixel;
    let piece = &|corner: DVec2, segment: usize| {
        let own = &layout.seen[segment];
        let half = DVec2::from_angle(own.angle) * (0.5 * own.length);
        let ends = [-half, half].map(|end| upright.count(own.centre + corner + end) * cell);
        Piece { segment, ends, shape: shapes[segment] }
    };
    let corners = upright.copies.iter();
    let pieces: Vec<Piece> =
        corners.flat_map(|&corner| (0..layout.seen.len()).map(move |segment| piece(corner, segment))).collect();
    let strands = strands(&pieces, cell);
    // All yarns of a colour that run one way are one yarn.
    let width = |strand: &Strand| {
        let alike = |other: &&Strand| other.across == strand.across && group(other, colors) == group(strand, colors);
        let alike = strands.iter().filter(alike).map(|other| other.width);
        alike.clone().sum::<f64>() / double(alike.count())
    };
    let bar = |strand: &Strand| {
        let kind = if strand.across { BarKind::LaidAcross } else { BarKind::LaidAlong };
        Bar::laid(kind, yarn(width(strand), Color::of_linear(colors.linear[group(strand, colors)].as_vec3().into())))
    };
    Fabric {
        wales_per_cm: 10.0 / cell.x,
        courses_per_cm: 10.0 / cell.y,
        bars: strands.iter().map(bar).collect(),
        paths: strands.iter().map(|strand| strand.path.iter().map(|&point| point / cell.extend(1.0)).collect()).collect(),
        name: NAME.to_owned(),
        about: String::new(),
        gauge: None,
        stitch: Dimensions::default(),
        motif: None,
        panels: Vec::new(),
        enlargement: 1.0,
    }
}

/// The colour of most of a strand's segments.
fn group(strand: &Strand, colors: &Colors) -> usize {
    let count = |group: usize| strand.segments.iter().filter(|&&segment| colors.groups[segment] == group).count();
    (0..colors.linear.len()).max_by_key(|&group| (count(group), colors.linear.len() - group)).unwrap_or(0)
}

/// A yarn so many mm wide: the inverse of [`Yarn::diameter`].
fn yarn(width: f64, color: Color) -> Yarn {
    let (density, packing) = COTTON;
    let of = |tex: f64| Yarn { plies: Some(1), sheen: Some(SHEEN), ..Yarn::plain(Count::of_tex(tex), density, packing, color) };
    of((width / of(1.0).diameter()).powi(2))
}

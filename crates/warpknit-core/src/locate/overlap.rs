//! Where the flat pattern lies over itself: panels over each other, and panels that cover a point
//! of their plane twice.
//!
//! In: a [`Garment`]. Out: [`Overlaps`], in mm² of the flat layout. Panels are laid out as the file
//! has them, at the garment's scale, and compared where they lie in one plane. Triangles that may
//! meet are found by a BVH; each pair's common part is a convex polygon, whose area is exact to
//! rounding.
//!
//! Panels over each other are nothing wrong, since points belong to a panel first. A panel over
//! itself is: a point there lies in two triangles, of which stitches take the one that comes first
//! in the file.
//!
//! Not promised: that a point which three triangles cover is counted once (it is counted for each
//! pair), and more than four million pairs of triangles: a texture that is repeated over a whole
//! mesh has the square of its triangles, and then the areas are least ones.

use std::collections::BTreeMap;

use glam::DVec2;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use rayon::prelude::*;

use super::bvh::{outer_box, tree, visit_boxes};
use super::orient2d::cross;
use super::topology::Topology;
use crate::garment::{Garment, Panel};
use crate::ids::index32;

/// Pairs of triangles after which the search ends: a few seconds, and 200 MB if each is of two
/// panels of its own. A pattern that lies five deep has some 40 pairs a triangle.
const MOST_PAIRS: usize = 4_000_000;
/// Triangles looked at between two looks at that limit: few, since each of them may meet all
/// others, as those of a tiled `vt` do.
const BATCH: usize = 32;
/// Less than this part of the smaller panel is rounding in the file: panels laid edge to edge.
const ROUNDING: f64 = 1e-6;
/// Planes whose normals' cosine is over this, and that are less apart than this part of the larger
/// panel, are one: as flat as a panel must be.
const PARALLEL: f64 = 0.999;
const APART: f64 = 0.02;

/// What lies over what in the flat layout.
#[derive(Clone, Debug, PartialEq)]
pub struct Overlaps {
    /// Panels that lie over themselves, with the area covered twice, mm².
    pub within: Vec<(usize, f64)>,
    /// Pairs of panels, the lower number first, with the area that both cover, mm².
    pub between: Vec<([usize; 2], f64)>,
    /// Whether all of it is counted; if not, there may be more pairs, and areas may be larger.
    pub complete: bool,
}

/// A triangle where the file has it, counter-clockwise in its layout's axes.
struct Laid {
    panel: u32,
    corners: [DVec2; 3],
}

/// What one triangle has to do with those after it.
struct Met {
    /// How many may meet it.
    looked_at: usize,
    /// Panels of those that do, with the area that both triangles cover.
    shared: Vec<([usize; 2], f64)>,
}

/// Panels that lie in one plane.
struct Layout {
    triangles: Vec<Laid>,
    /// Whether more than one panel is in it.
    shared: bool,
}

/// Finds all overlaps. The same for any number of threads.
///
/// ```
/// use warpknit_core::{garment::Garment, locate::overlap::overlaps};
/// let mut garment = Garment::rectangle(10.0, 10.0);
/// garment.panels.push(Garment::rectangle(4.0, 20.0).panels.remove(0));
/// assert_eq!(overlaps(&garment).between, [([0, 1], 40.0)]);
/// ```
#[must_use]
pub fn overlaps(garment: &Garment) -> Overlaps {
    among(garment, MOST_PAIRS)
}

/// All overlaps, or those among the first `most` pairs of triangles.
fn among(garment: &Garment, most: usize) -> Overlaps {
    let Garment { panels, .. } = garment;
    let simple: Vec<bool> = panels
        .par_iter()
        .map(|panel| Topology::new(&panel.uv, &panel.triangles).embedded)
        .collect();
    let mut areas = BTreeMap::new();
    let mut left = Some(most);
    for layout in layouts(garment) {
        if layout.shared
            || layout.triangles.first().is_some_and(|laid| !simple[laid.panel as usize])
        {
            left = left.and_then(|left| layout.measure(&simple, left, &mut areas));
        }
    }
    let size: Vec<f64> = (0..panels.len())
        .map(|panel| panels[panel].area() * relative_scale(garment, panel).powi(2))
        .collect();
    areas.retain(|&[a, b], area| *area > ROUNDING * size[a].min(size[b]));
    let mut found = Overlaps { within: Vec::new(), between: Vec::new(), complete: left.is_some() };
    for ([a, b], area) in areas {
        if a == b {
            found.within.push((a, area));
        } else {
            found.between.push(([a, b], area));
        }
    }
    found
}

/// What a panel's own millimetres are multiplied by to lie beside the others as in the file.
fn relative_scale(garment: &Garment, panel: usize) -> f64 {
    let own = garment
        .summary
        .panels
        .get(panel)
        .map_or(garment.summary.uv_scale_mm, |facts| facts.scale_mm);
    garment.summary.uv_scale_mm / own
}

/// The planes of the pattern, each with its triangles in the axes of its first panel.
fn layouts(garment: &Garment) -> Vec<Layout> {
    let mut layouts: Vec<(usize, Layout)> = Vec::new();
    for (number, panel) in garment.panels.iter().enumerate() {
        let found = layouts.iter().position(|&(first, _)| coplanar(garment, first, number));
        let at = found.unwrap_or_else(|| {
            layouts.push((number, Layout { triangles: Vec::new(), shared: false }));
            layouts.len() - 1
        });
        let (first, layout) = &mut layouts[at];
        layout.shared |= *first != number;
        let axes = garment.panels[*first].flat_from_panel.matrix3;
        let scale = relative_scale(garment, number);
        let place = |&uv: &DVec2| {
            let flat = panel.flat_from_panel.transform_point3(uv.extend(0.0)) * scale;
            DVec2::new(axes.x_axis.dot(flat), axes.y_axis.dot(flat))
        };
        let points: Vec<DVec2> = panel.uv.iter().map(place).collect();
        layout.triangles.extend(panel.triangles.iter().filter_map(|corners| {
            let [a, b, c] = corners.map(|vertex| points[vertex as usize]);
            let area = cross(a, b, c);
            let corners = if area > 0.0 { [a, b, c] } else { [a, c, b] };
            (area != 0.0).then_some(Laid { panel: index32(number), corners })
        }));
    }
    layouts.into_iter().map(|(_, layout)| layout).collect()
}

fn coplanar(garment: &Garment, one: usize, other: usize) -> bool {
    let plane = |number: usize| {
        let Panel { flat_from_panel, .. } = &garment.panels[number];
        let size = garment.panels[number].size().max_element() * relative_scale(garment, number);
        (
            flat_from_panel.matrix3.z_axis,
            flat_from_panel.translation * relative_scale(garment, number),
            size,
        )
    };
    let ((normal, origin, size), (other_normal, other_origin, other_size)) =
        (plane(one), plane(other));
    normal.dot(other_normal).abs() > PARALLEL
        && normal.dot(other_origin - origin).abs() < APART * size.max(other_size)
}

impl Layout {
    /// Adds the common area of every two of its triangles to that of their panels, those in one
    /// `simple` panel excepted. Gives how many more pairs may be looked at, or none where there
    /// were too many.
    fn measure(
        &self,
        simple: &[bool],
        most: usize,
        areas: &mut BTreeMap<[usize; 2], f64>,
    ) -> Option<usize> {
        let boxes: Vec<_> =
            self.triangles.iter().map(|laid| outer_box(laid.corners.iter().copied())).collect();
        let bvh = tree(&boxes);
        let mut left = most;
        let numbers: Vec<u32> = (0..index32(self.triangles.len())).collect();
        for batch in numbers.chunks(BATCH) {
            let found: Vec<Met> = batch
                .par_iter()
                .map(|&triangle| self.meets(triangle, &boxes, &bvh, simple))
                .collect();
            for Met { looked_at, shared } in found {
                left = left.checked_sub(looked_at)?;
                shared
                    .into_iter()
                    .for_each(|(panels, area)| *areas.entry(panels).or_default() += area);
            }
        }
        Some(left)
    }

    /// What a triangle has to do with those after it.
    fn meets(&self, triangle: u32, boxes: &[Aabb], bvh: &Bvh2, simple: &[bool]) -> Met {
        let one = &self.triangles[triangle as usize];
        let mut others = Vec::new();
        let own_box = boxes[triangle as usize];
        visit_boxes(bvh, own_box, |other| {
            let same_panel = self.triangles[other as usize].panel == one.panel;
            let apart = same_panel && simple[one.panel as usize]
                || !boxes[other as usize].intersect_aabb(&own_box);
            if other > triangle && !apart {
                others.push(other);
            }
        });
        // The tree's shape must have no say in how a sum is rounded, nor in how many pairs there
        // are.
        others.sort_unstable();
        let area = |&other: &u32| {
            let other = &self.triangles[other as usize];
            let area = common_area(one.corners, other.corners);
            (area > 0.0).then(|| {
                ([one.panel.min(other.panel) as usize, one.panel.max(other.panel) as usize], area)
            })
        };
        Met { looked_at: others.len(), shared: others.iter().filter_map(area).collect() }
    }
}

/// Area of what two counter-clockwise triangles both cover: the first one, cut along each side of
/// the other.
fn common_area(triangle: [DVec2; 3], other: [DVec2; 3]) -> f64 {
    let mut polygon = triangle.to_vec();
    for side in 0..3 {
        let (a, b) = (other[side], other[(side + 1) % 3]);
        let mut kept = Vec::with_capacity(polygon.len() + 1);
        for (at, &p) in polygon.iter().enumerate() {
            let q = polygon[(at + 1) % polygon.len()];
            let (here, there) = (cross(p, a, b), cross(q, a, b));
            if here >= 0.0 {
                kept.push(p);
            }
            if (here > 0.0 && there < 0.0) || (here < 0.0 && there > 0.0) {
                kept.push(p + (q - p) * (here / (here - there)));
            }
        }
        polygon = kept;
        if polygon.len() < 3 {
            return 0.0;
        }
    }
    let corner = polygon[0];
    0.5 * polygon[1..]
        .windows(2)
        .map(|pair| (pair[0] - corner).perp_dot(pair[1] - corner))
        .sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::garment::{GarmentSummary, PanelSummary};
    use glam::DVec3;

    /// A rectangle with its lower left corner at (x, y) of the flat file.
    fn rectangle(x: f64, y: f64, width: f64, height: f64) -> Panel {
        let mut panel = Garment::rectangle(width, height).panels.remove(0);
        panel.flat_from_panel.translation = DVec3::new(x, y, 0.0);
        panel
    }

    fn garment(panels: Vec<Panel>) -> Garment {
        Garment {
            panels,
            summary: GarmentSummary { uv_scale_mm: 1.0, ..GarmentSummary::default() },
        }
    }

    fn near(found: &[([usize; 2], f64)], expected: &[([usize; 2], f64)]) {
        assert_eq!(found.len(), expected.len(), "{found:?}");
        for ((panels, area), (expected_panels, expected_area)) in found.iter().zip(expected) {
            assert!(
                panels == expected_panels && (area - expected_area).abs() < 1e-9 * expected_area,
                "{found:?}"
            );
        }
    }

    #[test]
    fn panels_share_the_area_that_both_cover() {
        let panels = vec![
            rectangle(0.0, 0.0, 10.0, 10.0),
            rectangle(7.0, 6.0, 10.0, 10.0),
            rectangle(10.0, 0.0, 5.0, 6.0),
        ];
        let found = overlaps(&garment(panels));
        near(&found.between, &[([0, 1], 12.0)]);
        assert!(
            found.within.is_empty() && found.complete,
            "those that touch along an edge don't overlap"
        );
    }

    #[test]
    fn a_mirrored_panel_and_one_of_its_own_scale_lie_as_in_the_file() {
        let mut mirrored = rectangle(10.0, 0.0, 10.0, 10.0);
        // Seen from behind: u runs to the left from x = 10.
        mirrored.flat_from_panel.matrix3.x_axis = -DVec3::X;
        mirrored.flat_from_panel.matrix3.z_axis = -DVec3::Z;
        let mut found = garment(vec![rectangle(8.0, 5.0, 10.0, 10.0), mirrored]);
        near(&overlaps(&found).between, &[([0, 1], 10.0)]);
        // Panel 0 takes two mm for each of the garment's, so in the layout it is 5 by 5 at (4,
        // 2.5).
        found.summary.panels = vec![
            PanelSummary { scale_mm: 2.0, degenerate: 0 },
            PanelSummary { scale_mm: 1.0, degenerate: 0 },
        ];
        near(&overlaps(&found).between, &[([0, 1], 25.0)]);
    }

    #[test]
    fn another_plane_is_elsewhere() {
        let mut above = rectangle(0.0, 0.0, 10.0, 10.0);
        above.flat_from_panel.translation.z = 5.0;
        assert!(
            overlaps(&garment(vec![rectangle(0.0, 0.0, 10.0, 10.0), above])).between.is_empty()
        );
    }

    #[test]
    fn a_panel_that_goes_over_itself() {
        // Two squares of side 2 in one panel, the second moved by half its side.
        let mut panel = rectangle(0.0, 0.0, 2.0, 2.0);
        panel.uv.extend([(1.0, 0.0), (3.0, 0.0), (3.0, 2.0), (1.0, 2.0)].map(DVec2::from));
        panel.triangles.extend([[4, 5, 6], [4, 6, 7]]);
        panel.draped.resize(8, DVec3::ZERO);
        let found = overlaps(&garment(vec![panel]));
        assert_eq!(found, Overlaps { within: vec![(0, 2.0)], between: Vec::new(), complete: true });
    }

    #[test]
    fn a_star_of_two_triangles() {
        // A hexagram: the common hexagon has two thirds of either triangle's area.
        let corner = |turn: f64| DVec2::from_angle(turn.to_radians());
        let (up, down) = ([90.0, 210.0, 330.0].map(corner), [270.0, 30.0, 150.0].map(corner));
        let area = common_area(up, down);
        assert!((area - 2.0 / 3.0 * 0.75 * 3.0_f64.sqrt()).abs() < 1e-12, "{area}");
        assert_eq!(common_area(up, up.map(|p| p + DVec2::new(2.0, 0.0))), 0.0);
    }

    #[test]
    fn too_many_pairs_are_told() {
        // Thirty copies of a triangle make 435 pairs.
        let mut panel = rectangle(0.0, 0.0, 1.0, 1.0);
        panel.triangles = vec![[0, 1, 2]; 30];
        let copies = garment(vec![panel]);
        let found = among(&copies, 435);
        assert!(found.complete && (found.within[0].1 - 435.0 * 0.5).abs() < 1e-9, "{found:?}");
        assert!(!among(&copies, 434).complete);
    }
}

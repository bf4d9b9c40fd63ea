//! Overlaps of the flat pattern: panels over each other, and panels that cover a point of their
//! plane twice.
//!
//! In: a [`Garment`]. Out: [`Overlaps`], in mm² of the flat layout. Panels are placed as in the
//! file, at the garment's scale, and compared where they lie in one plane.
//!
//! A panel over another one is no fault, since each point belongs to a panel first. A panel over
//! itself is a fault: a point there lies in two triangles, and stitches take the one that comes
//! first in the file.
//!
//! Method: a BVH finds pairs of triangles that may meet. The common part of two triangles is a
//! convex polygon (Sutherland and Hodgman 1974, "Reentrant polygon clipping"), whose area is exact
//! to rounding. Cost: linear in the pairs of triangles whose bounding boxes meet.
//!
//! Not promised: a point that three triangles cover counts for each pair of them. After four
//! million pairs the search ends, and the areas are lower bounds. A texture that is repeated over a
//! whole mesh reaches that limit, since its pairs grow with the square of its triangles.

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

/// Pairs of triangles after which the search ends: a few seconds, and 200 MB if each pair belongs
/// to two panels of its own. A pattern that lies five deep has some 40 pairs a triangle. A lower
/// limit would cut off large regular patterns; a higher one lets tiled textures take minutes.
pub(super) const MAX_PAIRS: usize = 4_000_000;
/// Triangles between two checks of that limit. Each of them may meet all others, as those of a
/// tiled `vt` do, so larger batches overshoot the limit; smaller ones leave threads idle.
const BATCH: usize = 32;
/// Tolerance of areas, as a share of the smaller panel. Panels laid edge to edge overlap by the
/// rounding of their file, which is less. Larger values hide narrow overlaps.
pub(super) const AREA_TOLERANCE: f64 = 1e-6;
/// Two panels lie in one plane if the cosine between their normals is over the first value, and the
/// distance of their planes is under the second one, as a share of the larger panel. That is as
/// flat as a panel must be. Looser values compare panels that lie above each other; tighter ones
/// miss panels of files whose pattern is not quite flat.
const MIN_COSINE: f64 = 0.999;
const MAX_DISTANCE: f64 = 0.02;

/// Overlaps in the flat layout.
#[derive(Clone, Debug, PartialEq)]
pub struct Overlaps {
    /// Panels that overlap themselves, with the area covered twice, mm².
    pub within: Vec<(usize, f64)>,
    /// Pairs of panels, the lower number first, with the area that both cover, mm².
    pub between: Vec<([usize; 2], f64)>,
    /// Whether all pairs are counted. If not, there may be more, and areas may be larger.
    pub complete: bool,
}

/// A triangle at its place in the file, counter-clockwise in its plane's axes.
pub(super) struct FlatTriangle {
    panel: u32,
    /// Its index in the panel.
    pub(super) index: u32,
    pub(super) corners: [DVec2; 3],
}

/// The overlaps of one triangle with those after it.
struct TriangleOverlaps {
    /// Number of triangles that may meet it.
    candidates: usize,
    /// Each triangle that does, with the area that both cover.
    shared: Vec<(u32, f64)>,
}

/// Triangles of panels that lie in one plane.
pub(super) struct PlaneLayout {
    triangles: Vec<FlatTriangle>,
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
    overlaps_among(garment, MAX_PAIRS)
}

/// Finds all overlaps, or those among the first `max_pairs` pairs of triangles.
fn overlaps_among(garment: &Garment, max_pairs: usize) -> Overlaps {
    let Garment { panels, .. } = garment;
    let embedded = embedded(panels);
    let mut areas: BTreeMap<[usize; 2], f64> = BTreeMap::new();
    let mut left = Some(max_pairs);
    for layout in layouts(garment) {
        // A single panel that is embedded cannot overlap itself: nothing to search.
        if layout.shared
            || layout.triangles.first().is_some_and(|triangle| !embedded[triangle.panel as usize])
        {
            let mut add = |[one, other]: [&FlatTriangle; 2], area| {
                let panels = [one.panel.min(other.panel), one.panel.max(other.panel)];
                *areas.entry(panels.map(|panel| panel as usize)).or_default() += area;
            };
            left = left.and_then(|left| layout.measure(&embedded, left, &mut add));
        }
    }
    let size: Vec<f64> = (0..panels.len())
        .map(|panel| panels[panel].area() * relative_scale(garment, panel).powi(2))
        .collect();
    areas.retain(|&[a, b], area| *area > AREA_TOLERANCE * size[a].min(size[b]));
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

/// Whether each panel covers every point of its plane at most once, as far as its topology says.
pub(super) fn embedded(panels: &[Panel]) -> Vec<bool> {
    let panels = panels.par_iter();
    panels.map(|panel| Topology::new(&panel.uv, &panel.triangles).embedded).collect()
}

/// Factor from a panel's own millimetres to those of the layout, in which all panels lie as in the
/// file.
fn relative_scale(garment: &Garment, panel: usize) -> f64 {
    let own = garment
        .summary
        .panels
        .get(panel)
        .map_or(garment.summary.uv_scale_mm, |facts| facts.scale_mm);
    garment.summary.uv_scale_mm / own
}

/// The planes of the pattern, each with its triangles in the axes of its first panel.
fn layouts(garment: &Garment) -> Vec<PlaneLayout> {
    let mut layouts: Vec<(usize, PlaneLayout)> = Vec::new();
    for (number, panel) in garment.panels.iter().enumerate() {
        let found = layouts.iter().position(|&(first, _)| coplanar(garment, first, number));
        let at = found.unwrap_or_else(|| {
            layouts.push((number, PlaneLayout { triangles: Vec::new(), shared: false }));
            layouts.len() - 1
        });
        let (first, layout) = &mut layouts[at];
        layout.shared |= *first != number;
        let axes = garment.panels[*first].flat_from_panel.matrix3;
        let scale = relative_scale(garment, number);
        let points: Vec<DVec2> = (panel.uv.iter())
            .map(|uv| {
                let flat = panel.flat_from_panel.transform_point3(uv.extend(0.0)) * scale;
                DVec2::new(axes.x_axis.dot(flat), axes.y_axis.dot(flat))
            })
            .collect();
        layout.add(panel, number, &points);
    }
    layouts.into_iter().map(|(_, layout)| layout).collect()
}

/// Whether two panels lie in one plane, within tolerance.
fn coplanar(garment: &Garment, one: usize, other: usize) -> bool {
    let [(normal, origin, size), (other_normal, other_origin, other_size)] =
        [one, other].map(|number| {
            let panel = &garment.panels[number];
            let Panel { flat_from_panel, .. } = panel;
            let scale = relative_scale(garment, number);
            (
                flat_from_panel.matrix3.z_axis,
                flat_from_panel.translation * scale,
                panel.size().max_element() * scale,
            )
        });
    normal.dot(other_normal).abs() > MIN_COSINE
        && normal.dot(other_origin - origin).abs() < MAX_DISTANCE * size.max(other_size)
}

impl PlaneLayout {
    /// A single panel in its own axes.
    pub(super) fn of(panel: &Panel, number: usize) -> Self {
        let mut layout = Self { triangles: Vec::new(), shared: false };
        layout.add(panel, number, &panel.uv);
        layout
    }

    /// Adds a panel's triangles. `points` are its vertices in the plane's axes.
    fn add(&mut self, panel: &Panel, number: usize, points: &[DVec2]) {
        self.triangles.extend(panel.triangles.iter().zip(0..).filter_map(|(corners, index)| {
            let [a, b, c] = corners.map(|vertex| points[vertex as usize]);
            // Mirrored panels are clockwise here. Clipping needs both triangles counter-clockwise.
            let area = cross(a, b, c);
            let corners = if area > 0.0 { [a, b, c] } else { [a, c, b] };
            (area != 0.0).then_some(FlatTriangle { panel: index32(number), index, corners })
        }));
    }

    /// Gives `add` every two of its triangles that overlap, with the area that both cover. Two
    /// triangles of one `embedded` panel are left out. Returns the number of pairs that are left of
    /// `max_pairs`, or none if there were too many.
    pub(super) fn measure(
        &self,
        embedded: &[bool],
        max_pairs: usize,
        add: &mut impl FnMut([&FlatTriangle; 2], f64),
    ) -> Option<usize> {
        let boxes: Vec<_> =
            self.triangles.iter().map(|flat| outer_box(flat.corners.iter().copied())).collect();
        let bvh = tree(&boxes);
        let mut left = max_pairs;
        let numbers: Vec<u32> = (0..index32(self.triangles.len())).collect();
        for batch in numbers.chunks(BATCH) {
            // Areas of a batch are computed in parallel but added in order, so the sums are the
            // same for any number of threads.
            let found: Vec<TriangleOverlaps> = batch
                .par_iter()
                .map(|&triangle| self.overlaps_of(triangle, &boxes, &bvh, embedded))
                .collect();
            for (&triangle, TriangleOverlaps { candidates, shared }) in batch.iter().zip(found) {
                left = left.checked_sub(candidates)?;
                for (other, area) in shared {
                    add([triangle, other].map(|number| &self.triangles[number as usize]), area);
                }
            }
        }
        Some(left)
    }

    /// The overlaps of a triangle with those after it.
    fn overlaps_of(
        &self,
        triangle: u32,
        boxes: &[Aabb],
        bvh: &Bvh2,
        embedded: &[bool],
    ) -> TriangleOverlaps {
        let one = &self.triangles[triangle as usize];
        let mut others = Vec::new();
        let own_box = boxes[triangle as usize];
        visit_boxes(bvh, own_box, |other| {
            let same_panel = self.triangles[other as usize].panel == one.panel;
            let apart = same_panel && embedded[one.panel as usize]
                || !boxes[other as usize].intersect_aabb(&own_box);
            if other > triangle && !apart {
                others.push(other);
            }
        });
        // The order of a search depends on the tree's shape. Sorting keeps it from changing the
        // rounding of sums.
        others.sort_unstable();
        let mut shared = Vec::new();
        for &other in &others {
            let area = common_area(one.corners, self.triangles[other as usize].corners);
            if area > 0.0 {
                shared.push((other, area));
            }
        }
        TriangleOverlaps { candidates: others.len(), shared }
    }
}

/// Area that two counter-clockwise triangles both cover: the first one, clipped along each side of
/// the other (Sutherland and Hodgman 1974).
fn common_area(triangle: [DVec2; 3], other: [DVec2; 3]) -> f64 {
    let mut polygon = triangle.to_vec();
    for side in 0..3 {
        let (a, b) = (other[side], other[(side + 1) % 3]);
        let mut kept = Vec::with_capacity(polygon.len() + 1);
        // Keep corners on the inner side of the line, and add a corner where a side crosses it.
        // Exact signs keep the decisions consistent, so two triangles that share an edge have no
        // sliver in common.
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
    // The area as a fan of triangles around one corner. Differences from a corner keep digits that
    // coordinates far from the origin would lose.
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
            PanelSummary { scale_mm: 2.0, ..PanelSummary::default() },
            PanelSummary { scale_mm: 1.0, ..PanelSummary::default() },
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
        let found = overlaps_among(&copies, 435);
        assert!(found.complete && (found.within[0].1 - 435.0 * 0.5).abs() < 1e-9, "{found:?}");
        assert!(!overlaps_among(&copies, 434).complete);
    }
}

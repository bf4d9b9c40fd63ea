//! Patches: the squares into which panels are cut, so that their yarns are measured square by square.
//!
//! In: a [`Cloth`]. Out: [`Patches`] of all panels, numbered panel by panel, row by row. Not promised:
//! that a patch has any yarn.

use std::ops::Range;

use glam::{DVec2, DVec3};

use super::arcs::Arc;
use crate::drape::Cloth;
use crate::ids::index32;

/// Data points of a patch, on average. A stitch has about ten. With a quarter of them the margin
/// would be as large as the patch. With many more, a patch (a kilobyte a point) would leave the
/// cache.
const PATCH_POINTS: f64 = 12_000.0;

/// A square of a panel whose yarns are measured together.
pub(super) struct ClothPatch {
    pub(super) panel: usize,
    pub(super) area: Area,
}

/// A part of the flat cloth, and a margin around it.
pub(super) struct Area {
    /// Its corners, mm.
    pub(super) low: DVec2,
    pub(super) high: DVec2,
    pub(super) margin: f64,
}

impl Area {
    /// Whether a span with these ends may have arcs in it or in its margin.
    pub(super) fn touches(&self, ends: [DVec3; 2]) -> bool {
        let reach = self.margin + ends[0].distance(ends[1]);
        let middle = ends[0].midpoint(ends[1]).truncate();
        middle.cmpge(self.low - reach).all() && middle.cmple(self.high + reach).all()
    }

    /// The place from which arcs have their flat places.
    pub(super) fn near(&self) -> DVec3 {
        self.low.extend(0.0)
    }

    /// Whether an arc is to be measured. `None` if it is too far away to matter.
    pub(super) fn measures(&self, arc: &Arc) -> Option<bool> {
        let middle = arc.flat.truncate().as_dvec2();
        let size = self.high - self.low;
        let near = middle.cmpge(DVec2::splat(-self.margin)).all()
            && middle.cmple(size + self.margin).all();
        near.then(|| middle.cmpge(DVec2::ZERO).all() && middle.cmplt(size).all())
    }
}

/// The patches of one panel.
struct PanelPatches {
    /// Lowest left corner. Curves may bulge over the panel's edge by less than the distance of two
    /// wales or courses.
    origin: DVec2,
    columns: usize,
    rows: usize,
    /// The number of its first patch.
    first: usize,
}

/// The patches of all panels.
pub(super) struct Patches {
    /// Side of a patch, mm.
    pub(super) side: f64,
    /// How far from a patch its yarns have neighbours, mm.
    pub(super) margin: f64,
    panels: Vec<PanelPatches>,
}

impl Patches {
    /// Cuts all panels of a cloth whose yarns have neighbours up to `margin` mm away.
    pub(super) fn new(cloth: &Cloth<'_>, margin: f64) -> Self {
        let side = (PATCH_POINTS / cloth.pattern.points_per_area()).sqrt().max(margin);
        let mut patches = Self { side, margin, panels: Vec::new() };
        for (panel, mesh) in cloth.garment.panels.iter().zip(&cloth.meshes) {
            let overhang = DVec2::splat(mesh.wale_spacing.max(mesh.course_spacing));
            let size = panel.size() + 2.0 * overhang;
            let [columns, rows] = size.to_array().map(|size| whole(size / side) + 1);
            let (origin, first) = (panel.bounds()[0] - overhang, patches.count());
            patches.panels.push(PanelPatches { origin, columns, rows, first });
        }
        patches
    }

    /// Number of patches of all panels.
    pub(super) fn count(&self) -> usize {
        self.panels.last().map_or(0, |last| last.first + last.columns * last.rows)
    }

    /// The numbers of a panel's patches.
    pub(super) fn of_panel(&self, panel: usize) -> Range<usize> {
        let PanelPatches { columns, rows, first, .. } = self.panels[panel];
        first..first + columns * rows
    }

    /// A patch by its number.
    pub(super) fn patch(&self, number: usize) -> ClothPatch {
        let panel = self.panels.partition_point(|panel| panel.first <= number) - 1;
        let PanelPatches { origin, columns, first, .. } = self.panels[panel];
        let at = [(number - first) % columns, (number - first) / columns];
        // Both sides of a border come from the same formula, so no yarn is lost between them.
        let corner = |at: [usize; 2]| {
            let [x, y] = at.map(|count| f64::from(index32(count)));
            origin + self.side * DVec2::new(x, y)
        };
        let (low, high) = (corner(at), corner(at.map(|count| count + 1)));
        ClothPatch { panel, area: Area { low, high, margin: self.margin } }
    }

    /// The patches of a panel that a box touches with themselves or with their margins, counted from
    /// the panel's first.
    pub(super) fn around(
        &self,
        panel: usize,
        [low, high]: [DVec2; 2],
    ) -> impl Iterator<Item = usize> {
        let PanelPatches { origin, columns, rows, .. } = self.panels[panel];
        let [low, high] = [low - self.margin, high + self.margin]
            .map(|corner| ((corner - origin) / self.side).to_array().map(whole));
        (low[1]..=high[1].min(rows - 1)).flat_map(move |row| {
            (low[0]..=high[0].min(columns - 1)).map(move |at| row * columns + at)
        })
    }
}

/// A count rounded down; 0 below 0.
// Panels are limited to a million wales and courses, and a patch has more than one of each.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "see above")]
fn whole(count: f64) -> usize {
    count.floor() as usize
}

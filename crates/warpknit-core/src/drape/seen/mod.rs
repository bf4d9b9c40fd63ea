//! What pictures see of a draped garment, decided before any yarn is knitted.
//!
//! In: a [`Garment`], and a [`Sight`] for each picture. Out: a [`Seen`], which says for each place
//! of the flat panels whether pictures show it, whether it only casts the sun's shadow on what they
//! show, or neither. [`Cloth::seen`](super::Cloth::seen) then plans the stretches of yarn that are
//! needed, and [`Seen::runs`] says which points of a strand go into the picture.
//!
//! Method: each draped triangle is tested against the planes of the view (Assarsson and Möller
//! 2000, "Optimized view frustum culling algorithms"), grown by the reach of the light that yarns
//! take from each other. Triangles on the border are divided until they are as small as a cell of a
//! grid over the flat panel. Parts out of view are then tested against a grid along the sun's rays
//! (`shadow`).
//!
//! Cost: some 50 ns a cell in view. Not promised: parts that other parts hide are seen all the
//! same, since cloth has holes.

mod plan;
mod shadow;

use std::ops::Range;

use glam::{DVec2, DVec3, UVec2};
use rayon::prelude::*;

use crate::garment::{Garment, Panel};
use crate::map::surface::SmoothSurface;
pub use plan::{LEAD_POINTS, Stretches};
use shadow::SunGrid;

/// Smallest number of cells across the larger side of a garment's panel, and largest. With fewer, a
/// close-up builds much more than it shows. With more, the decision takes longer than the yarns that
/// it spares.
const CELLS: (f64, f64) = (64.0, 2048.0);
/// Points by which a run is longer than what is seen, at both ends: what is drawn of a
/// point depends on up to two points before it and behind it.
const CONTEXT_POINTS: usize = 4;
/// Runs with fewer points between them are joined. Loops wind in and out of a cell.
const JOINED_POINTS: usize = 48;

/// A picture's view, as far as it decides what is in it.
#[derive(Clone, Debug)]
pub struct Sight {
    /// The planes around the view: an inward unit normal n and a number d. Inside, n·p + d ≥ 0.
    pub sides: Vec<(DVec3, f64)>,
    /// Position of the eye, mm.
    pub eye: DVec3,
    /// Size of a pixel at distance 1, mm.
    pub pixel: f64,
    /// Unit vector to the sun.
    pub toward_sun: DVec3,
    /// Tangent of half the angle that the sun's disc takes.
    pub sun_spread: f64,
}

/// Lengths of the cloth that decide how far around the view yarns matter, mm.
#[derive(Clone, Copy, Debug)]
pub struct Surroundings {
    /// Size of a stitch.
    pub stitch: f64,
    /// Distance of yarns from the draped surface at most.
    pub depth: f64,
    /// How far light from the sky looks for yarns.
    pub sky_reach: f64,
}

/// What a place of the cloth is for a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum PanelPart {
    /// Neither seen nor between the sun and what is seen.
    #[default]
    Unseen,
    /// It only casts the sun's shadow on what is seen.
    Shadow,
    /// In view, or within the reach of light of what is in view.
    Seen,
}

/// What pictures see of a garment.
#[derive(Clone, Debug)]
pub struct Seen {
    panels: Vec<PartGrid>,
    /// Size of the smallest pixel on cloth in view, mm. Infinite where no cloth is in view.
    pixel: f64,
}

/// The parts of a flat panel, cell by cell.
#[derive(Clone, Debug)]
struct PartGrid {
    low: DVec2,
    cell: f64,
    size: UVec2,
    /// Row after row, from the lowest.
    parts: Vec<PanelPart>,
}

/// A part of a draped triangle.
#[derive(Clone, Copy)]
struct FlatFacet {
    flat: [DVec2; 3],
    place: [DVec3; 3],
    /// Distance of its yarns from it at most, mm.
    depth: f64,
}

impl Seen {
    /// Finds what pictures see. `None` if they see all of the garment.
    #[must_use]
    pub fn find(garment: &Garment, sights: &[Sight], around: &Surroundings) -> Option<Self> {
        let facets: Vec<Vec<FlatFacet>> =
            garment.panels.par_iter().map(|panel| facets(panel, around.depth)).collect();
        let reach = around.sky_reach;
        let is_inside = |facet: &FlatFacet| sights.iter().any(|sight| sight.holds(facet, reach));
        if facets.iter().flatten().all(is_inside) {
            return None;
        }
        let panels = garment.panels.iter().map(|panel| PartGrid::new(panel, around.stitch));
        let mut seen = Self { panels: panels.collect(), pixel: f64::INFINITY };
        for sight in sights {
            seen.add(&facets, sight, around);
        }
        Some(seen)
    }

    /// Adds what one picture sees.
    fn add(&mut self, facets: &[Vec<FlatFacet>], sight: &Sight, around: &Surroundings) {
        let panels = self.panels.par_iter_mut().zip(facets);
        // The places that the sun must reach, and how near the nearest is.
        let in_view: Vec<FlatFacet> = panels
            .flat_map_iter(|(grid, facets)| {
                let mut in_view = Vec::new();
                for facet in facets {
                    grid.add_view(facet, sight, around.sky_reach, &mut in_view);
                }
                in_view
            })
            .collect();
        let nearest = in_view.iter().map(|facet| facet.distance(sight.eye));
        self.pixel = self.pixel.min(sight.pixel * nearest.fold(f64::INFINITY, f64::min));
        let Some(sun) = SunGrid::new(&in_view, sight) else { return };
        self.panels.par_iter_mut().zip(facets).for_each(|(grid, facets)| {
            facets.iter().for_each(|facet| grid.add_shadow(facet, &sun));
        });
    }

    /// Size of the smallest pixel on cloth in view, mm. Infinite where no cloth is in view.
    #[must_use]
    pub fn pixel(&self) -> f64 {
        self.pixel
    }

    /// The part of a panel at a flat place.
    #[must_use]
    pub fn at(&self, panel: usize, place: DVec2) -> PanelPart {
        let grid = &self.panels[panel];
        grid.parts[grid.index(grid.cell_of(place))]
    }

    /// The runs of a strand's points that go into a picture, with a few points around them. `flat`
    /// are the points in panel axes. The flag says whether any point of the run is seen itself.
    #[must_use]
    pub fn runs(&self, panel: usize, flat: &[DVec3]) -> Vec<(Range<usize>, bool)> {
        let mut runs: Vec<(Range<usize>, bool)> = Vec::new();
        for (at, place) in flat.iter().enumerate() {
            let part = self.at(panel, place.truncate());
            if part == PanelPart::Unseen {
                continue;
            }
            let is_seen = part == PanelPart::Seen;
            match runs.last_mut() {
                Some((run, any_seen)) if at <= run.end + JOINED_POINTS => {
                    run.end = at + 1;
                    *any_seen |= is_seen;
                }
                _ => runs.push((at..at + 1, is_seen)),
            }
        }
        for (run, _) in &mut runs {
            *run =
                run.start.saturating_sub(CONTEXT_POINTS)..flat.len().min(run.end + CONTEXT_POINTS);
        }
        runs
    }
}

impl Sight {
    /// How far inside the view a facet reaches, mm. Negative outside, where it is the distance or
    /// less.
    fn depth_of(&self, facet: &FlatFacet) -> f64 {
        let reach = self.sides.iter().map(|(normal, offset)| {
            let corners = facet.place.iter().map(|place| normal.dot(*place) + offset);
            corners.fold(f64::NEG_INFINITY, f64::max)
        });
        reach.fold(f64::INFINITY, f64::min) + facet.depth
    }

    /// Whether a place lies inside the view or within `reach` of it, mm.
    #[must_use]
    pub fn is_near(&self, place: DVec3, reach: f64) -> bool {
        self.sides.iter().all(|(normal, offset)| normal.dot(place) + offset >= -reach)
    }

    /// Whether all of a facet does.
    fn holds(&self, facet: &FlatFacet, reach: f64) -> bool {
        facet.place.iter().all(|place| self.is_near(*place, reach))
    }
}

/// The draped triangles of a panel, on which yarns are no farther away than `depth`.
fn facets(panel: &Panel, depth: f64) -> Vec<FlatFacet> {
    let surface = SmoothSurface::new(panel);
    let facet = |(triangle, corners): (usize, &[u32; 3])| {
        let place = corners.map(|v| panel.draped[v as usize]);
        let depth = depth + surface.patch(panel, triangle).bulge(place);
        FlatFacet { flat: corners.map(|v| panel.uv[v as usize]), place, depth }
    };
    panel.triangles.iter().enumerate().map(facet).collect()
}

impl FlatFacet {
    /// Its four quarters.
    fn quarters(&self) -> [Self; 4] {
        let Self { flat: [a, b, c], place: [p, q, r], depth } = *self;
        let (ab, bc, ca) = (a.midpoint(b), b.midpoint(c), c.midpoint(a));
        let (pq, qr, rp) = (p.midpoint(q), q.midpoint(r), r.midpoint(p));
        [
            Self { flat: [a, ab, ca], place: [p, pq, rp], depth },
            Self { flat: [ab, b, bc], place: [pq, q, qr], depth },
            Self { flat: [ca, bc, c], place: [rp, qr, r], depth },
            Self { flat: [ab, bc, ca], place: [pq, qr, rp], depth },
        ]
    }

    /// The corners of its flat bounding box.
    fn flat_bounds(&self) -> [DVec2; 2] {
        let [a, b, c] = self.flat;
        [a.min(b).min(c), a.max(b).max(c)]
    }

    /// Middle of its corners, and their distance from it.
    fn ball(&self) -> (DVec3, f64) {
        let middle = self.place.iter().sum::<DVec3>() / 3.0;
        let reach = self.place.iter().map(|place| place.distance(middle));
        (middle, reach.fold(0.0, f64::max))
    }

    /// Distance of its yarns from a point at least, mm.
    fn distance(&self, from: DVec3) -> f64 {
        let (middle, reach) = self.ball();
        (middle.distance(from) - reach - self.depth).max(0.0)
    }
}

impl PartGrid {
    fn new(panel: &Panel, stitch: f64) -> Self {
        let [low, high] = panel.bounds();
        let extent = high - low;
        let longest = extent.max_element();
        // Cells of two stitches: a smaller one would hold no whole loop.
        let cell = (2.0 * stitch).clamp(longest / CELLS.1, longest / CELLS.0);
        let size = (extent / cell).ceil().max(DVec2::ONE).as_uvec2();
        let parts = vec![PanelPart::Unseen; (size.x * size.y) as usize];
        Self { low, cell, size, parts }
    }

    /// The cell of a place; for one beyond the panel, the nearest cell.
    fn cell_of(&self, place: DVec2) -> UVec2 {
        // `as_uvec2` saturates at 0.
        ((place - self.low) / self.cell).as_uvec2().min(self.size - 1)
    }

    fn index(&self, cell: UVec2) -> usize {
        (cell.y * self.size.x + cell.x) as usize
    }

    /// Raises the cells that a facet touches to `part`.
    fn raise(&mut self, facet: &FlatFacet, part: PanelPart) {
        let [low, high] = facet.flat_bounds().map(|corner| self.cell_of(corner));
        for y in low.y..=high.y {
            let row = self.index(UVec2::new(low.x, y))..=self.index(UVec2::new(high.x, y));
            self.parts[row].iter_mut().for_each(|own| *own = (*own).max(part));
        }
    }

    /// Whether a facet is as small as a cell.
    fn is_small(&self, facet: &FlatFacet) -> bool {
        let [low, high] = facet.flat_bounds();
        (high - low).max_element() <= self.cell
    }

    /// Marks what a picture sees of a facet. Parts in the view itself are added to `in_view`; those
    /// within `reach` of it are marked too.
    fn add_view(
        &mut self,
        facet: &FlatFacet,
        sight: &Sight,
        reach: f64,
        in_view: &mut Vec<FlatFacet>,
    ) {
        let depth = sight.depth_of(facet);
        if depth < -reach {
            return;
        }
        if !self.is_small(facet) {
            let quarters = facet.quarters();
            return quarters.iter().for_each(|part| self.add_view(part, sight, reach, in_view));
        }
        self.raise(facet, PanelPart::Seen);
        if depth >= 0.0 {
            in_view.push(*facet);
        }
    }

    /// Marks what of a facet casts shadows into the view.
    fn add_shadow(&mut self, facet: &FlatFacet, sun: &SunGrid) {
        if !sun.is_shadowed_by(facet) {
            return;
        }
        if self.is_small(facet) {
            return self.raise(facet, PanelPart::Shadow);
        }
        facet.quarters().iter().for_each(|part| self.add_shadow(part, sun));
    }

    /// The ranges along a strip that are seen or cast shadows, joined where cells touch, with what
    /// they are at most. The strip is `across` one axis (0 or 1) and runs along the other.
    fn ranges(&self, axis: usize, across: Range<f64>) -> Vec<(Range<f64>, PanelPart)> {
        let cells = |at: f64, axis: usize| self.cell_of(DVec2::splat(at))[axis];
        let columns = cells(across.start, axis)..=cells(across.end, axis);
        let along = 1 - axis;
        let mut ranges: Vec<(Range<f64>, PanelPart)> = Vec::new();
        for row in 0..self.size[along] {
            let cell = |column| {
                let cell =
                    if axis == 0 { UVec2::new(column, row) } else { UVec2::new(row, column) };
                self.parts[self.index(cell)]
            };
            let part = columns.clone().map(cell).max().unwrap_or_default();
            if part == PanelPart::Unseen {
                continue;
            }
            let start = self.low[along] + f64::from(row) * self.cell;
            let end = start + self.cell;
            match ranges.last_mut() {
                Some((last, most)) if last.end >= start - self.cell / 2.0 => {
                    last.end = end;
                    *most = (*most).max(part);
                }
                _ => ranges.push((start..end, part)),
            }
        }
        ranges
    }
}

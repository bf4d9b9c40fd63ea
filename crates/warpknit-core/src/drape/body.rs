//! The draped garment as the target of a map.
//!
//! In: a [`Garment`], how yarns are mapped, and the table of strained repeats if there is one.
//! Out: a [`DrapedGarment`], which maps the strands of a block. What a whole panel has to give is
//! made here, once a run or once a frame.

use rayon::prelude::*;

use super::strands::Strands;
use crate::garment::Garment;
use crate::knit::strain::{RepeatSpans, StrainTable};
use crate::knit::{Knitted, Progress};
use crate::map::relaxed::{StrainCounts, StrainedPanel};
use crate::map::surface::SmoothSurface;
use crate::map::{Draped, Mapping, map_into};

/// A garment that yarns are mapped to.
pub(super) struct DrapedGarment<'a> {
    garment: &'a Garment,
    mapping: Mapping,
    /// The table, and the smooth surface of each panel, for [`Mapping::Relaxed`].
    relaxed: Option<(&'a StrainTable, Vec<SmoothSurface>)>,
    /// The spans of the repeat, if yarns are swept.
    spans: Option<RepeatSpans>,
}

impl<'a> DrapedGarment<'a> {
    /// Prepares a garment, and solves the repeat for its strains. `progress` gets the share of them
    /// that is done.
    pub(super) fn new(
        garment: &'a Garment,
        table: Option<&'a StrainTable>,
        mapping: Mapping,
        is_swept: bool,
        progress: Progress<'_>,
    ) -> Self {
        let relaxed = table.filter(|_| mapping == Mapping::Relaxed).map(|table| {
            let surfaces: Vec<_> = garment.panels.par_iter().map(SmoothSurface::new).collect();
            // Cloth that edges turn in is hidden, and bends sharply where it is folded.
            let panels = garment.panels.par_iter().zip(&surfaces);
            let strains = panels
                .filter(|(panel, _)| panel.turned_in.is_none())
                .flat_map(|(panel, surface)| StrainedPanel { panel, surface, table }.strains());
            table.prepare(strains, progress);
            (table, surfaces)
        });
        let spans = table.filter(|_| is_swept).map(StrainTable::spans);
        Self { garment, mapping, relaxed, spans }
    }

    /// What sweeps of a panel need to know of the repeat. Nothing if its yarns are not swept.
    pub(super) fn swept(&self, panel: usize) -> Option<&RepeatSpans> {
        let is_own = self.garment.panels.get(panel).is_some_and(|panel| panel.turned_in.is_none());
        self.spans.as_ref().filter(|_| is_own)
    }

    /// Maps the strands of a block on one panel.
    pub(super) fn map(
        &self,
        panel: usize,
        strands: &Strands,
        knitted: &Knitted,
        draped: &mut Draped,
    ) -> StrainCounts {
        let mesh = &self.garment.panels[panel];
        let relaxed = self.relaxed.as_ref().filter(|_| mesh.turned_in.is_none());
        let Some((table, surfaces)) = relaxed else {
            let mapping = if mesh.turned_in.is_some() { Mapping::Smooth } else { self.mapping };
            map_into(mesh, &strands.flat, &strands.located, mapping, draped);
            return StrainCounts::default();
        };
        let strained = StrainedPanel { panel: mesh, surface: &surfaces[panel], table };
        // The point of the repeat of which each is a copy.
        let origin = |point| knitted.origins[strands.source_near(point) as usize];
        strained.map(&strands.flat, &strands.located, origin, draped)
    }
}

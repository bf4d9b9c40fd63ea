//! How near yarns come to each other on the body.
//!
//! In: [`Block`]s as [`run`](super::run) delivers them. Out: one [`Clearance`] of the whole
//! garment, measured as [`crate::knit::clearance`] measures a repeat: on the path that is drawn,
//! each bar with its drawn radius. A panel is measured by itself, since yarns of two panels may
//! touch at a seam, and that is not the mapping's doing. Nor are stitches that the panel's edge
//! cuts: what is left of them bends otherwise than the whole, and stays out. A panel's seam with
//! itself and cloth that lies on cloth do count.
//!
//! Cost: about 20 kB and .7 ms a stitch, on one thread; a panel's memory is let go before the next
//! one's is taken.

use std::ops::Range;

use glam::I64Vec2;

use super::strands::{CUT, Strand, Strands};
use super::{Block, Cloth};
use crate::knit::clearance::{Clearance, SampledPaths};

/// Collects a panel's yarns until the next panel's come.
///
/// ```
/// use warpknit::{drape::{self, clearance::Gauge}, fabric::Fabric};
/// let fabric = Fabric::named("tricot")?;
/// let panel = drape::swatch_panel(&fabric, 8, 10);
/// let cloth = drape::Cloth::swatch(&panel, &fabric, 8, 10);
/// let mut gauge = Gauge::new(&cloth, fabric.radius());
/// let deliver = &mut |blocks: &[drape::Block]| Ok::<_, std::io::Error>(gauge.take(blocks));
/// drape::run(&cloth, &drape::Options::default(), &mut |_, _| {}, deliver)?;
/// assert!(gauge.finish().min_over_2r > 0.98);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Gauge {
    /// Each bar's drawn radius, mm.
    radii: Vec<f64>,
    panel: usize,
    paths: SampledPaths,
    /// Of the panels before.
    clearance: Clearance,
}

impl Gauge {
    /// For a cloth whose thickest yarns are drawn with `radius` mm.
    #[must_use]
    pub fn new(cloth: &Cloth<'_>, radius: f64) -> Self {
        let radii = cloth.thickness.iter().map(|thickness| radius * thickness).collect();
        Self { radii, panel: 0, paths: SampledPaths::default(), clearance: Clearance::FREE }
    }

    /// Adds the strands of some blocks, and measures every panel that they leave behind.
    pub fn take(&mut self, blocks: &[Block]) {
        for block in blocks {
            if block.panel != self.panel {
                self.end_panel();
                self.panel = block.panel;
            }
            for strand in &block.strands.strands {
                self.paths.add(
                    &block.draped.positions[whole(&block.strands, strand)],
                    self.radii[block.bar],
                    |_| true,
                );
            }
        }
    }

    /// Measures the last panel: all of them together.
    #[must_use]
    pub fn finish(mut self) -> Clearance {
        self.end_panel();
        self.clearance
    }

    fn end_panel(&mut self) {
        self.clearance =
            self.clearance.and(std::mem::take(&mut self.paths).clearance(|_| I64Vec2::ZERO));
    }
}

/// The points of a strand's whole stitches, and the next one's first.
fn whole(strands: &Strands, strand: &Strand) -> Range<usize> {
    let (first, last) = (strand.points.start as usize, strand.points.end as usize - 1);
    let pieces = &strands.pieces[strand.pieces.start as usize..strand.pieces.end as usize];
    let is_cut = |at: usize| strands.sources[at] == CUT;
    let start =
        if is_cut(first) { pieces.get(1).map_or(last, |&piece| piece as usize) } else { first };
    let end =
        if is_cut(last) { pieces.last().map_or(first, |&piece| piece as usize) } else { last };
    start..(end + 1).max(start)
}

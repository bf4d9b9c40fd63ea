//! Finished edges of a run's pictures: which pictures have them, and the sewing thread.
//!
//! In: the parts of a run, a garment, and the relaxed repeat of its fabric. Out: the garment with hems
//! and seam allowances, and its threads in a scene. Files are of the garment as it is. The window
//! takes the same.

use super::densities::{Gauge, Shown};
use super::settings::EdgeFinish;
use crate::edges::{Edges, Sizes, Thread};
use crate::export::Format;
use crate::garment::Garment;
use crate::ids::index32;
use crate::knit::Pattern;
use crate::render::scene::{Scene, YarnLook};

/// Radius of sewing thread, mm: one of 27 tex, for light knits.
const THREAD: f64 = 0.1;

/// A part of a run as pictures with finished edges and as other files, those that there are. The flag
/// says whether edges are finished.
pub(super) fn divided(
    part: Shown<'_>,
    chosen: Option<EdgeFinish>,
) -> impl Iterator<Item = (Shown<'_>, bool)> {
    let is_finished = has_finished_edges(chosen, part.gauge == Gauge::True);
    let (pictures, files) =
        part.outputs.iter().cloned().partition(|(_, format)| is_finished && *format == Format::Png);
    let drawn = Shown { outputs: pictures, ..part.clone() };
    let filed = Shown { outputs: files, ..part };
    [(drawn, true), (filed, false)].into_iter().filter(|(part, _)| !part.outputs.is_empty())
}

/// Whether edges are finished: as someone chose, or else at true gauge.
#[must_use]
pub fn has_finished_edges(chosen: Option<EdgeFinish>, is_true_gauge: bool) -> bool {
    chosen.map_or(is_true_gauge, |finish| finish == EdgeFinish::Hemmed)
}

/// The edges of a garment, for cloth of this repeat whose thickest yarn has this radius, mm.
#[must_use]
pub fn edges_of(garment: &Garment, pattern: &Pattern, radius: f64) -> Edges {
    let [low, high] = pattern.depths();
    Edges::new(garment, Sizes { face: high + radius, back: radius - low, thread: THREAD })
}

/// Adds the look of threads to a scene of the cloth that they are sewn into: that of its front bar, at
/// their own thickness. Without threads there is none.
pub fn add_thread_look(scene: &mut Scene, threads: &[Thread]) {
    #[expect(clippy::cast_possible_truncation, reason = "a length in mm needs no more")]
    let radius = THREAD as f32;
    let front = scene.looks.first().filter(|_| !threads.is_empty());
    let look = front.map(|front| YarnLook { radius, plies: 3, maps: None, ..*front });
    scene.looks.extend(look);
}

/// Adds threads to a scene whose last look is theirs.
pub fn add_threads(scene: &mut Scene, threads: &[Thread]) {
    let look = u16::try_from(scene.looks.len().saturating_sub(1))
        .expect("a fabric has a hundred bars at most");
    for (number, thread) in (0..).zip(threads) {
        let points = thread.iter().map(|(place, normal)| (place.as_vec3(), normal.as_vec3()));
        // One stitch begins at each point: a thread has no loops that share a number of segments.
        scene.push_stitches(points, 0..index32(thread.len()), look);
        // Numbers of yarns begin at 0.
        scene.strands.last_mut().expect("added just now").yarn = u32::MAX - number;
    }
}

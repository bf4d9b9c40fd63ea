//! Finished edges of a run's pictures: which pictures have them, and the sewing thread.
//!
//! In: the parts of a run, a garment, and the relaxed repeat of its fabric. Out: the garment with hems
//! and seam allowances, and its threads in a scene. Files are of the garment as it is. The window
//! takes the same.

use std::ops::Range;

use super::densities::{Gauge, Shown};
use super::settings::EdgeFinish;
use super::views::InView;
use crate::edges::{Edges, Sizes, Thread};
use crate::export::Format;
use crate::garment::Garment;
use crate::ids::index32;
use crate::knit::Pattern;
use crate::render::scene::{Scene, SceneStrand, YarnLook};

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

/// Adds threads to a scene whose last look is theirs. Where cameras see a part, the rest of a thread
/// only casts its shadow.
pub fn add_threads(scene: &mut Scene, threads: &[Thread], in_view: Option<&InView>) {
    for (number, thread) in (0..).zip(threads) {
        let whole = 0..thread.len();
        let seen = match in_view {
            Some(in_view) => in_view.of_thread(thread).unwrap_or(0..0),
            None => whole.clone(),
        };
        // Both parts have the points between them.
        let before = whole.start..if seen.is_empty() { whole.end } else { seen.start };
        let after = seen.end.saturating_sub(1)..if seen.is_empty() { 0 } else { whole.end };
        for shadow in [before, after].into_iter().filter(|run| run.len() > 1) {
            add_run(scene, (number, thread), shadow).is_shadow = true;
        }
        if !seen.is_empty() {
            // Plies lie as they do in the whole thread.
            add_run(scene, (number, thread), 0..seen.end).lead = index32(seen.start);
        }
    }
}

/// Adds some points of a thread.
fn add_run<'a>(
    scene: &'a mut Scene,
    (number, thread): (u32, &Thread),
    run: Range<usize>,
) -> &'a mut SceneStrand {
    let look = u16::try_from(scene.looks.len().saturating_sub(1))
        .expect("a fabric has a hundred bars at most");
    let points = thread[run.clone()].iter();
    let points = points.map(|(place, normal)| (place.as_vec3(), normal.as_vec3()));
    // One stitch begins at each point: a thread has no loops that share a number of segments.
    scene.push_stitches(points, 0..index32(run.len()), look);
    let added = scene.strands.last_mut().expect("added just now");
    // Numbers of yarns begin at 0.
    added.yarn = u32::MAX - number;
    added.first = i64::from(index32(run.start));
    added
}

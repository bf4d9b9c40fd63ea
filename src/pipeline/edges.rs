//! Finished edges of a run's pictures: which pictures have them, and the sewing thread.
//!
//! In: the parts of a run, a garment, and the relaxed repeat of its fabric. Out: the garment with
//! hems and seam allowances, and its threads in a scene. Files are of the garment as it is. The
//! window takes the same, with whole threads.

use std::ops::Range;

use super::densities::{Gauge, Shown};
use super::settings::EdgeFinish;
use super::views::InView;
use crate::edges::{Edges, Sizes, Thread};
use crate::export::Format;
use crate::garment::Garment;
use crate::ids::index32;
use crate::knit::Pattern;
use crate::render::scene::{Scene, ScenePoint, SceneStrand, YarnKind, YarnLook};

/// Radius of sewing thread, mm: one of 27 tex, for light knits.
const THREAD: f64 = 0.1;

/// A part of a run as pictures with finished edges and as other files, those that there are. The
/// flag says whether edges are finished.
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

/// Adds the look of threads to a scene of the cloth that they are sewn into: that of its front bar,
/// at their own thickness. Without threads there is none.
pub fn add_thread_look(scene: &mut Scene, threads: &[Thread]) {
    #[expect(clippy::cast_possible_truncation, reason = "a length in mm needs no more")]
    let radius = THREAD as f32;
    let front = scene.looks.first().filter(|_| !threads.is_empty());
    let kind = YarnKind::SewingThread;
    let look = front.map(|front| YarnLook { radius, plies: 3, maps: None, kind, ..*front });
    scene.looks.extend(look);
}

/// Adds threads to a scene whose last look is theirs. Where cameras see a part, the rest of a
/// thread only casts its shadow.
pub fn add_threads(scene: &mut Scene, threads: &[Thread], in_view: Option<&InView>) {
    for (number, thread) in (0..).zip(threads) {
        let seen = in_view.map_or(Some(0..thread.len()), |in_view| in_view.of_thread(thread));
        for shadow in beside(seen.as_ref(), thread.len()) {
            add_run(scene, (number, thread), shadow).is_shadow = true;
        }
        if let Some(seen) = seen {
            // Plies lie as they do in the whole thread.
            add_run(scene, (number, thread), 0..seen.end).lead = index32(seen.start);
        }
    }
}

/// The runs of a thread's points before and behind those that are seen. Neighbouring runs share a
/// point, so that no segment is lost.
fn beside(seen: Option<&Range<usize>>, points: usize) -> impl Iterator<Item = Range<usize>> {
    let [before, after] = match seen {
        Some(seen) => [0..seen.start + 1, seen.end.saturating_sub(1)..points],
        None => [0..points, 0..0],
    };
    [before, after].into_iter().filter(|run| run.len() > 1)
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
    let flatten = scene.flatten(look);
    let points = points.map(|(place, normal)| ScenePoint {
        position: place.as_vec3(),
        normal: normal.as_vec3(),
        flatten,
    });
    // One stitch begins at each point: a thread has no loops that share a number of segments.
    scene.push_stitches(points, 0..index32(run.len()), look);
    let added = scene.strands.last_mut().expect("added just now");
    // Numbers of yarns begin at 0.
    added.yarn = u32::MAX - number;
    added.first = i64::from(index32(run.start));
    added
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_segment_of_a_thread_is_seen_or_beside_what_is_seen() {
        for points in 0..9 {
            let ranges =
                (0..points).flat_map(|start| (start + 1..=points).map(move |end| start..end));
            for seen in ranges.map(Some).chain([None]) {
                let own = seen.clone().unwrap_or(0..0);
                let runs = beside(seen.as_ref(), points).chain([own]);
                let mut segments: Vec<usize> = runs
                    .flat_map(|run| run.start..run.end.saturating_sub(1).max(run.start))
                    .collect();
                segments.sort_unstable();
                assert!(segments.into_iter().eq(0..usize::max(points, 1) - 1), "{points} {seen:?}");
            }
        }
    }
}

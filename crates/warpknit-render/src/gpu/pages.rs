//! Yarns in the device's memory: points in pages that fit its binding limits, divided into chunks
//! that are culled and coarsened one by one.
//!
//! In: a scene and St. Out: [`Page`]s, with 24 bytes a point on the device, or 28 where yarns are
//! flattened, and 32 bytes a chunk of up to [`CHUNK`] pieces on the host. Strands are subdivided
//! a window at a time, so the memory beside the pages does not grow with the fabric. All passes
//! share a page's bind group.

use std::array::from_fn;

use bytemuck::bytes_of;
use glam::{DVec3, Vec3, Vec4};
use rayon::prelude::*;
use wgpu::BufferUsages;

use super::data::{self, CHUNK, KNOTS, PARTS};
use super::device::Gpu;
use crate::GpuError;
use crate::octahedral::PackedUnit;
use crate::oval::{Oval, PackedOval};
use crate::paths::{PLAIN_SHADE, Subdivision, YarnPaths};
use crate::scene::{Scene, YarnLook};
use warpknit_core::ids::index32;

/// Strands that a task subdivides at a time.
const CUT_STRANDS: usize = 16;
/// Limit of a page's points: 64 MiB, which every device can bind and allocate.
const PAGE_POINTS: usize = 4 << 20;
/// Share of a yarn's length that its steps keep. Longer steps cut off whole loops, and the cloth would
/// be half as dense from afar. The shader widens yarns by what is lost.
const KEPT_LENGTH: f32 = 0.95;

/// Properties of a chunk that the host needs for culling and level of detail.
#[derive(Clone, Copy, Debug)]
pub(super) struct ChunkBounds {
    /// Bounding ball, including the yarn's radius.
    pub(super) centre: Vec3,
    pub(super) reach: f32,
    /// Mean length of its pieces, mm.
    pub(super) piece: f32,
    pub(super) pieces: u32,
    pub(super) look: u16,
    /// Longest step that keeps the yarn's windings, points: a power of two.
    pub(super) most_stride: u16,
}

/// Points that one bind group holds.
#[derive(Debug)]
pub(super) struct Page {
    pub(super) chunk_bounds: Vec<ChunkBounds>,
    pub(super) points: wgpu::Buffer,
    pub(super) tangent_frames: wgpu::Buffer,
    /// Sections of flattened yarns, or a single one that stands for round ones.
    pub(super) ovals: wgpu::Buffer,
    pub(super) chunks: wgpu::Buffer,
}

/// A page that is being filled.
#[derive(Default)]
struct Draft {
    points: Vec<[f32; 4]>,
    tangent_frames: Vec<[PackedUnit; 2]>,
    ovals: Vec<PackedOval>,
    chunks: Vec<data::Chunk>,
    chunk_bounds: Vec<ChunkBounds>,
}

/// A factor on a radius or a colour as a byte of [`data::Chunk`].
fn uneven_byte(factor: f32) -> u8 {
    let share = ((factor - 1.0) / data::MOST_UNEVEN).clamp(-1.0, 1.0);
    #[expect(clippy::cast_possible_truncation, reason = "between -127 and 127")]
    let byte = (127.0 * share).round() as i8;
    byte.to_le_bytes()[0]
}

/// A chunk's [`data::Chunk::thickness`], from its points, their sections and the even radius.
fn thickness(points: &[Vec4], ovals: &[PackedOval], even: f32) -> [u32; 2] {
    let (last, steps) = (points.len() - 1, KNOTS as usize - 1);
    let own = |at: usize| points[at].w / oval(ovals, at).height();
    let radius = |at: usize| match own(at) {
        // A strand's last radius is 0, since no piece starts there.
        radius if radius > 0.0 => radius,
        _ => own(at.saturating_sub(1)),
    };
    let byte = |knot: usize| {
        let (low, rest) = (knot * last / steps, knot * last % steps);
        #[expect(clippy::cast_precision_loss, reason = "less than KNOTS")]
        let share = rest as f32 / steps as f32;
        let [from, to] = [low, last.min(low + 1)].map(radius);
        uneven_byte((from + (to - from) * share) / even)
    };
    [0, 4].map(|first| u32::from_le_bytes(from_fn(|at| byte(first + at))))
}

/// The section at a point of a chunk, of which ovals are known or none.
fn oval(ovals: &[PackedOval], at: usize) -> Oval {
    ovals.get(at).map_or(Oval::ROUND, |oval| oval.unpack())
}

/// The longest step, a power of two, with which the chords between a chunk's points are together at
/// least so long.
fn most_stride(points: &[Vec4], least: f32) -> u16 {
    let chords = |stride: usize| {
        let (last, ends) = (points.len() - 1, points.iter().step_by(stride));
        let chords = ends.clone().zip(ends.skip(1).chain([&points[last]]));
        chords.map(|(from, to)| from.truncate().distance(to.truncate())).sum::<f32>()
    };
    let strides = (1..).map(|power| 1_u16 << power);
    let kept = strides
        .take_while(|stride| u32::from(*stride) <= PARTS && chords(usize::from(*stride)) >= least);
    kept.last().unwrap_or(1)
}

/// Uploads all strands of `scene` with `st` pieces a stitch, relative to `centre`.
pub(super) fn upload(
    gpu: &Gpu,
    scene: &Scene,
    centre: DVec3,
    st: u32,
) -> Result<Vec<Page>, GpuError> {
    let limits = gpu.device.limits();
    let largest =
        usize::try_from(limits.max_storage_buffer_binding_size.min(limits.max_buffer_size))
            .unwrap_or(usize::MAX);
    let room = (largest / size_of::<[f32; 4]>()).min(PAGE_POINTS);
    // Enough strands for all threads, but not the whole fabric.
    let window = CUT_STRANDS * 4 * rayon::current_num_threads();
    let (mut pages, mut draft) = (Vec::new(), Draft::default());
    for first in (0..scene.strands.len()).step_by(window) {
        let end = scene.strands.len().min(first + window);
        let starts = (first..end).into_par_iter().step_by(CUT_STRANDS);
        let parts: Vec<YarnPaths> = starts
            .map(|start| {
                let strands = start..end.min(start + CUT_STRANDS);
                YarnPaths::new(scene, strands, centre, Subdivision::Stitch(st))
            })
            .collect();
        for paths in &parts {
            for (start, pieces) in runs(paths) {
                // A chunk lies on one page only.
                if draft.points.len() + pieces as usize >= room {
                    pages.push(std::mem::take(&mut draft).finish(gpu)?);
                }
                draft.push(&scene.looks, paths, start, pieces);
            }
        }
    }
    if !draft.chunks.is_empty() {
        pages.push(draft.finish(gpu)?);
    }
    Ok(pages)
}

/// First point and number of pieces of each chunk.
fn runs(paths: &YarnPaths) -> Vec<(usize, u32)> {
    let mut runs = Vec::new();
    let mut start = 0;
    for (at, point) in paths.points.iter().enumerate() {
        let pieces = index32(at - start);
        // The last point of a strand ends a chunk, and so does a full chunk.
        if point.w <= 0.0 {
            if pieces > 0 {
                runs.push((start, pieces));
            }
            start = at + 1;
        } else if pieces == CHUNK {
            runs.push((start, pieces));
            start = at;
        }
    }
    runs
}

impl Draft {
    /// Adds a chunk. Consecutive chunks share a point, and each stores it.
    fn push(&mut self, looks: &[YarnLook], paths: &YarnPaths, start: usize, pieces: u32) {
        let range = start..=start + pieces as usize;
        let first = index32(self.points.len());
        let (points, along) = (&paths.points[range.clone()], &paths.along[range.clone()]);
        let ovals = paths.ovals.get(range.clone()).unwrap_or_default();
        self.ovals.extend_from_slice(ovals);
        self.points.extend(
            points.iter().zip(along).map(|(point, &along)| [point.x, point.y, point.z, along]),
        );
        let tangent_frames = paths.tangents[range.clone()].iter().zip(&paths.across[range]);
        self.tangent_frames.extend(tangent_frames.map(|(&tangent, &across)| [tangent, across]));
        let look = paths.looks[start];
        self.chunks.push(data::Chunk {
            first,
            count: pieces,
            look: u32::from(look),
            lightness: uneven_byte(f32::from(paths.shades[start]) / f32::from(PLAIN_SHADE)).into(),
            thickness: thickness(points, ovals, looks[usize::from(look)].radius),
        });
        // The ball around the bounding box: looser than the smallest ball, but computed in one
        // pass.
        let low = points.iter().fold(Vec3::INFINITY, |low, point| low.min(point.truncate()));
        let high = points.iter().fold(Vec3::NEG_INFINITY, |high, point| high.max(point.truncate()));
        let reaches =
            (0..).zip(points).map(|(at, point)| point.w * oval(ovals, at).reaches().max_element());
        let thickest = reaches.fold(0.0, f32::max);
        let length = points
            .windows(2)
            .map(|ends| ends[0].truncate().distance(ends[1].truncate()))
            .sum::<f32>();
        #[expect(clippy::cast_precision_loss, reason = "256 at most")]
        let piece = length / pieces as f32;
        let (centre, reach) = (low.midpoint(high), low.distance(high) / 2.0 + thickest);
        let most_stride = most_stride(points, KEPT_LENGTH * length);
        self.chunk_bounds.push(ChunkBounds { centre, reach, piece, pieces, look, most_stride });
    }

    /// Uploads the page.
    fn finish(self, gpu: &Gpu) -> Result<Page, GpuError> {
        let usage = BufferUsages::STORAGE;
        let page = Page {
            points: gpu.store("points", bytemuck::cast_slice(&self.points), usage),
            tangent_frames: gpu.store(
                "tangent_frames",
                bytemuck::cast_slice(&self.tangent_frames),
                usage,
            ),
            // Every binding needs a resource.
            ovals: match &self.ovals[..] {
                [] => gpu.store("ovals", bytes_of(&Oval::ROUND.pack()), usage),
                ovals => gpu.store("ovals", bytemuck::cast_slice(ovals), usage),
            },
            chunks: gpu.store("chunks", bytemuck::cast_slice(&self.chunks), usage),
            chunk_bounds: self.chunk_bounds,
        };
        // wgpu stages copies in memory of its own. Waiting for them frees it before the next page.
        gpu.queue.submit([]);
        gpu.wait()?;
        Ok(page)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_skip_straight_yarn_and_no_windings() {
        let yarn = |wave: f32| -> Vec<Vec4> {
            (0_u8..65)
                .map(|at| Vec4::new(f32::from(at), wave * f32::from(at % 2), 0.0, 0.1))
                .collect()
        };
        let length = |points: &[Vec4]| -> f32 {
            points.windows(2).map(|ends| ends[0].distance(ends[1])).sum()
        };
        for (wave, expected) in [(0.0, 32), (0.2, 32), (1.0, 1)] {
            let points = yarn(wave);
            assert_eq!(most_stride(&points, KEPT_LENGTH * length(&points)), expected, "{wave}");
        }
        assert_eq!(most_stride(&yarn(0.0)[..2], 0.95), 32);
    }
}

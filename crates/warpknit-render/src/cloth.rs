//! Blocks of yarn as a scene for a renderer.
//!
//! In: a [`Fabric`] and [`Block`]s. Out: a [`Scene`] with one look for each bar. Points keep their
//! order in strands and lose their tags. Nothing is drawn here. Cost: linear in the points.

use std::ops::Range;

use glam::DVec2;

use crate::scene::{Scene, ScenePoint, SceneStrand, YarnLook};
use warpknit_core::drape::seen::{LEAD_POINTS, Seen, Stretches};
use warpknit_core::drape::strands::Strand;
use warpknit_core::drape::{Block, Cloth, DrapeOptions, run, swatch_panel};
use warpknit_core::fabric::Fabric;
use warpknit_core::fabric::yarn::Yarn;
use warpknit_core::ids::index32;
use warpknit_core::map::Mapping;

/// Roughness of yarns in pictures and in files, 0 to 1. Most textile fibres are dull.
pub const ROUGHNESS: f32 = 0.75;

/// One look for each bar. `radius` is that of the thickest bar, mm.
#[must_use]
pub fn looks(fabric: &Fabric, radius: f64) -> Vec<YarnLook> {
    let yarns = fabric.yarns().zip(fabric.thickness());
    yarns.map(|(yarn, thickness)| yarn_look(yarn, radius * thickness)).collect()
}

/// The look of a yarn that is drawn with `radius` mm.
fn yarn_look(yarn: &Yarn, radius: f64) -> YarnLook {
    #[expect(clippy::cast_possible_truncation, reason = "a radius in mm, and a number about 1")]
    let [radius, sheen] = [radius, yarn.sheen.unwrap_or(0.0)].map(|number| number as f32);
    #[expect(clippy::cast_possible_truncation, reason = "a slope about 1")]
    let twist_slope = yarn.twist_slope().map(|slope| slope as f32);
    let look = YarnLook::plain(yarn.color.linear().into(), ROUGHNESS, radius);
    YarnLook { plies: yarn.plies.unwrap_or(1), twist_slope, sheen, ..look }
}

/// Width and height of a fabric's repeat, mm.
pub(crate) fn repeat_size(fabric: &Fabric) -> DVec2 {
    let count = |count: usize| f64::from(index32(count));
    DVec2::new(count(fabric.threading_repeat()), count(fabric.repeat()))
        * DVec2::new(fabric.wale_spacing(), fabric.course_spacing())
}

/// Appends a block's strands to a scene that has its fabric's [`looks`].
///
/// # Panics
/// If the block's bar is number 65 536 or above. Fabrics have at most a hundred bars.
pub fn add_to(scene: &mut Scene, block: &Block) {
    for strand in &block.strands.strands {
        add_run(scene, block, strand, 0..strand.points.len());
    }
}

/// Appends what pictures need of a block's strands. With [`Stretches::FromStart`], a strand that is
/// seen goes into the scene from its first point on, and what is not seen of it is its lead.
///
/// # Panics
/// As [`add_to`].
pub fn add_seen(scene: &mut Scene, block: &Block, seen: &Seen, stretches: Stretches) {
    for strand in &block.strands.strands {
        let runs = seen.runs(block.panel, &block.strands.flat[strand.range()]);
        let mut lead_end = None;
        for (run, is_seen) in runs {
            if !is_seen {
                add_run(scene, block, strand, run).is_shadow = true;
                continue;
            }
            if stretches == Stretches::AsSeen {
                let start = run.start.saturating_sub(LEAD_POINTS);
                let lead = index32(run.start - start);
                add_run(scene, block, strand, start..run.end).lead = lead;
                continue;
            }
            // Of several runs in view, the first one's lead and the last one's end count.
            let (lead, end) = lead_end.get_or_insert((run.start, run.end));
            *lead = run.start.min(*lead);
            *end = run.end;
        }
        if let Some((lead, end)) = lead_end {
            add_run(scene, block, strand, 0..end).lead = index32(lead);
        }
    }
}

/// Appends some of a strand's points, counted from its first, as a strand of the scene.
fn add_run<'a>(
    scene: &'a mut Scene,
    block: &Block,
    strand: &Strand,
    run: Range<usize>,
) -> &'a mut SceneStrand {
    let look = u16::try_from(block.bar).expect("machines have some tens of bars");
    let first = strand.points.start as usize;
    let (spread, flatten) = (scene.spread.clone(), scene.flatten(look));
    let points = (first + run.start..first + run.end).map(|point| ScenePoint {
        position: block.draped.positions[point].as_vec3(),
        normal: block.draped.normals[point].as_vec3(),
        flatten: spread.as_ref().map_or(flatten, |spread| spread.ratio(block.origin_near(point))),
    });
    // The first point of each stitch: a renderer draws the same number of segments for each.
    let pieces = block.strands.pieces_of(strand).map(|piece| piece.start);
    let within = pieces.filter(|start| run.contains(start)).map(|start| start - run.start);
    scene.push_stitches(points, within.map(index32), look);
    let added = scene.strands.last_mut().expect("added just now");
    added.yarn = strand.yarn.0;
    added.first = block.first_along(strand) + i64::from(index32(run.start));
    added
}

/// A scene of a flat swatch: `wales` yarns a bar and `courses` courses, drawn with the radius that
/// the fabric gives.
///
/// ```
/// use warpknit_core::fabric::Fabric;
/// use warpknit_render::cloth;
/// let scene = cloth::swatch(&Fabric::named("tricot")?, 4, 6);
/// assert_eq!((scene.strands.len(), scene.looks.len()), (2 * 4, 2));
/// # Ok::<(), warpknit_core::fabric::FabricError>(())
/// ```
#[must_use]
pub fn swatch(fabric: &Fabric, wales: u32, courses: u32) -> Scene {
    let panel = swatch_panel(fabric, wales, courses);
    from_cloth(&Cloth::swatch(&panel, fabric, wales, courses), fabric)
}

/// A scene of a whole cloth, drawn with the radius that the fabric gives.
#[must_use]
pub fn from_cloth(cloth: &Cloth<'_>, fabric: &Fabric) -> Scene {
    let empty = Scene { looks: looks(fabric, fabric.radius()), ..Scene::default() };
    with_cloth(cloth, empty)
}

/// Adds a whole cloth, as even as the scene is, to a scene that has a look for each of its bars. Its
/// yarns lie as flat as the cloth says, or else the scene.
#[must_use]
pub fn with_cloth(cloth: &Cloth<'_>, scene: Scene) -> Scene {
    with_mapped(cloth, scene, Mapping::default())
}

/// The same of cloth that is mapped in this way.
pub(crate) fn with_mapped(cloth: &Cloth<'_>, mut scene: Scene, mapping: Mapping) -> Scene {
    let options = DrapeOptions { evenness: scene.evenness, mapping, ..DrapeOptions::default() };
    scene.spread = cloth.spread().cloned().or(scene.spread);
    let Ok(_totals) = run(cloth, &options, &mut |_, _| {}, &mut |blocks| {
        blocks.iter().for_each(|block| add_to(&mut scene, block));
        Ok::<(), std::convert::Infallible>(())
    });
    scene
}

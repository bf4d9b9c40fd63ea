//! Blocks of yarn as a scene for a renderer.
//!
//! In: a [`Fabric`] and [`Block`]s. Out: a [`Scene`] with a look a bar. Points keep their strands
//! and lose their tags; nothing is drawn here.

use crate::scene::{Scene, YarnLook};
use warpknit_core::drape::{Block, Cloth, Options, run, swatch_panel};
use warpknit_core::fabric::Fabric;
use warpknit_core::fabric::yarn::Yarn;
use warpknit_core::ids::index32;

/// How rough yarns look, in files too; fibres are dull.
pub const ROUGHNESS: f32 = 0.75;

/// One look a bar; `radius` is the thickest one's, mm.
#[must_use]
pub fn looks(fabric: &Fabric, radius: f64) -> Vec<YarnLook> {
    let look = |(yarn, thickness): (&Yarn, f64)| {
        #[expect(clippy::cast_possible_truncation, reason = "a radius in mm, and what is about 1")]
        let [radius, sheen] =
            [radius * thickness, yarn.sheen.unwrap_or(0.0)].map(|number| number as f32);
        #[expect(clippy::cast_possible_truncation, reason = "a slope about 1")]
        let twist_slope = yarn.twist_slope().map(|slope| slope as f32);
        let look = YarnLook::plain(yarn.color.linear().into(), ROUGHNESS, radius);
        YarnLook { plies: yarn.plies.unwrap_or(look.plies), twist_slope, sheen, ..look }
    };
    fabric.yarns().zip(fabric.thickness()).map(look).collect()
}

/// Appends a block's strands to a scene that has its fabric's [`looks`].
///
/// # Panics
/// If the block is of bar 65 536 or later: fabrics have a hundred at most.
pub fn add_to(scene: &mut Scene, block: &Block) {
    let look = u16::try_from(block.bar).expect("machines have some tens of bars");
    for strand in &block.strands.strands {
        let (positions, normals) =
            (&block.draped.positions[strand.range()], &block.draped.normals[strand.range()]);
        let points = positions
            .iter()
            .zip(normals)
            .map(|(position, normal)| (position.as_vec3(), normal.as_vec3()));
        let stitches = block.strands.pieces_of(strand).map(|piece| index32(piece.start));
        scene.push_stitches(points, stitches, look);
    }
}

/// A flat piece of fabric, `wales` yarns a bar and `courses` courses, at the radius for which it is
/// laid out.
///
/// ```
/// use warpknit::{drape::picture, fabric::Fabric};
/// let scene = picture::swatch(&Fabric::named("tricot")?, 4, 6);
/// assert_eq!((scene.strands.len(), scene.looks.len()), (2 * 4, 2));
/// # Ok::<(), warpknit_core::fabric::FabricError>(())
/// ```
#[must_use]
pub fn swatch(fabric: &Fabric, wales: u32, courses: u32) -> Scene {
    let panel = swatch_panel(fabric, wales, courses);
    of(&Cloth::swatch(&panel, fabric, wales, courses), fabric)
}

/// All of a cloth, at the radius for which it is laid out.
#[must_use]
pub fn of(cloth: &Cloth<'_>, fabric: &Fabric) -> Scene {
    laid(cloth, Scene { looks: looks(fabric, fabric.radius()), ..Scene::default() })
}

/// All of a cloth in a scene that has a look for each of its bars.
#[must_use]
pub fn laid(cloth: &Cloth<'_>, mut scene: Scene) -> Scene {
    let mut deliver = |blocks: &[Block]| -> Result<(), std::convert::Infallible> {
        blocks.iter().for_each(|block| add_to(&mut scene, block));
        Ok(())
    };
    match run(cloth, &Options::default(), &mut |_, _| {}, &mut deliver) {
        Ok(_totals) => scene,
    }
}

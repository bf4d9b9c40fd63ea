//! What the stages are measured on: a panel of 600 x 800 mm draped on a folded cone, and the data points of loops that cover it.
//!
//! Where PEER_INPUTS names a folder with `mesh_*_v.bin`, `mesh_*_f.bin` and `points_*.bin`, these are read, so that other programs work on the same
//! (`benches/against_peers.sh`). Otherwise a like panel is made, and a tricot knitted on it.

use std::path::Path;

use glam::{DAffine3, DVec2, DVec3};
use warpknit::fabric::Fabric;
use warpknit::garment::{Garment, Panel, ReadOptions, read};
use warpknit::ids::FaceId;
use warpknit::knit::mesh::StructureMesh;
use warpknit::knit::{Knitted, Pattern};
use warpknit::yarn::tube::Section;

const SIZE: DVec2 = DVec2::new(600.0, 800.0);
/// Meshes by what they are called: cells across and along.
pub(crate) const MESHES: [(&str, [u32; 2]); 3] = [("2k", [27, 37]), ("20k", [87, 115]), ("200k", [274, 365])];
/// Points by what they are called: about as many stitches.
pub(crate) const POINTS: [(&str, f64); 4] = [("3500", 3500.0), ("26180", 26_180.0), ("262k", 262e3), ("1m", 1e6)];

/// Data points as files hold them, yarn after yarn.
pub(crate) struct Points {
    pub(crate) points: Vec<[f32; 3]>,
    /// Points of each yarn.
    pub(crate) yarn: usize,
    /// Points of a stitch.
    pub(crate) stitch: usize,
}

fn peer_file(name: &str) -> Option<Vec<u8>> {
    let folder = std::env::var_os("PEER_INPUTS")?;
    let path = Path::new(&folder).join(name);
    Some(std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display())))
}

fn numbers<const N: usize>(bytes: &[u8]) -> Vec<[[u8; 4]; N]> {
    bytes.as_chunks::<4>().0.as_chunks::<N>().0.to_vec()
}

/// One of [`MESHES`], as its file has it: shuffled.
pub(crate) fn panel(name: &str) -> Panel {
    let files = peer_file(&format!("mesh_{name}_v.bin")).zip(peer_file(&format!("mesh_{name}_f.bin")));
    let (uv, triangles) = match files {
        Some((vertices, faces)) => (
            numbers(&vertices).into_iter().map(|p: [_; 2]| DVec2::from(p.map(|x| f64::from(f32::from_le_bytes(x))))).collect(),
            numbers(&faces).into_iter().map(|face| face.map(u32::from_le_bytes)).collect(),
        ),
        None => grid(MESHES.iter().find(|(known, _)| *known == name).expect("one of the meshes").1),
    };
    let draped: Vec<_> = uv.iter().copied().map(drape).collect();
    let normals = uv.iter().copied().map(normal).collect();
    let faces = (0..).map(FaceId).take(triangles.len()).collect();
    Panel { uv, draped, normals, triangles, faces, flipped: Vec::new(), flat_from_panel: DAffine3::IDENTITY, mirrored: false }
}

/// One of [`POINTS`].
pub(crate) fn points(name: &str) -> Points {
    if let Some((points, size)) = peer_file(&format!("points_{name}.bin")).zip(peer_file(&format!("points_{name}.txt"))) {
        let points = numbers(&points).into_iter().map(|p| p.map(f32::from_le_bytes)).collect();
        let size = String::from_utf8(size).expect("text");
        let wales: usize = size.split_whitespace().next().and_then(|wales| wales.parse().ok()).expect("wales and courses");
        return Points { points, yarn: 8 * wales, stitch: 8 };
    }
    let stitches = POINTS.iter().find(|(known, _)| *known == name).expect("one of the sizes").1;
    knitted(&tricot_for(SIZE.x * SIZE.y, stitches))
}

/// The yarns of a fabric that lie within the panel whole.
fn knitted(fabric: &Fabric) -> Points {
    let (pattern, mesh) = (Pattern::new(fabric), StructureMesh::anchored_at(fabric, DVec2::splat(2.0) * fabric.wale_spacing()));
    let room = SIZE - 4.0 * fabric.wale_spacing();
    let mut knitted = Knitted::default();
    for bar in 0..fabric.bars.len() {
        for guide in pattern.yarns_over(bar, 0.0..room.x) {
            pattern.lay(bar, guide, pattern.steps_along(bar, 0.0..room.y), &mesh, &mut knitted);
        }
    }
    let low = DVec3::new(1.0, 1.0, -1e3);
    let high = (SIZE - 1.0).extend(1e3);
    let points: Vec<_> = knitted.points.iter().map(|p| p.clamp(low, high).as_vec3().to_array()).collect();
    // Every stitch of tricot is a loop and the two turns of its underlap.
    Points { points, yarn: 10 * pattern.steps_along(0, 0.0..room.y).count(), stitch: 10 }
}

/// Our own skirt.
pub(crate) fn skirt() -> Garment {
    let meshes = Path::new(env!("CARGO_MANIFEST_DIR")).join("meshes");
    let read = read(&meshes.join("skirt_flat.obj"), Some(&meshes.join("skirt_draped.obj")), &ReadOptions::default());
    read.expect("a shipped garment")
}

/// Its area that takes stitches, mm².
pub(crate) fn area(garment: &Garment) -> f64 {
    garment.panels.iter().map(Panel::area).sum()
}

/// Tricot at densities that give it about so many stitches on an area, mm².
pub(crate) fn tricot_for(area: f64, stitches: f64) -> Fabric {
    let fabric = Fabric::named("tricot").expect("built in");
    let times = (2.0 * area / (fabric.wale_spacing() * fabric.course_spacing()) / stitches).sqrt();
    let (wales, courses) = (fabric.wales_per_cm / times, fabric.courses_per_cm / times);
    fabric.at_densities(wales, courses).expect("positive")
}

/// St 10, Sr 5: the least of the source paper's table.
pub(crate) fn section(fabric: &Fabric) -> Section {
    Section { st: 10, sr: 5, radius: fabric.radius(), flatten: 1.0, caps: false, texture_per_mm: 1.0 }
}

/// Cells with random diagonals and moved corners, triangles and vertices in random order.
fn grid([across, along]: [u32; 2]) -> (Vec<DVec2>, Vec<[u32; 3]>) {
    let mut random = Random(7);
    let cell = SIZE / DVec2::new(f64::from(across), f64::from(along));
    let mut uv = Vec::new();
    for (y, x) in (0..=along).flat_map(|y| (0..=across).map(move |x| (y, x))) {
        let inner = |at: u32, last: u32| if at > 0 && at < last { 0.44 } else { 0.0 };
        let moved = DVec2::new(inner(x, across) * (random.unit() - 0.5), inner(y, along) * (random.unit() - 0.5));
        uv.push((DVec2::new(f64::from(x), f64::from(y)) + moved) * cell);
    }
    let corners = (0..along).flat_map(|y| (0..across).map(move |x| y * (across + 1) + x));
    let mut triangles = Vec::new();
    for a in corners {
        let [b, c, d] = [a + 1, a + across + 2, a + across + 1];
        triangles.extend(if random.unit() < 0.5 { [[a, b, d], [b, c, d]] } else { [[a, b, c], [a, c, d]] });
    }
    random.shuffle(&mut triangles);
    let mut order: Vec<u32> = (0..).take(uv.len()).collect();
    random.shuffle(&mut order);
    let mut place = vec![0; uv.len()];
    order.iter().zip(0..).for_each(|(&vertex, at)| place[vertex as usize] = at);
    triangles.iter_mut().flatten().for_each(|vertex| *vertex = place[*vertex as usize]);
    (order.into_iter().map(|vertex| uv[vertex as usize]).collect(), triangles)
}

/// A cone with folds.
fn drape(p: DVec2) -> DVec3 {
    let radius = 110.0 + 60.0 * (1.0 - p.y / SIZE.y);
    let angle = (p.x - SIZE.x / 2.0) / radius;
    let folded = radius + (4.0 + 10.0 * (1.0 - p.y / SIZE.y)) * (9.0 * angle).cos();
    DVec3::new(folded * angle.sin(), p.y, folded * angle.cos())
}

/// Its normal, by differences.
fn normal(p: DVec2) -> DVec3 {
    let along = |step: DVec2| drape(p + step) - drape(p - step);
    along(DVec2::X * 1e-3).cross(along(DVec2::Y * 1e-3)).normalize()
}

/// The same numbers in every run.
struct Random(u64);

impl Random {
    /// 0..1.
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn shuffle<T>(&mut self, items: &mut [T]) {
        for last in (1..items.len()).rev() {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below the number of items")]
            let other = (self.unit() * (last + 1) as f64) as usize;
            items.swap(last, other);
        }
    }
}

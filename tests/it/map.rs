//! Mapping: what an identity, a rigid motion, a stretch and an edge between triangles must give.

use glam::{DMat3, DQuat, DVec2, DVec3};
use warpknit::drape::{self, Cloth, DrapeOptions};
use warpknit::fabric::Fabric;
use warpknit::garment::{Garment, ReadOptions, read};
use warpknit::locate::{Locator, SurfacePoint};
use warpknit::map::{Mapping, map};
use warpknit::yarn::curve;

use crate::drape::mesh;

/// A 1 m square of 20 x 20 cells, flat, whose draped vertices `drape` moves.
pub(crate) fn garment(drape: impl Fn(DVec3) -> DVec3) -> Garment {
    let folder = tempfile::tempdir().unwrap();
    let mesh = |shape: &dyn Fn(DVec3) -> DVec3| {
        let mut text = String::new();
        for y in 0..=20 {
            for x in 0..=20 {
                let p = shape(DVec3::new(f64::from(x) * 50.0, f64::from(y) * 50.0, 0.0));
                text += &format!("v {} {} {}\n", p.x, p.y, p.z);
            }
        }
        for y in 0..20 {
            for x in 0..20 {
                let a = y * 21 + x + 1;
                text += &format!("f {a} {} {}\nf {a} {} {}\n", a + 1, a + 22, a + 22, a + 21);
            }
        }
        text
    };
    let (flat, draped) = (folder.path().join("flat.obj"), folder.path().join("draped.obj"));
    std::fs::write(&flat, mesh(&|p| p)).unwrap();
    std::fs::write(&draped, mesh(&drape)).unwrap();
    let unit = Some(warpknit::garment::Unit::Mm);
    read(&flat, Some(&draped), &ReadOptions { unit, uv_scale: Some(1.0), ..ReadOptions::default() })
        .unwrap()
}

/// Flat points of a whole knitted cloth in the flat mesh's own axes, and where they went.
fn knitted(garment: &Garment, mapping: Mapping) -> Vec<(DVec3, DVec3)> {
    let fabric = Fabric::named("locknit").unwrap().at_densities(0.6, 0.9).unwrap();
    let cloth = Cloth::cover(garment, &fabric).unwrap();
    let mut points = Vec::new();
    let deliver = &mut |blocks: &[drape::Block]| {
        for block in blocks {
            let own_axes = garment.panels[block.panel].flat_from_panel;
            let flat = block.strands.flat.iter().map(|p| own_axes.transform_point3(*p));
            points.extend(flat.zip(block.draped.positions.iter().copied()));
        }
        Ok::<_, std::io::Error>(())
    };
    drape::run(
        &cloth,
        &DrapeOptions { mapping, ..DrapeOptions::default() },
        &mut |_, _| {},
        deliver,
    )
    .unwrap();
    assert!(points.len() > 20_000);
    points
}

const ALL: [Mapping; 3] = [Mapping::Frame, Mapping::Smooth, Mapping::Relaxed];

fn assert_maps(
    drape: impl Fn(DVec3) -> DVec3,
    expected: impl Fn(DVec3) -> DVec3,
    mapping: Mapping,
    tolerance: f64,
) {
    let garment = garment(drape);
    let worst = knitted(&garment, mapping)
        .iter()
        .map(|(flat, draped)| draped.distance(expected(*flat)))
        .fold(0.0, f64::max);
    assert!(worst < tolerance, "{mapping:?}: off by {worst} mm");
}

#[test]
fn a_flat_drape_is_the_identity() {
    for mapping in ALL {
        assert_maps(|p| p, |p| p, mapping, 1e-6);
    }
}

#[test]
fn a_rigid_motion_moves_every_point_by_it() {
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.7, -1.1, 2.3);
    let motion = move |p: DVec3| turn * p + DVec3::new(300.0, -50.0, 120.0);
    for mapping in ALL {
        assert_maps(motion, motion, mapping, 1e-6);
    }
}

#[test]
fn a_stretch_in_the_plane_stretches_stitches_alike() {
    let stretch = |p: DVec3| DVec3::new(1.3 * p.x, 0.8 * p.y, p.z);
    // Smooth keeps depth in mm; frame scales it by the triangle's area.
    assert_maps(stretch, stretch, Mapping::Smooth, 1e-5);
    assert_maps(
        stretch,
        |p| DVec3::new(1.3 * p.x, 0.8 * p.y, 1.3 * 0.8 * p.z),
        Mapping::Frame,
        1e-5,
    );
}

#[test]
fn frame_is_affine_in_each_triangle() {
    let shear = DMat3::from_cols(DVec3::new(1.0, 0.2, 0.1), DVec3::new(0.3, 0.9, -0.2), DVec3::Z);
    let normal = shear.x_axis.cross(shear.y_axis);
    let expected = move |p: DVec3| shear.x_axis * p.x + shear.y_axis * p.y + normal * p.z;
    assert_maps(move |p| shear * p, expected, Mapping::Frame, 1e-5);
}

/// A cylinder of radius 300 mm, along which the cloth is wound without stretch.
fn wound(p: DVec3) -> DVec3 {
    let angle = p.x / 300.0;
    DVec3::new(300.0 * angle.sin(), p.y, 300.0 * angle.cos())
}

#[test]
fn smooth_yarns_are_continuous_across_edges() {
    let garment = garment(wound);
    let panel = &garment.panels[0];
    let mut worst = 0.0_f64;
    for (index, corners) in panel.triangles.iter().enumerate() {
        for i in 0..3 {
            let (a, b) = (corners[i], corners[(i + 1) % 3]);
            let twin = panel
                .triangles
                .iter()
                .position(|t| (0..3).any(|j| t[j] == b && t[(j + 1) % 3] == a));
            let Some(twin) = twin else { continue };
            let point = panel.uv[a as usize].lerp(panel.uv[b as usize], 0.37).extend(2.0);
            let sides = [index, twin].map(|t| {
                map(panel, &[point], &[weights(panel, t, point.truncate())], Mapping::Smooth)
                    .positions[0]
            });
            worst = worst.max(sides[0].distance(sides[1]));
        }
    }
    assert!(worst < 1e-4, "a gap of {worst} mm");
}

/// The barycentric coordinates of a point in a triangle, on its edge as well.
fn weights(panel: &warpknit::garment::Panel, triangle: usize, p: DVec2) -> SurfacePoint {
    let [a, b, c] = panel.triangles[triangle].map(|v| panel.uv[v as usize]);
    let area = (b - a).perp_dot(c - a);
    SurfacePoint {
        triangle: triangle as u32,
        b: (p - a).perp_dot(c - a) / area,
        c: (b - a).perp_dot(p - a) / area,
    }
}

#[test]
fn smooth_keeps_the_thickness_in_mm() {
    let garment = garment(wound);
    let panel = &garment.panels[0];
    let corner = panel.uv.iter().copied().fold(DVec2::INFINITY, DVec2::min);
    let flat: Vec<_> = (0..5000)
        .map(|i| (corner + DVec2::new(f64::from(i % 71), f64::from(i / 71)) * 14.0).extend(0.0))
        .collect();
    let located: Vec<_> = Locator::new(panel).locate(&flat).into_iter().flatten().collect();
    let at_depth = |z: f64| {
        let points: Vec<_> = flat.iter().map(|p| p.with_z(z)).collect();
        map(panel, &points, &located, Mapping::Smooth).positions
    };
    assert_eq!(located.len(), flat.len());
    let worst = at_depth(0.8)
        .iter()
        .zip(at_depth(-0.4))
        .map(|(p, q)| (p.distance(q) - 1.2).abs())
        .fold(0.0, f64::max);
    assert!(worst < 1e-4, "thickness off by {worst} mm");
}

/// Lengths of stitches on the body over those in the flat cloth, of the stitches that lie whole on
/// the garment, along the curves through their points.
fn length_ratios(garment: &Garment, fabric: &Fabric, mapping: Mapping) -> Vec<f64> {
    let cloth = Cloth::cover(garment, fabric).unwrap();
    let mut ratios = Vec::new();
    let deliver = &mut |blocks: &[drape::Block]| {
        for block in blocks {
            for strand in &block.strands.strands {
                let (flat, draped) =
                    (&block.strands.flat[strand.range()], &block.draped.positions[strand.range()]);
                let pieces: Vec<_> = block.strands.pieces_of(strand).collect();
                // The first and the last stitch are cut, or shaped by a cut.
                for piece in pieces.iter().skip(1).take(pieces.len().saturating_sub(2)) {
                    let length = |points: &[DVec3]| -> f64 {
                        (piece.start..piece.end - 1)
                            .map(|at| curve::span(points, at).precise_length())
                            .sum()
                    };
                    ratios.push(length(draped) / length(flat));
                }
            }
        }
        Ok::<_, std::io::Error>(())
    };
    let options = DrapeOptions { mapping, ..DrapeOptions::default() };
    drape::run(&cloth, &options, &mut |_, _| {}, deliver).unwrap();
    ratios
}

/// The share of ratios that are off by less than 2 %.
fn share_kept(ratios: &[f64]) -> f64 {
    let kept = ratios.iter().filter(|ratio| (*ratio - 1.0).abs() < 0.02).count();
    kept as f64 / ratios.len() as f64
}

#[test]
fn yarn_keeps_its_length_on_pulled_cloth() {
    for (name, pulled) in [
        ("tricot", DVec3::new(1.15, 0.95, 1.0)),
        ("locknit", DVec3::new(1.15, 1.0, 1.0)),
        ("jersey", DVec3::new(1.15, 1.0, 1.0)),
        // Too large for a table: sweeps alone keep its lengths.
        ("cable", DVec3::new(1.1, 1.0, 1.0)),
    ] {
        let fabric = Fabric::named(name).unwrap();
        let coarse = fabric.courses_per_cm * 0.5 / fabric.wales_per_cm;
        let fabric = fabric.at_densities(0.5, coarse).unwrap();
        let garment = garment(|p| p * pulled);
        let relaxed = share_kept(&length_ratios(&garment, &fabric, Mapping::Relaxed));
        let smooth = share_kept(&length_ratios(&garment, &fabric, Mapping::Smooth));
        assert!(relaxed > 0.99 && smooth < 0.6, "{name}: {relaxed} relaxed, {smooth} smooth");
    }
}

#[test]
fn yarn_keeps_its_length_on_a_shipped_garment() {
    let garment = read(&mesh("tshirt.obj"), None, &ReadOptions::default()).unwrap();
    let fabric = Fabric::named("locknit").unwrap().at_densities(1.0, 1.5).unwrap();
    let relaxed = share_kept(&length_ratios(&garment, &fabric, Mapping::Relaxed));
    assert!(relaxed > 0.98, "{relaxed}");
}

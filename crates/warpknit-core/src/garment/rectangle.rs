//! A flat rectangle whose draped positions equal its flat ones: the panel of a swatch.

use glam::{DAffine3, DVec2, DVec3};

use super::{Garment, GarmentSummary, Panel};
use crate::ids::FaceId;

impl Garment {
    /// A rectangle of two triangles from (0, 0) to (`width`, `height`) mm, lying in z = 0 with its
    /// technical face up.
    #[must_use]
    pub fn rectangle(width: f64, height: f64) -> Self {
        let uv =
            [(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)].map(DVec2::from).to_vec();
        let panel = Panel {
            draped: uv.iter().map(|p| p.extend(0.0)).collect(),
            normals: vec![DVec3::Z; uv.len()],
            uv,
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            faces: vec![FaceId(0), FaceId(1)],
            flipped: Vec::new(),
            flat_from_panel: DAffine3::IDENTITY,
            mirrored: false,
            turned_in: None,
        };
        Self {
            panels: vec![panel],
            summary: GarmentSummary {
                triangles: 2,
                unit: "mm",
                uv_scale_mm: 1.0,
                ..GarmentSummary::default()
            },
        }
    }
}

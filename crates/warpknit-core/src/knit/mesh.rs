//! The structure mesh: the grid of wales and courses on whose vertices the stitches' control points
//! lie.
//!
//! In: a fabric and the place of its gap 0, course 0. Out: positions of control points, mm. Source:
//! Liu, Kyosev and Jiang 2022, "Yarn-level modelling and geometric simulation of warp-knitted
//! clothing elements", section 2.2 and Fig. 3. A stitch uses 2 x 2 cells, that is 3 x 3 vertices,
//! so auxiliary vertices border the pattern. The mesh is never stored: each vertex is computed from
//! its wale and course.

use glam::DVec2;

use crate::fabric::Fabric;

/// A grid of control points. Vertex (w, c) lies at `origin + (w W, c C)`; gap g of the machine at
/// `origin.x + (g - 1/2) W`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StructureMesh {
    /// Position of wale 0, course 0, mm.
    pub origin: DVec2,
    /// Wale spacing W, mm.
    pub wale_spacing: f64,
    /// Course spacing C, mm.
    pub course_spacing: f64,
}

impl StructureMesh {
    /// The mesh of a fabric with gap 0, course 0 at `corner`: half a wale to the left of the first
    /// wale.
    #[must_use]
    pub fn anchored_at(fabric: &Fabric, corner: DVec2) -> Self {
        let wale_spacing = fabric.wale_spacing();
        Self {
            origin: corner + DVec2::new(wale_spacing / 2.0, 0.0),
            wale_spacing,
            course_spacing: fabric.course_spacing(),
        }
    }

    /// The control point of a wale and course.
    #[must_use]
    pub fn vertex(&self, wale: i32, course: i32) -> DVec2 {
        self.origin
            + DVec2::new(
                f64::from(wale) * self.wale_spacing,
                f64::from(course) * self.course_spacing,
            )
    }
}

/// Counts the vertices (wales, courses) of the mesh for a pattern of n wales and m courses,
/// auxiliary ones included: (n + reach + 2) x (m + 1). The reach is the number of wales that the
/// last yarn laps past the pattern.
///
/// ```
/// use warpknit_core::{fabric::Fabric, knit::mesh};
/// // The paper's example: a 4 x 4 pattern whose longest lap reaches two wales further.
/// assert_eq!(mesh::vertices(&Fabric::named("locknit").unwrap(), 4, 4), (8, 5));
/// ```
#[must_use]
pub fn vertices(fabric: &Fabric, wales: u32, courses: u32) -> (u32, u32) {
    let reach = fabric.structure.widest_lapping().saturating_sub(1);
    (wales + reach + 2, courses + 1)
}

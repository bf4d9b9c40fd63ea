//! The draped garment as pixels, seen from two sides at right angles to the picture: a depth for
//! each sample hides what lies behind.
//!
//! In: panels, a colour for each triangle. Out: a picture, four by four samples a px of the sheet.
//! Cost: linear in triangles and in samples; a triangle smaller than the distance of samples may be
//! missed, and others stand for it.

use glam::{DVec2, DVec3, UVec2};
use image::{Rgba, RgbaImage};

use crate::fabric::yarn::Color;
use crate::garment::{Garment, Panel};

/// Samples along each side of a pixel.
const SAMPLES: u32 = 2;
/// How bright cloth is that is seen on edge.
const ON_EDGE: f64 = 0.6;
/// A garment whose front is under this part of its largest side lies down: it is looked at from
/// that side.
const THIN: f64 = 0.3;

/// From where the garment is looked at, and what of space is in the picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct GarmentView {
    /// `front`, `back` and the like.
    pub(super) name: &'static str,
    right: DVec3,
    up: DVec3,
    /// Where the eye is.
    toward: DVec3,
    /// The garment's extent along right and up, mm.
    low: DVec2,
    high: DVec2,
}

/// Front and back; for a garment that lies down, above and below; for one that is thin from the
/// front, left and right.
pub(super) fn views(garment: &Garment) -> [GarmentView; 2] {
    let points = || garment.panels.iter().flat_map(|panel| panel.draped.iter().copied());
    let (low, high) = (
        points().fold(DVec3::INFINITY, DVec3::min),
        points().fold(DVec3::NEG_INFINITY, DVec3::max),
    );
    let extent = high - low;
    let (front, above, left) = (extent.x * extent.y, extent.x * extent.z, extent.y * extent.z);
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    let sides = if front >= THIN * above.max(left) {
        [("front", x, y, z), ("back", -x, y, -z)]
    } else if above >= left {
        [("above", x, -z, y), ("below", x, z, -y)]
    } else {
        [("left", z, y, -x), ("right", -z, y, x)]
    };
    sides.map(|(name, right, up, toward)| {
        let extent = |axis: DVec3| {
            let ends = [axis.dot(low), axis.dot(high)];
            (ends[0].min(ends[1]), ends[0].max(ends[1]))
        };
        let ((left, right_end), (bottom, top)) = (extent(right), extent(up));
        GarmentView {
            name,
            right,
            up,
            toward,
            low: DVec2::new(left, bottom),
            high: DVec2::new(right_end, top),
        }
    })
}

impl GarmentView {
    /// Height over width of what is in the picture.
    pub(super) fn aspect(&self) -> f64 {
        let extent = self.high - self.low;
        if extent.x > 0.0 { extent.y / extent.x } else { 1.0 }
    }

    /// The garment in the middle of a picture of this size: usable triangles in their colour,
    /// flipped ones as `defect`.
    pub(super) fn paint(
        &self,
        garment: &Garment,
        size: UVec2,
        color: &dyn Fn(&Panel, [u32; 3]) -> Color,
        defect: Color,
    ) -> RgbaImage {
        let samples = size * SAMPLES;
        let mut buffer = DepthBuffer {
            size: samples,
            depths: vec![f32::NEG_INFINITY; (samples.x * samples.y) as usize],
            colors: vec![[0; 3]; (samples.x * samples.y) as usize],
        };
        let (extent, room) = (self.high - self.low, samples.as_dvec2() - 2.0);
        let scale = (room / extent.max(DVec2::splat(f64::MIN_POSITIVE))).min_element();
        let middle = (self.low + self.high) / 2.0;
        let place = |p: DVec3| {
            let seen = (DVec2::new(self.right.dot(p), self.up.dot(p)) - middle) * scale;
            (DVec2::new(seen.x, -seen.y) + samples.as_dvec2() / 2.0)
                .extend(self.toward.dot(p) * scale)
        };
        for panel in &garment.panels {
            let usable = panel.triangles.iter().map(|&corners| (corners, color(panel, corners)));
            for (corners, color) in
                usable.chain(panel.flipped.iter().map(|&corners| (corners, defect)))
            {
                let draped = corners.map(|vertex| panel.draped[vertex as usize]);
                let normal =
                    (draped[1] - draped[0]).cross(draped[2] - draped[0]).normalize_or_zero();
                let light = ON_EDGE + (1.0 - ON_EDGE) * normal.dot(self.toward).abs();
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "a darker byte is a byte"
                )]
                let shade = color.0.map(|byte| (f64::from(byte) * light).round() as u8);
                buffer.fill(draped.map(place), shade);
            }
        }
        buffer.downsampled(size)
    }
}

/// Samples of a picture, each with the nearest thing seen there.
struct DepthBuffer {
    size: UVec2,
    /// Larger is nearer.
    depths: Vec<f32>,
    colors: Vec<[u8; 3]>,
}

impl DepthBuffer {
    /// Covers the samples in a triangle, edges included, where it is nearer than what is there.
    fn fill(&mut self, [a, b, c]: [DVec3; 3], color: [u8; 3]) {
        let area = (b - a).truncate().perp_dot((c - a).truncate());
        if area == 0.0 {
            return;
        }
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        // Sample (x, y) lies at (x + .5, y + .5).
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "`as` saturates, and the picture ends it"
        )]
        let range = |low: f64, high: f64, end: u32| {
            ((low - 0.5).ceil().max(0.0) as u32)..((high + 0.5).floor() as u32).min(end)
        };
        for y in range(low.y, high.y, self.size.y) {
            for x in range(low.x, high.x, self.size.x) {
                let p = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
                let weight = |from: DVec3, to: DVec3| {
                    (to.truncate() - from.truncate()).perp_dot(p - from.truncate()) / area
                };
                let (of_c, of_a, of_b) = (weight(a, b), weight(b, c), weight(c, a));
                if of_a < 0.0 || of_b < 0.0 || of_c < 0.0 {
                    continue;
                }
                #[expect(
                    clippy::cast_possible_truncation,
                    reason = "a depth in samples needs no more"
                )]
                let depth = (of_a * a.z + of_b * b.z + of_c * c.z) as f32;
                let at = (y * self.size.x + x) as usize;
                if depth > self.depths[at] {
                    self.depths[at] = depth;
                    self.colors[at] = color;
                }
            }
        }
    }

    /// Means over each pixel's samples.
    fn downsampled(&self, size: UVec2) -> RgbaImage {
        RgbaImage::from_fn(size.x, size.y, |x, y| {
            let (mut sum, mut covered) = ([0_u32; 3], 0_u32);
            for sample in 0..SAMPLES * SAMPLES {
                let (x, y) = (x * SAMPLES + sample % SAMPLES, y * SAMPLES + sample / SAMPLES);
                let at = (y * self.size.x + x) as usize;
                if self.depths[at] > f32::NEG_INFINITY {
                    covered += 1;
                    sum.iter_mut()
                        .zip(self.colors[at])
                        .for_each(|(sum, byte)| *sum += u32::from(byte));
                }
            }
            let byte = |sum: u32, count: u32| {
                u8::try_from((sum + count / 2) / count.max(1)).expect("a mean of bytes is a byte")
            };
            let [r, g, b] = sum.map(|sum| byte(sum, covered));
            Rgba([r, g, b, byte(covered * 255, SAMPLES * SAMPLES)])
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RED: Color = Color([255, 0, 0]);
    const BLUE: Color = Color([0, 0, 255]);

    /// A square of side 10 at z = 0 and a smaller one before it, at z = 5, over its right half.
    fn two_squares() -> Garment {
        let mut garment = Garment::rectangle(10.0, 10.0);
        let mut small = Garment::rectangle(5.0, 10.0).panels.remove(0);
        small.draped.iter_mut().for_each(|p| *p += DVec3::new(5.0, 0.0, 5.0));
        garment.panels.push(small);
        garment
    }

    #[test]
    fn what_is_before_hides_what_is_behind() {
        let garment = two_squares();
        let [front, back] = views(&garment);
        assert_eq!((front.name, back.name, front.aspect()), ("front", "back", 1.0));
        let color = |panel: &Panel, _: [u32; 3]| if panel.size().x > 6.0 { RED } else { BLUE };
        let at = |view: &GarmentView, x| {
            view.paint(&garment, UVec2::splat(40), &color, RED).get_pixel(x, 20).0
        };
        assert_eq!([at(&front, 10), at(&front, 30)], [[255, 0, 0, 255], [0, 0, 255, 255]]);
        assert_eq!([at(&back, 10), at(&back, 30)], [[255, 0, 0, 255]; 2]);
        let wide = front.paint(&garment, UVec2::new(60, 40), &color, RED);
        assert_eq!(
            [8, 12, 48, 52].map(|x| wide.get_pixel(x, 20).0[3]),
            [0, 255, 255, 0],
            "in the middle of the picture"
        );
    }

    #[test]
    fn what_lies_down_is_seen_from_above() {
        let mut garment = two_squares();
        garment
            .panels
            .iter_mut()
            .flat_map(|panel| &mut panel.draped)
            .for_each(|p| *p = DVec3::new(p.x, p.z / 9.0, -p.y));
        let [above, below] = views(&garment);
        assert_eq!((above.name, below.name), ("above", "below"));
        let color = |panel: &Panel, _: [u32; 3]| if panel.size().x > 6.0 { RED } else { BLUE };
        let at = |view: &GarmentView, x| {
            view.paint(&garment, UVec2::splat(40), &color, RED).get_pixel(x, 20).0
        };
        assert_eq!([at(&above, 30), at(&below, 30)], [[0, 0, 255, 255], [255, 0, 0, 255]]);
        garment
            .panels
            .iter_mut()
            .flat_map(|panel| &mut panel.draped)
            .for_each(|p| *p = DVec3::new(p.y, p.x, p.z));
        assert_eq!(views(&garment)[0].name, "left");
    }

    #[test]
    fn flipped_triangles_stand_out_and_edges_are_darker() {
        let mut garment = Garment::rectangle(10.0, 10.0);
        let flipped = garment.panels[0].triangles.pop().unwrap();
        garment.panels[0].flipped.push(flipped);
        let [front, _] = views(&garment);
        let picture = front.paint(&garment, UVec2::splat(40), &|_, _| RED, BLUE);
        assert_eq!(
            [picture.get_pixel(30, 30).0, picture.get_pixel(10, 10).0],
            [[255, 0, 0, 255], [0, 0, 255, 255]]
        );
        garment.panels[0].draped.iter_mut().for_each(|p| p.z = p.x);
        let picture = front.paint(&garment, UVec2::splat(40), &|_, _| RED, BLUE);
        let expected = 255.0 * (ON_EDGE + (1.0 - ON_EDGE) / 2.0_f64.sqrt());
        assert!((f64::from(picture.get_pixel(30, 30).0[0]) - expected).abs() <= 1.0);
    }
}

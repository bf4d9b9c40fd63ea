//! Orthographic pictures of the draped garment from two opposite sides.
//!
//! In: panels, and a colour for each triangle. Out: a picture with 4 x 4 samples to a px of the
//! sheet. Method: a z-buffer (Catmull 1974, "A subdivision algorithm for computer display of curved
//! surfaces") with edge functions (Pineda 1988, "A parallel algorithm for polygon rasterization"),
//! and a box filter over each pixel's samples.
//!
//! Cost: linear in triangles and in samples. Not promised: a triangle smaller than the distance of
//! samples may be missed; its neighbours cover the place.

use glam::{DVec2, DVec3, UVec2};
use image::{Rgba, RgbaImage};

use warpknit_core::fabric::yarn::Color;
use warpknit_core::garment::Garment;

/// Samples along each side of a pixel.
const SAMPLES: u32 = 2;
/// Brightness of cloth that is seen on edge. With less, the stretch colours of side parts could not
/// be compared with the legend; with more, folds would not show.
const ON_EDGE: f64 = 0.6;
/// A garment whose bounding box shows less than this share of its largest face from the front lies
/// down, or stands sideways. It is then shown from the side of that face.
const THIN: f64 = 0.3;

/// An orthographic view of the garment.
#[derive(Clone, Copy, Debug)]
pub(super) struct GarmentView {
    /// `front`, `back` and the like.
    pub(super) name: &'static str,
    /// The picture's x axis in space.
    right: DVec3,
    /// The picture's y axis in space, upward.
    up: DVec3,
    /// The direction toward the eye.
    toward: DVec3,
    /// Lower corner of the garment's bounding rectangle along right and up, mm.
    low: DVec2,
    /// Upper corner of it, mm.
    high: DVec2,
}

/// The two views of a garment: front and back, or above and below if it lies down, or left and
/// right if it is thin from the front.
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
        // The axes are coordinate axes or their opposites, so two corners of the bounding box give
        // the extent.
        let [(left, right_end), (bottom, top)] = [right, up].map(|axis| {
            let ends = [axis.dot(low), axis.dot(high)];
            (ends[0].min(ends[1]), ends[0].max(ends[1]))
        });
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
    /// Height over width of the garment in this view.
    pub(super) fn aspect(&self) -> f64 {
        let extent = self.high - self.low;
        if extent.x > 0.0 { extent.y / extent.x } else { 1.0 }
    }

    /// Draws the garment in the middle of a picture of this size: usable triangles in the colour that
    /// `color` gives for a panel and a triangle of it, flipped ones in the colour `defect`.
    pub(super) fn paint(
        &self,
        garment: &Garment,
        size: UVec2,
        color: &dyn Fn(usize, usize) -> Color,
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
        // x right, y down, z toward the eye, all in samples.
        let place = |p: DVec3| {
            let seen = (DVec2::new(self.right.dot(p), self.up.dot(p)) - middle) * scale;
            (DVec2::new(seen.x, -seen.y) + samples.as_dvec2() / 2.0)
                .extend(self.toward.dot(p) * scale)
        };
        for (number, panel) in garment.panels.iter().enumerate() {
            let usable = panel.triangles.iter().enumerate();
            let usable = usable.map(|(triangle, &corners)| (corners, color(number, triangle)));
            let flipped = panel.flipped.iter().map(|&corners| (corners, defect));
            for (corners, color) in usable.chain(flipped) {
                let draped = corners.map(|vertex| panel.draped[vertex as usize]);
                let normal =
                    (draped[1] - draped[0]).cross(draped[2] - draped[0]).normalize_or_zero();
                // Lambert's cosine with a lamp at the eye, on both sides of the cloth, over a base.
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

/// The samples of a picture, each with the depth and colour of the nearest triangle so far.
struct DepthBuffer {
    size: UVec2,
    /// Larger is nearer.
    depths: Vec<f32>,
    colors: Vec<[u8; 3]>,
}

impl DepthBuffer {
    /// Draws a triangle, edges included, wherever it is nearer than what is there. Drawing edges
    /// twice does no harm, since the first of two equal depths stays.
    fn fill(&mut self, [a, b, c]: [DVec3; 3], color: [u8; 3]) {
        let area = (b - a).truncate().perp_dot((c - a).truncate());
        if area == 0.0 {
            return;
        }
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        // Sample (x, y) lies at (x + 0.5, y + 0.5): the first and last that the bounding box holds.
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
                // Barycentric coordinates from the edge functions. Dividing by the signed area
                // makes them positive inside for either orientation.
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

    /// The picture: means over each pixel's samples. The share of covered samples is the alpha.
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
            let [r, g, b] = sum.map(|sum| mean_byte(sum, covered));
            Rgba([r, g, b, mean_byte(covered * 255, SAMPLES * SAMPLES)])
        })
    }
}

/// The mean of so many bytes, rounded; 0 of none.
fn mean_byte(sum: u32, count: u32) -> u8 {
    u8::try_from((sum + count / 2) / count.max(1)).expect("a mean of bytes is a byte")
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
        let color = |panel: usize, _| if garment.panels[panel].size().x > 6.0 { RED } else { BLUE };
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
        let color = |panel: usize, _| if garment.panels[panel].size().x > 6.0 { RED } else { BLUE };
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

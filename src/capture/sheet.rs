//! `grid3x3.png`: the mean cell nine times, with the segments of the middle one and of its neighbours drawn over it.

use glam::DVec2;
use image::{Rgba, RgbaImage};
use tiny_skia::{Color, Paint, PathBuilder, Pixmap, Stroke, Transform};

use super::cell::Cell;
use super::layout::Layout;
use crate::plane::{Plane, byte, side};

/// Pixels of the longer vector in the picture.
const CELL: f64 = 240.0;
/// Colours of segments, in turn: told apart by those who don't tell red from green as well (Okabe and Ito 2008).
const COLORS: [[u8; 3]; 6] = [[213, 94, 0], [0, 114, 178], [240, 228, 66], [0, 158, 115], [204, 121, 167], [86, 180, 233]];

/// A plane's values, darkest to lightest, as greys.
pub(super) fn grey(plane: &Plane) -> RgbaImage {
    let (low, high) =
        plane.values.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), value| (low.min(*value), high.max(*value)));
    let scale = 255.0 / (high - low).max(f32::MIN_POSITIVE);
    RgbaImage::from_fn(side(plane.width), side(plane.height), |x, y| {
        let grey = byte((plane.at(x as usize, y as usize) - low) * scale);
        Rgba([grey, grey, grey, u8::MAX])
    })
}

/// Draws the grid; segments are in the cell's own pixels.
pub(super) fn grid(cell: &Cell, layout: &Layout) -> RgbaImage {
    let scale = CELL / cell.lattice.longer();
    let (plane, corner) = cell.grid(scale);
    let picture = grey(&plane);
    let (width, height) = picture.dimensions();
    let mut canvas = Pixmap::new(width, height).expect("a picture has pixels");
    // No pixel is transparent, so that colours with and without their alpha are the same.
    canvas.data_mut().copy_from_slice(picture.as_raw());
    let stroke = Stroke { width: 2.0, ..Stroke::default() };
    for (segment, [red, green, blue]) in layout.seen.iter().zip(COLORS.into_iter().cycle()) {
        let mut paint = Paint::default();
        paint.set_color(Color::from_rgba8(red, green, blue, u8::MAX));
        for copy in 0..9_u8 {
            let centre = segment.centre + cell.lattice.a * f64::from(copy % 3) + cell.lattice.b * f64::from(copy / 3);
            let way = DVec2::from_angle(segment.angle);
            let corners = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]].map(|[u, v]| {
                ((centre + way * (u * segment.length) + way.perp() * (v * segment.width) - corner) * scale).as_vec2()
            });
            let mut path = PathBuilder::new();
            path.move_to(corners[0].x, corners[0].y);
            corners[1..].iter().for_each(|corner| path.line_to(corner.x, corner.y));
            path.close();
            if let Some(path) = path.finish() {
                canvas.stroke_path(&path, &paint, &stroke, Transform::identity(), None);
            }
        }
    }
    RgbaImage::from_raw(width, height, canvas.take()).expect("four bytes a pixel")
}

//! The drawing backend for plotters: it collects the plots' shapes in a [`Drawing`] of the library,
//! which is written as lapping diagrams are, with the same font.
//!
//! Not promised: filled shapes other than circles, and rotated text. The plots have none.

use std::convert::Infallible;

use glam::{DVec2, UVec2};
use plotters_backend::text_anchor::{HPos, VPos};
use plotters_backend::{
    BackendColor, BackendCoord, BackendStyle, BackendTextStyle, DrawingBackend, DrawingErrorKind,
};
use warpknit::chart::{Anchor, Drawing, DrawingLayer, DrawingShape, PathSegment, TextSize};
use warpknit::fabric::yarn::Color;

/// Size of axis labels in plotters, px.
pub(super) const SMALL: i32 = 10;
/// Size of the heading in plotters, px.
pub(super) const NORMAL: i32 = 12;
/// Size of plots' titles in plotters, px.
pub(super) const TITLE: i32 = 16;

/// Height of a capital letter over the size of its font.
const CAPITAL: f64 = 0.72;

/// A drawing as a plotters backend.
pub(super) struct PlotCanvas<'a> {
    drawing: &'a mut Drawing,
}

type Done = Result<(), DrawingErrorKind<Infallible>>;

impl<'a> PlotCanvas<'a> {
    pub(super) fn on(drawing: &'a mut Drawing) -> Self {
        Self { drawing }
    }

    /// Adds a shape on top. It joins the last layer where colour and kind match: a layer has one
    /// colour, and either lines or filled shapes.
    fn add(&mut self, color: BackendColor, shape: DrawingShape) -> Done {
        if color.alpha == 0.0 {
            return Ok(());
        }
        let color = on_white(color);
        let is_line = |shape: &DrawingShape| matches!(shape, DrawingShape::Path { .. });
        let layers = &mut self.drawing.layers;
        let fits = |layer: &&mut DrawingLayer| {
            layer.color == color
                && layer.shapes.iter().all(|other| is_line(other) == is_line(&shape))
        };
        match layers.last_mut().filter(fits) {
            Some(layer) => layer.shapes.push(shape),
            None => layers.push(DrawingLayer {
                name: format!("layer-{}", layers.len() + 1),
                color,
                shapes: vec![shape],
            }),
        }
        Ok(())
    }
}

impl DrawingBackend for PlotCanvas<'_> {
    type ErrorType = Infallible;

    fn get_size(&self) -> (u32, u32) {
        let UVec2 { x, y } = self.drawing.size.as_uvec2();
        (x, y)
    }

    fn ensure_prepared(&mut self) -> Done {
        Ok(())
    }

    fn present(&mut self) -> Done {
        Ok(())
    }

    fn draw_pixel(&mut self, point: BackendCoord, color: BackendColor) -> Done {
        self.add(color, DrawingShape::Dot { at: at(point), radius: 0.5 })
    }

    fn draw_line<S: BackendStyle>(
        &mut self,
        from: BackendCoord,
        to: BackendCoord,
        style: &S,
    ) -> Done {
        self.draw_path([from, to], style)
    }

    fn draw_path<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(
        &mut self,
        path: I,
        style: &S,
    ) -> Done {
        let segment = |(number, point)| {
            if number == 0 { PathSegment::Move(at(point)) } else { PathSegment::Line(at(point)) }
        };
        let segments = path.into_iter().enumerate().map(segment).collect();
        self.add(
            style.color(),
            DrawingShape::Path { segments, width: f64::from(style.stroke_width()) },
        )
    }

    fn draw_circle<S: BackendStyle>(
        &mut self,
        center: BackendCoord,
        radius: u32,
        style: &S,
        _fill: bool,
    ) -> Done {
        self.add(style.color(), DrawingShape::Dot { at: at(center), radius: f64::from(radius) })
    }

    fn draw_text<S: BackendTextStyle>(
        &mut self,
        text: &str,
        style: &S,
        point: BackendCoord,
    ) -> Done {
        let (size, pos) = (text_size(style.size()), style.anchor());
        let anchor = match pos.h_pos {
            HPos::Left => Anchor::Start,
            HPos::Center => Anchor::Middle,
            HPos::Right => Anchor::End,
        };
        // Plotters anchors the box of the text; the drawing wants its baseline.
        let above = match pos.v_pos {
            VPos::Top => 1.0,
            VPos::Center => 0.5,
            VPos::Bottom => 0.0,
        };
        let baseline = at(point) + DVec2::new(0.0, above * CAPITAL * size.px());
        self.add(
            style.color(),
            DrawingShape::Text { at: baseline, text: text.to_owned(), size, anchor },
        )
    }

    fn estimate_text_size<S: BackendTextStyle>(
        &self,
        text: &str,
        style: &S,
    ) -> Result<(u32, u32), DrawingErrorKind<Infallible>> {
        let size = text_size(style.size());
        let UVec2 { x, y } = DVec2::new(size.width(text), CAPITAL * size.px()).ceil().as_uvec2();
        Ok((x, y))
    }
}

/// A place on the sheet.
fn at((x, y): BackendCoord) -> DVec2 {
    DVec2::new(f64::from(x), f64::from(y))
}

/// The size of the bitmap font that stands for a size in plotters.
fn text_size(px: f64) -> TextSize {
    match px {
        px if px <= f64::from(SMALL) => TextSize::Small,
        px if px <= f64::from(NORMAL) => TextSize::Normal,
        _ => TextSize::Title,
    }
}

/// The opaque colour that looks the same on the white sheet. Shapes have no alpha.
fn on_white(color: BackendColor) -> Color {
    let (r, g, b) = color.rgb;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a mean of two bytes is a byte"
    )]
    let mixed =
        |byte: u8| (f64::from(byte) * color.alpha + 255.0 * (1.0 - color.alpha)).round() as u8;
    Color([r, g, b].map(mixed))
}

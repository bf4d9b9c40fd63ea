//! One repeat of a knit as a photo would show it: a height field with its shading.
//!
//! In: a relaxed [`Pattern`] and the face that is seen. Out: a [`Sketch`], channels of light that
//! tile. Any light is about a sum of them: that of an even sky and of two skies that are brighter on
//! one side, each as far as a place sees them (`sky_light`), and one that is dimmer in the depth of
//! the cloth. Where bars behind the front one have another colour, the even sky's light on these is
//! one in place of the last, and where the ground behind the cloth is lighter than it, the ground's
//! own light is. So a photo's light is fitted, not known.
//!
//! Method: orthographic projection of yarns into a height buffer of twice the resolution.
//! Cost: about 0.3 ms a course of a wale. Not promised: sharp shadows and fibres.

use std::ops::Range;

use glam::{DVec2, DVec3};

use super::Face;
use super::sky_light::{SkyLight, sky_light};
use crate::plane::{Plane, double, narrow, percentile, whole};
use warpknit_core::fabric::Fabric;
use warpknit_core::ids::index32;
use warpknit_core::knit::mesh::StructureMesh;
use warpknit_core::knit::spread::Spread;
use warpknit_core::knit::{Knitted, Pattern};
use warpknit_core::yarn::curve;

/// Pixels of a sketch to a wale and to a course. Yarns are some three pixels wide then, about as in
/// a photo of 300 pixels. At half of that underlaps over two and over three needles look alike.
pub(super) const WALE: usize = 16;
pub(super) const COURSE: usize = 12;
/// Pixels of the height buffer along a pixel of the sketch.
pub(super) const FINE: usize = 2;
/// Steps along and across a yarn, pixels of the height buffer. At 1 and more it shows holes.
const STEP: f64 = 0.6;
/// Depth below the highest yarns at which 1/e of the light is left, wale spacings.
const DIMMING: f64 = 0.44;
/// Share of the heights below the one that counts as the top: single bulges don't.
const TOP: f32 = 0.98;

/// Number of channels.
pub(super) const CHANNELS: usize = 4;
/// No yarn at all is seen.
pub(super) const NONE: u8 = u8::MAX;

/// What is seen between the yarns of the front bar.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Ground {
    /// Nothing, or something as dark as all that lies deep.
    #[default]
    Dark,
    /// The same, and bars that have another colour.
    Bars,
    /// Something lighter than the cloth: white paper, the lid of a scanner, a window.
    Light,
}

/// How finely a repeat is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Detail {
    /// As sketches are.
    Fine,
    /// Half as many pixels each way: enough to tell which lappings are not worth a finer look.
    Rough,
}

/// The pixels of a repeat.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Raster {
    /// Wales and courses.
    pub(super) repeat: [usize; 2],
    pub(super) detail: Detail,
}

/// The repeat of a cloth as seen from one face, y down.
#[derive(Clone, Debug)]
pub(super) struct Sketch {
    /// Wales and courses.
    pub(super) repeat: [usize; 2],
    /// Light of an even sky, from the right, from below, and that of the depth.
    pub(super) channels: [Plane; CHANNELS],
    /// The share of each pixel in which no yarn is seen.
    pub(super) ground: Plane,
    /// The light of an even sky on all yarn systems but the first.
    pub(super) behind: Plane,
    /// The same light on each yarn system alone.
    pub(super) yarns: Vec<Plane>,
}

/// How flat yarns lie: a share of the way from round ones to those that lie as flat as can be.
#[derive(Clone, Copy, Debug)]
pub(super) struct PartSpread<'a> {
    pub(super) spread: &'a Spread,
    pub(super) share: f64,
}

/// What is seen at a place of the height buffer.
#[derive(Clone, Copy)]
pub(super) struct Top {
    pub(super) height: f32,
    /// The normal's part in the picture's plane, y down.
    pub(super) lean: [f32; 2],
    /// How far down a level yarn reaches there, mm. What lies below that is open.
    pub(super) thickness: f32,
    pub(super) system: u8,
}

/// Heights of a repeat, which wraps around at its sides.
pub(super) struct HeightBuffer {
    /// Pixels across and down.
    pub(super) size: [usize; 2],
    /// Pixels a mm.
    pub(super) scale: DVec2,
    pub(super) tops: Vec<Top>,
}

impl Detail {
    /// Pixels to a wale and to a course.
    pub(super) fn pixels(self) -> [usize; 2] {
        match self {
            Self::Fine => [WALE, COURSE],
            Self::Rough => [WALE / 2, COURSE / 2],
        }
    }
}

impl Raster {
    /// The pixels of a repeat's sketch.
    pub(super) fn fine(repeat: [usize; 2]) -> Self {
        Self { repeat, detail: Detail::Fine }
    }

    /// Pixels across and down.
    pub(super) fn size(self) -> [usize; 2] {
        let [wale, course] = self.detail.pixels();
        [self.repeat[0] * wale, self.repeat[1] * course]
    }
}

impl PartSpread<'_> {
    /// Half-width over radius at a data point of the repeat.
    fn width(self, origin: u32) -> f64 {
        1.0 + self.share * (f64::from(self.spread.ratio(origin)).sqrt() - 1.0)
    }
}

impl Top {
    /// Nothing is seen.
    pub(super) const NOTHING: Self =
        Self { height: f32::NEG_INFINITY, lean: [0.0; 2], thickness: 0.0, system: NONE };

    /// The normal's part toward the camera.
    pub(super) fn up(&self) -> f32 {
        let [x, y] = self.lean;
        (1.0 - x * x - y * y).max(0.0).sqrt()
    }

    /// Light dimmed by depth, 1 for a height of `highest`. `wale` is the wale spacing.
    pub(super) fn depth_light(&self, highest: f32, wale: f64) -> f32 {
        let dimming = narrow((DIMMING * wale).recip());
        (-(highest - self.height).max(0.0) * dimming).exp()
    }
}

impl Face {
    /// A place as it is seen, y down, nearer ones higher. From the back, left is right and deep is
    /// high.
    pub(super) fn seen(self, p: DVec3) -> DVec3 {
        match self {
            Self::Front => DVec3::new(p.x, -p.y, p.z),
            Self::Back => DVec3::new(-p.x, -p.y, -p.z),
        }
    }
}

impl Sketch {
    /// The repeat as seen from a face.
    pub(super) fn new(fabric: &Fabric, pattern: &Pattern, part: PartSpread, face: Face) -> Self {
        let repeat = [fabric.threading_repeat(), fabric.repeat()];
        let mut buffer = HeightBuffer::new(fabric, repeat);
        let radius = fabric.radius();
        for (system, thickness) in fabric.thickness().into_iter().enumerate() {
            buffer.draw((fabric, pattern, part), system, radius * thickness, face);
        }
        buffer.shaded(repeat, fabric.wale_spacing(), fabric.yarn_systems())
    }

    /// Its mirror image, left for right.
    pub(super) fn mirrored(&self) -> Self {
        let width = self.channels[0].width;
        let flipped = |at: usize| at / width * width + width - 1 - at % width;
        let mirrored = |plane: &Plane, sign: f32| Plane {
            values: (0..plane.values.len()).map(|at| sign * plane.values[flipped(at)]).collect(),
            ..*plane
        };
        let [even, right, below, depth] = &self.channels;
        Self {
            repeat: self.repeat,
            channels: [
                mirrored(even, 1.0),
                mirrored(right, -1.0),
                mirrored(below, 1.0),
                mirrored(depth, 1.0),
            ],
            ground: mirrored(&self.ground, 1.0),
            behind: mirrored(&self.behind, 1.0),
            yarns: self.yarns.iter().map(|yarn| mirrored(yarn, 1.0)).collect(),
        }
    }

    /// Its channels where it lies on some ground.
    pub(super) fn on(&self, ground: Ground) -> [&Plane; CHANNELS] {
        let [even, right, below, depth] = &self.channels;
        match ground {
            Ground::Dark => [even, right, below, depth],
            Ground::Bars => [even, right, below, &self.behind],
            Ground::Light => [even, right, below, &self.ground],
        }
    }
}

impl HeightBuffer {
    /// The empty buffer of so many wales and courses of a fabric.
    pub(super) fn new(fabric: &Fabric, [wales, courses]: [usize; 2]) -> Self {
        let [width, height] = [wales * WALE * FINE, courses * COURSE * FINE];
        let spacing = DVec2::new(fabric.wale_spacing(), fabric.course_spacing());
        let cells = DVec2::new(double(WALE * FINE), double(COURSE * FINE));
        let tops = vec![Top::NOTHING; width * height];
        Self { size: [width, height], scale: cells / spacing, tops }
    }

    /// Draws all yarns of a system.
    fn draw(
        &mut self,
        (fabric, pattern, part): (&Fabric, &Pattern, PartSpread),
        system: usize,
        radius: f64,
        face: Face,
    ) {
        let mesh = StructureMesh::anchored_at(fabric, DVec2::ZERO);
        let repeat =
            [fabric.threading_repeat(), fabric.repeat()].map(|count| i64::from(index32(count)));
        let [yarns, steps] =
            if pattern.runs_across(system) { [repeat[1], repeat[0]] } else { repeat };
        let mut knitted = Knitted::default();
        for number in (0..yarns).filter(|&number| pattern.has_yarn(system, number)) {
            knitted.clear();
            // A step more at both ends shapes the first and the last span.
            pattern.lay(system, number, -1..steps + 1, &mesh, &mut knitted);
            let points: Vec<DVec3> = knitted.points.iter().map(|&point| face.seen(point)).collect();
            let name = u8::try_from(system).unwrap_or(NONE - 1);
            for at in 1..points.len().saturating_sub(2) {
                let widths = [at, at + 1].map(|point| part.width(knitted.origins[point]));
                self.draw_span(&curve::span(&points, at), radius, widths, name);
            }
        }
    }

    /// Draws a span of a yarn as a tube, whose half-width is so many radii at both ends. Its
    /// section has the area of the circle.
    pub(super) fn draw_span(
        &mut self,
        span: &curve::Span,
        radius: f64,
        widths: [f64; 2],
        system: u8,
    ) {
        let finest = self.scale.max_element();
        let along = steps(span.length() * finest / STEP);
        let across = steps(2.0 * radius * widths[0].max(widths[1]) * finest / STEP).max(4);
        for at in 0..along {
            let t = (double(at) + 0.5) / double(along);
            let width = widths[0] + (widths[1] - widths[0]) * t;
            let (middle, ahead) = (span.at(t), span.tangent(t).truncate().normalize_or_zero());
            let aside = ahead.perp();
            for step in 0..across {
                let off = 2.0 * (double(step) + 0.5) / double(across) - 1.0;
                let rise = (1.0 - off * off).sqrt();
                let place = (middle.truncate() + aside * (off * radius * width)) * self.scale;
                // The normal of the ellipse with the half-axes `width` and 1 / `width`.
                let [beside, up] = [off / width, rise * width];
                let lean = aside * (beside / beside.hypot(up));
                let top = Top {
                    height: narrow(middle.z + rise * radius / width),
                    lean: lean.to_array().map(narrow),
                    thickness: narrow(2.0 * rise * radius / width),
                    system,
                };
                self.raise(place, top);
            }
        }
    }

    /// Puts a place of a yarn into the buffer, if nothing is above it.
    fn raise(&mut self, place: DVec2, top: Top) {
        let [width, height] = self.size;
        let [x, y] = [(place.x, width), (place.y, height)].map(|(at, side)| {
            let at = at / double(side);
            whole(narrow((at - at.floor()) * double(side))).min(side - 1)
        });
        let seen = &mut self.tops[y * width + x];
        if top.height > seen.height {
            *seen = top;
        }
    }

    /// The shaded picture.
    fn shaded(&self, repeat: [usize; 2], wale: f64, systems: usize) -> Sketch {
        let mut heights: Vec<f32> =
            self.tops.iter().filter(|top| top.system != NONE).map(|top| top.height).collect();
        let highest = percentile(&mut heights, TOP);
        let sky = sky_light(self, wale);
        let light = |(top, sky): (&Top, &SkyLight)| match top.system {
            NONE => [0.0; CHANNELS],
            _ => [sky.even, sky.aside[0], sky.aside[1], top.depth_light(highest, wale)],
        };
        let lights: Vec<[f32; CHANNELS]> = self.tops.iter().zip(&sky).map(light).collect();
        let [width, height] = self.size.map(|side| side / FINE);
        let fine = |x: usize, y: usize| {
            (0..FINE * FINE)
                .map(move |at| (FINE * y + at / FINE) * self.size[0] + FINE * x + at % FINE)
        };
        let share = 1.0 / f32::from(u8::try_from(FINE * FINE).expect("a few"));
        let mean = |of: &(dyn Fn(usize) -> f32 + Sync)| {
            Plane::from_fn(width, height, |x, y| share * fine(x, y).map(of).sum::<f32>())
        };
        let is_bare = |at: usize| f32::from(u8::from(self.tops[at].system == NONE));
        let of_systems = |own: Range<usize>| {
            let is_own = |at: usize| own.contains(&usize::from(self.tops[at].system));
            mean(&|at| if is_own(at) { lights[at][0] } else { 0.0 })
        };
        Sketch {
            repeat,
            channels: std::array::from_fn(|channel| mean(&|at| lights[at][channel])),
            ground: mean(&is_bare),
            behind: of_systems(1..systems),
            yarns: (0..systems).map(|system| of_systems(system..system + 1)).collect(),
        }
    }
}

/// A number of steps, at least one.
fn steps(count: f64) -> usize {
    whole(narrow(count.ceil())).max(1)
}

#[cfg(test)]
mod tests {
    use super::super::candidate::full_bars;
    use super::*;

    /// The back of a draft of a locknit, its yarns spread by a share.
    fn back(share: f64) -> Sketch {
        let fabric = full_bars(&["2-3/1-0".to_owned(), "1-0/1-2".to_owned()]).unwrap();
        let pattern = Pattern::draft(&fabric);
        let spread = &Spread::of(&fabric, &pattern, fabric.radius());
        Sketch::new(&fabric, &pattern, PartSpread { spread, share }, Face::Back)
    }

    fn sum(plane: &Plane) -> f32 {
        plane.values.iter().sum()
    }

    #[test]
    fn the_more_yarns_are_spread_the_less_of_the_ground_shows() {
        let shown = [0.0, 0.5, 1.0].map(|share| sum(&back(share).ground));
        assert!(shown[0] > 1.1 * shown[1] && shown[1] > 1.1 * shown[2], "{shown:?}");
    }

    #[test]
    fn bars_behind_are_all_but_the_front_one() {
        let sketch = back(0.0);
        let [front, rear] = &sketch.yarns[..] else { panic!("{}", sketch.yarns.len()) };
        assert_eq!(sketch.behind.values, rear.values);
        // On the back, underlaps of the front bar lie outermost.
        assert!(sum(front) > sum(rear) && sum(rear) > 0.0);
        let both = front.values.iter().zip(&rear.values).map(|(one, other)| one + other);
        let even = &sketch.channels[0].values;
        assert!(both.zip(even).all(|(both, even)| (both - even).abs() < 1e-5));
        assert_eq!(sketch.on(Ground::Bars)[CHANNELS - 1].values, rear.values);
    }

    #[test]
    fn a_mirror_image_has_its_light_from_the_other_side() {
        let sketch = back(0.5);
        let mirrored = sketch.mirrored();
        let width = sketch.channels[0].width;
        for (at, value) in mirrored.channels[1].values.iter().enumerate() {
            let opposite = at / width * width + width - 1 - at % width;
            assert_eq!(*value, -sketch.channels[1].values[opposite]);
        }
        assert_eq!(mirrored.mirrored().channels[0].values, sketch.channels[0].values);
    }
}

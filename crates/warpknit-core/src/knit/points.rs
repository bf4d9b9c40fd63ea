//! Data points and their tags: what a knitted yarn is made of.
//!
//! In: nothing. Out: [`Knitted`], the points of some yarns with a [`Tag`] each, as structure of
//! arrays. The same arrays serve block after block, so they keep their memory. Cost: 36 bytes a
//! point. Not promised: points in any order but that of their yarns.

use glam::DVec3;

/// What a data point is part of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PointKind {
    /// S1 to S8 of a loop of a warp knit.
    WarpLoop,
    /// The eight places of the curve of a weft-knit loop, each followed by the place halfway to the
    /// next.
    WeftLoop,
    /// A point of a yarn that is laid in.
    Inlay,
    /// A point of a long underlap, between one loop and the next.
    Underlap,
}

/// A bed of needles. Machines with two of them knit spacer and double-faced fabrics.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Bed {
    /// The front bed, or the only one.
    #[default]
    Front,
    /// The back bed. No fabric has loops on it yet.
    Back,
}

/// Where a data point belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tag {
    /// Course, counted from the panel's lowest.
    pub course: i32,
    /// Wale, counted from the panel's leftmost.
    pub wale: i32,
    /// Loop, inlay or underlap.
    pub kind: PointKind,
    /// The bed of its needle.
    pub bed: Bed,
    /// 1 to 8 in a loop of a warp knit, 1 to 16 in a loop of a weft knit. Other kinds count from 1.
    pub point: u16,
}

// There is one tag for each data point: kind, bed and point share the last four bytes.
const _: () = assert!(size_of::<Tag>() == 12);

/// Data points of some yarns, in the order in which the yarns run.
#[derive(Clone, Debug, Default)]
pub struct Knitted {
    /// Positions on the flat panel, mm; z is the depth.
    pub points: Vec<DVec3>,
    /// Course, wale and kind of each point.
    pub tags: Vec<Tag>,
    /// Index of the first point of each stitch (a lap with the underlap that follows it).
    pub stitches: Vec<u32>,
    /// The point of the repeat of which each is a copy.
    pub origins: Vec<u32>,
}

impl Knitted {
    /// Removes all points but keeps the memory.
    pub fn clear(&mut self) {
        self.points.clear();
        self.tags.clear();
        self.stitches.clear();
        self.origins.clear();
    }
}

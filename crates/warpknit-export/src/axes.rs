//! The unit and the upright axis of `.ply` and `.obj`, which can't say theirs.
//!
//! In: places in mm with y up, as everything here has them. Out: the same in the unit and with the
//! axis that the reader takes for granted. Blender takes metres, y up in `.obj` and z up in `.ply`.

use glam::Vec3;

/// The unit and the upright axis of a file. The default is mm, y up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Axes {
    /// Its unit of length.
    pub unit: FileUnit,
    /// Its upright axis.
    pub up: UpAxis,
}

/// A unit of length.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FileUnit {
    /// Millimetres.
    #[default]
    Mm,
    /// Centimetres.
    Cm,
    /// Metres.
    M,
}

/// The axis that points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum UpAxis {
    /// y, and z towards the viewer.
    #[default]
    Y,
    /// z, and -y towards the viewer.
    Z,
}

impl FileUnit {
    /// Its name in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Mm => "mm",
            Self::Cm => "cm",
            Self::M => "m",
        }
    }

    /// Decimals in text, so that places are as exact as mm with four.
    pub(super) fn decimals(self) -> usize {
        match self {
            Self::Mm => 4,
            Self::Cm => 5,
            Self::M => 7,
        }
    }

    /// mm in it.
    fn in_mm(self) -> f32 {
        match self {
            Self::Mm => 1.0,
            Self::Cm => 10.0,
            Self::M => 1000.0,
        }
    }
}

impl Axes {
    /// A place, mm and y up, as the file has it. With the default it stays the same, to the bit.
    #[inline]
    pub(super) fn place(self, place: Vec3) -> Vec3 {
        self.direction(place) / self.unit.in_mm()
    }

    /// A direction as the file has it.
    #[inline]
    pub(super) fn direction(self, Vec3 { x, y, z }: Vec3) -> Vec3 {
        match self.up {
            UpAxis::Y => Vec3::new(x, y, z),
            UpAxis::Z => Vec3::new(x, -z, y),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_is_turned_and_scaled() {
        let place = Vec3::new(1000.0, 2000.0, 500.0);
        assert_eq!(Axes::default().place(place), place);
        let blender = Axes { unit: FileUnit::M, up: UpAxis::Z };
        assert_eq!(blender.place(place), Vec3::new(1.0, -0.5, 2.0));
        // A right-handed frame stays one.
        let [x, y, z] = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| blender.direction(axis));
        assert_eq!(x.cross(y), z);
    }
}

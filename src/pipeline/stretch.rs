//! A swatch that is pulled: its repeat solved at a strain, and how the cloth narrows on the way.
//!
//! In: a fabric, its relaxed repeat, and a [`Stretch`]. Out: the pulled cloth, and [`Stretched`] for
//! the user. Method and what is not promised: see [`crate::knit::strain::pull`]. Cost: below a second
//! at a given width, up to ten seconds for the free width of two bars.

use super::RunError;
use super::clock::{Clock, Task};
use crate::fabric::Fabric;
use crate::knit::Pattern;
use crate::knit::clearance::Clearance;
use crate::knit::strain::Strain;
use crate::knit::strain::pull::{Pulled, Puller};

/// How much yarns resist bending in the curves of [`Stretched::free`], over what the solver assumes.
pub const BENDINGS: [f64; 3] = [0.5, 1.0, 2.0];
/// Limits of both ratios of a [`Stretch`]. No knit reaches them without its yarn giving way.
pub const STRETCHES: (f64, f64) = (0.5, 2.0);
/// Limits of a pull at which the free width is looked for. Beyond them some lappings snap from one
/// state into another, and the width says little.
pub const FREE_PULLS: (f64, f64) = (1.0, 1.25);

/// How a swatch is pulled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    /// Ratio of pulled to flat length along the courses.
    pub courses: f64,
    /// The same along the wales. `None` for the width that the cloth takes by itself.
    pub wales: Option<f64>,
}

/// A pulled swatch.
#[derive(Clone, Debug)]
pub struct Stretched {
    /// Ratios of pulled to flat length.
    pub strain: Strain,
    /// Whether the cloth is locked there: its yarn would have to stretch.
    pub is_locked: bool,
    /// Widths along the wales over the pull, where they are free.
    pub free: Vec<FreeWidth>,
}

impl Stretched {
    /// The warning that the cloth is locked, if it is. `near` is the clearance of its yarns.
    pub(super) fn warning(&self, near: &Clearance) -> Option<String> {
        let Strain { courses, wales, .. } = self.strain;
        self.is_locked.then(|| {
            format!(
                "no loop can follow a pull to {courses:.2} along the courses and {wales:.2} along the \
                 wales: yarns would have to stretch, or lie nearer than touching (the nearest at {:.2} \
                 of it); change the cloth's size by less",
                near.min_over_2r
            )
        })
    }
}

/// The free width along the wales at a pull.
#[derive(Clone, Copy, Debug)]
pub struct FreeWidth {
    /// Ratio of pulled to flat length along the courses.
    pub courses: f64,
    /// The same along the wales, for each of [`BENDINGS`].
    pub wales: [f64; 3],
}

/// Pulls a cloth.
pub(super) fn pull(
    fabric: &Fabric,
    pattern: &Pattern,
    stretch: Stretch,
    clock: &mut Clock<'_>,
) -> Result<(Pulled, Stretched), RunError> {
    let puller = || {
        Puller::new(fabric, pattern)
            .ok_or_else(|| RunError::CantStretch { fabric: fabric.name.clone() })
    };
    clock.begin(Task::Strain, 0.0);
    let (wales, free) = match stretch.wales {
        Some(wales) => (wales, Vec::new()),
        None => {
            let listener = clock.listener();
            let mut curves = [const { Vec::new() }; BENDINGS.len()];
            for (at, (curve, bending)) in curves.iter_mut().zip(BENDINGS).enumerate() {
                let progress = &mut |done| listener.progress((at as f64 + done) / 3.0);
                *curve = puller()?.with_bending(bending).free(stretch.courses, progress);
            }
            let free = free_widths(&curves);
            (free.last().map_or(1.0, |last| last.wales[1]), free)
        }
    };
    let strain = Strain { courses: stretch.courses, wales, shear: 0.0 };
    let pulled = puller()?.at(strain);
    clock.stop();
    let is_locked = pulled.is_locked;
    Ok((pulled, Stretched { strain, is_locked, free }))
}

/// Curves over the same pulls side by side.
fn free_widths([soft, assumed, stiff]: &[Vec<Strain>; 3]) -> Vec<FreeWidth> {
    let rows = soft.iter().zip(assumed).zip(stiff);
    let rows = rows.map(|((soft, assumed), stiff)| FreeWidth {
        courses: assumed.courses,
        wales: [soft.wales, assumed.wales, stiff.wales],
    });
    rows.collect()
}

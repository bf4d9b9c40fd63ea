//! The sky above a place, as rays into it find it.
//!
//! In: what blocks each ray, and the sky's radiance in its direction. Out: [`SkyMeans`], means over
//! the hemisphere. Rays are cosine-weighted already, so all weigh the same.

use glam::Vec3;

use crate::cpu::lit::SkyLight;
use crate::cpu::share;
use crate::light::Rig;

/// What is in front of the sky.
pub(super) enum SkyBlock {
    None,
    /// A yarn of this base colour with the mean light of gaps. The yarn itself stands for a body behind
    /// it: what is between yarns is as bright as they are.
    Hidden {
        albedo: Vec3,
    },
    /// A yarn that reflects this light.
    Lit {
        light: Vec3,
        albedo: Vec3,
    },
}

/// What rays from a place into the sky meet.
#[derive(Default)]
pub(super) struct SkyRays {
    count: u32,
    open: u32,
    /// Sum of the sky's radiances.
    sky: Vec3,
    /// Sum of the radiances of yarns that hide it, as far as they are traced.
    lit: Vec3,
    /// Sums of the base colours of these yarns, and of the others.
    lit_albedo: Vec3,
    hidden_albedo: Vec3,
}

/// Mean radiances over the hemisphere, weighted by the cosine.
pub(super) struct SkyMeans {
    pub(super) visible: Vec3,
    /// That of yarns that hide the sky.
    pub(super) hidden: Vec3,
    /// The same where all of them have the mean light of gaps.
    pub(super) mean_hidden: Vec3,
    pub(super) open: f32,
}

impl SkyRays {
    /// Adds a ray, in whose direction the sky has this radiance.
    pub(super) fn add(&mut self, block: &SkyBlock, sky: Vec3) {
        self.count += 1;
        match block {
            SkyBlock::None => {
                self.open += 1;
                self.sky += sky;
            }
            SkyBlock::Hidden { albedo } => self.hidden_albedo += *albedo,
            SkyBlock::Lit { light, albedo } => {
                self.lit += *light;
                self.lit_albedo += *albedo;
            }
        }
    }

    /// The means at a place whose normal and the sun's direction have this cosine.
    pub(super) fn means(&self, rig: &Rig, sun_cosine: f32) -> SkyMeans {
        // The open share of the other rays: with its own, a hidden ray would count its place as more
        // hidden than it is.
        let others = self.count.saturating_sub(1);
        let open = if others == 0 { 0.5 } else { share(self.open, others) };
        let (gap, each) = (rig.gap_light(open, sun_cosine), share(1, self.count.max(1)));
        SkyMeans {
            visible: self.sky * each,
            hidden: (self.lit + gap * self.hidden_albedo) * each,
            mean_hidden: gap * (self.lit_albedo + self.hidden_albedo) * each,
            open: self.open as f32 * each,
        }
    }
}

impl SkyMeans {
    pub(super) fn light(&self) -> SkyLight {
        SkyLight { light: self.visible + self.hidden, open: self.open }
    }
}

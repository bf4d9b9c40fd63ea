//! What yarns are drawn as: round tubes or flat ribbons.

/// Primitive that yarns are drawn as.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shape {
    /// Round, with [`crate::scene::YarnLook::radius`].
    #[default]
    Tube,
    /// Flat strips in the fabric's plane. They extend [`crate::scene::YarnLook::radius`] to either
    /// side of the axis and are shaded with the fabric's normal.
    Ribbon,
}

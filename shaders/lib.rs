//! The WGSL shaders that draw yarns on a graphics card, put together from the fragments beside this
//! file.
//!
//! They are a package of their own so that the files stay in one obvious place and still go along
//! when the renderer is published. `warpknit-render` compares their structures and formulas with
//! its own.

/// Yarns and the light on them.
pub const YARN: &str = concat!(
    include_str!("view.wgsl"),
    include_str!("oval.wgsl"),
    include_str!("yarn.wgsl"),
    include_str!("sheen.wgsl"),
    include_str!("shade.wgsl"),
    include_str!("ply.wgsl"),
    include_str!("cloth.wgsl"),
);

/// Means of depths and of their squares, for soft shadows.
pub const MOMENTS: &str = concat!(include_str!("screen.wgsl"), include_str!("moments.wgsl"));

/// From light to pixels.
pub const TONE: &str = concat!(include_str!("screen.wgsl"), include_str!("tone.wgsl"));

/// All of them, each with its name.
pub const ALL: [(&str, &str); 3] = [("yarn", YARN), ("moments", MOMENTS), ("tone", TONE)];

#[cfg(test)]
mod tests {
    use super::*;
    use naga::valid::{Capabilities, ValidationFlags, Validator};

    #[test]
    fn every_shader_is_valid() {
        let mut faults = Vec::new();
        for (name, source) in ALL {
            match naga::front::wgsl::parse_str(source) {
                Err(error) => faults.push(format!("{name}: {}", error.emit_to_string(source))),
                Ok(module) => {
                    if let Err(error) =
                        Validator::new(ValidationFlags::all(), Capabilities::empty())
                            .validate(&module)
                    {
                        faults.push(format!("{name}: {}", error.emit_to_string(source)));
                    }
                }
            }
        }
        assert!(faults.is_empty(), "{}", faults.join("\n"));
    }
}

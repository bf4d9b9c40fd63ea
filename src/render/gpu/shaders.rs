//! The shaders, concatenated from the fragments in `shaders/`.

/// Yarns and the light on them.
pub(super) const YARN: &str = concat!(
    include_str!("../../../shaders/view.wgsl"),
    include_str!("../../../shaders/yarn.wgsl"),
    include_str!("../../../shaders/sheen.wgsl"),
    include_str!("../../../shaders/shade.wgsl"),
    include_str!("../../../shaders/ply.wgsl"),
    include_str!("../../../shaders/cloth.wgsl"),
);

/// Filter of depths.
pub(super) const MOMENTS: &str = concat!(
    include_str!("../../../shaders/screen.wgsl"),
    include_str!("../../../shaders/moments.wgsl")
);

/// Tone mapping.
pub(super) const TONE: &str = concat!(
    include_str!("../../../shaders/screen.wgsl"),
    include_str!("../../../shaders/tone.wgsl")
);

/// All of them, each with its name.
#[cfg(test)]
pub(super) const ALL: [(&str, &str); 3] = [("yarn", YARN), ("moments", MOMENTS), ("tone", TONE)];

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

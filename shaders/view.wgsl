// Uniforms of all passes over the yarns: the view, the light, and the yarns' looks. The Rust twins
// of all structures are in src/render/gpu/data.rs; a test compares names and offsets.

struct ViewUniform {
    // Positions are relative to the scene's centre, mm.
    clip_from_world: mat4x4f,
    // To the sun's depth map: x and y in texels, z the distance along the rays, mm.
    sun_from_world: mat4x4f,
    // The eye with w = 1, or with w = 0 the direction to an eye at infinity.
    eye: vec4f,
    toward_sun: vec3f,
    // Size of a pixel at distance 1, mm. For an eye at infinity, the size at every distance.
    pixel: f32,
    sun: vec3f,
    // Size of this tile, texels of the pass.
    tile_width: f32,
    zenith: vec3f,
    tile_height: f32,
    sky_above: vec3f,
    // Texels of the eye's depth map per texel of the pass.
    depth_scale: f32,
    sky_below: vec3f,
    // First texel of this tile in the picture.
    corner_x: f32,
    // Radiance of white cloth that nothing hides, times the mean colour of the yarns and the traced
    // factors of gaps.
    on_cloth: vec3f,
    corner_y: f32,
    // Depth bias of the sun's map, mm.
    sun_bias: f32,
    // Thickness of a layer of cloth, mm.
    layer: f32,
    // What yarns of the same cloth leave visible on average: of the sky a constant and a factor on
    // the cosine of normal and eye, its brightness over that of the whole sky, and the sun's share.
    near_open: vec2f,
    near_brightness: f32,
    near_sunshine: f32,
    // How far these means take the place of the depth maps, which are too coarse from afar, 0..1.
    farness: f32,
    // Size of a texel of the eye's depth map at distance 1, mm; as `pixel`.
    depth_texel: f32,
    // Standard deviation of that map's filter, texels.
    depth_sigma: f32,
    // Light of the gaps, see GapLight in light.rs: what is added where the sun stands over a place;
    // where all of the sky is hidden, and what is added where all of it is open.
    gap_to_sun: f32,
    gap_light: vec2f,
}

struct LookData {
    // Linear RGB.
    albedo: vec3f,
    roughness: f32,
    metallic: f32,
    // Radius, or half of a ribbon's width, mm.
    radius: f32,
    plies: f32,
    // Slopes of plies and of fibres against the yarn's axis.
    ply_slope: f32,
    fibre_slope: f32,
    // Length of one repeat of the textures, mm; 0 without textures.
    repeat: f32,
    // Strength of the sheen, 0..1.
    sheen: f32,
    spare: f32,
}

@group(0) @binding(0) var<uniform> view: ViewUniform;
@group(0) @binding(1) var<storage, read> looks: array<LookData>;

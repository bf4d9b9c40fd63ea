// What every pass over the yarns sees: who looks, the light, the yarns' looks.
// The Rust twins of all structures stand in src/render/gpu/data.rs; a test compares names and offsets.

struct ViewUniform {
    // Positions are relative to the scene's middle, mm.
    clip_from_world: mat4x4f,
    // To the sun's map: x and y in texels, z the distance along the rays, mm.
    sun_from_world: mat4x4f,
    // The eye with w = 1, or with w = 0 the direction toward one that is infinitely far.
    eye: vec4f,
    toward_sun: vec3f,
    // Size of a pixel at distance 1; at every distance for an eye infinitely far; mm.
    pixel: f32,
    sun: vec3f,
    // Size of this tile, pixels of the pass.
    tile_width: f32,
    zenith: vec3f,
    tile_height: f32,
    sky_above: vec3f,
    // Texels of the eye's depth map a pixel of the picture.
    depth_scale: f32,
    sky_below: vec3f,
    // Where this tile begins in the picture, pixels.
    corner_x: f32,
    // Light that comes from a yarn in the sky's way.
    interior: vec3f,
    corner_y: f32,
    // What the sun's map takes for one depth, mm.
    sun_bias: f32,
    // Depth of one layer of cloth, mm.
    layer: f32,
    spare: vec2f,
}

struct LookData {
    // Linear RGB.
    albedo: vec3f,
    roughness: f32,
    metallic: f32,
    // Of a ribbon half its width; mm.
    radius: f32,
    plies: f32,
    // Slopes of plies and of fibres against the yarn's axis.
    ply_slope: f32,
    fibre_slope: f32,
    // Length of one repeat of the maps, mm; 0 where there are none.
    repeat: f32,
    // Share that fibres mirror of what they could.
    sheen: f32,
    spare: f32,
}

@group(0) @binding(0) var<uniform> view: ViewUniform;
@group(0) @binding(1) var<storage, read> looks: array<LookData>;

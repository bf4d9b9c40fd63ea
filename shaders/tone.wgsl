// src/render/tone.rs, line by line: from light times coverage to sRGB with straight alpha. A test compares the two.

const SHOULDER = 0.6;

struct Tone {
    // sRGB, 0..1; alpha 0 for a transparent background.
    background: vec4f,
    exposure: f32,
    spare_a: f32,
    spare_b: f32,
    spare_c: f32,
}

@group(0) @binding(0) var<uniform> tone: Tone;
@group(0) @binding(1) var lights: texture_2d<f32>;

@vertex
fn cover(@builtin(vertex_index) vertex: u32) -> @builtin(position) vec4f {
    return vec4f(f32(vertex & 1u) * 4.0 - 1.0, f32(vertex >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

fn shoulder(light: vec3f) -> vec3f {
    let room = 1.0 - SHOULDER;
    return select(max(light, vec3f(0.0)), 1.0 - room * exp(-(light - SHOULDER) / room), light > vec3f(SHOULDER));
}

fn linear(c: vec3f) -> vec3f {
    return select(pow((c + 0.055) / 1.055, vec3f(2.4)), c / 12.92, c <= vec3f(0.04045));
}

fn encode(c: vec3f) -> vec3f {
    return select(1.055 * pow(max(c, vec3f(0.0)), vec3f(1.0 / 2.4)) - 0.055, c * 12.92, c <= vec3f(0.0031308));
}

@fragment
fn tone_map(@builtin(position) at: vec4f) -> @location(0) vec4f {
    let light = textureLoad(lights, vec2i(at.xy), 0);
    let coverage = saturate(light.w);
    var yarn = vec3f(0.0);
    if light.w > 0.0 {
        yarn = shoulder(light.rgb / light.w * tone.exposure);
    }
    if tone.background.a == 0.0 {
        return vec4f(encode(yarn), coverage);
    }
    if coverage == 0.0 {
        return tone.background;
    }
    return vec4f(encode(mix(linear(tone.background.rgb), yarn, coverage)), 1.0);
}

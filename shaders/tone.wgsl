// From light to pixels: a tent filter two pixels wide, as in src/render/cpu/film.rs, then
// src/render/tone.rs line by line: from light times coverage to sRGB with straight alpha. A test
// compares the two.

// Linear value above which highlights are compressed.
const SHOULDER = 0.6;

struct Tone {
    // sRGB, 0..1. Alpha 0 stands for a transparent background.
    background: vec4f,
    exposure: f32,
    // Texels of light per pixel, each way. A margin one pixel wide surrounds the picture.
    scale: i32,
    // The target's pixel at which the picture's part begins.
    corner: vec2i,
}

@group(0) @binding(0) var<uniform> tone: Tone;
@group(0) @binding(1) var lights: texture_2d<f32>;

// The tone curve: identity up to SHOULDER, then an exponential approach to 1 with the same slope.
fn shoulder(light: vec3f) -> vec3f {
    let room = 1.0 - SHOULDER;
    let bent = 1.0 - room * exp(-(light - SHOULDER) / room);
    return select(max(light, vec3f(0.0)), bent, light > vec3f(SHOULDER));
}

// sRGB decoding (IEC 61966-2-1).
fn linear(c: vec3f) -> vec3f {
    return select(pow((c + 0.055) / 1.055, vec3f(2.4)), c / 12.92, c <= vec3f(0.04045));
}

// sRGB encoding (IEC 61966-2-1).
fn encode(c: vec3f) -> vec3f {
    let curve = 1.055 * pow(max(c, vec3f(0.0)), vec3f(1.0 / 2.4)) - 0.055;
    return select(curve, c * 12.92, c <= vec3f(0.0031308));
}

// The light of a pixel. With one texel a pixel, multisampling has averaged it already.
fn filtered(pixel: vec2i) -> vec4f {
    let size = vec2i(textureDimensions(lights));
    if tone.scale == 1 {
        return textureLoad(lights, pixel + 1, 0);
    }
    var sum = vec4f(0.0);
    var total = 0.0;
    let corner = pixel * tone.scale + tone.scale - tone.scale / 2;
    for (var y = 0; y < 2 * tone.scale; y++) {
        for (var x = 0; x < 2 * tone.scale; x++) {
            let at = corner + vec2i(x, y);
            let offset = abs((vec2f(at) + 0.5) / f32(tone.scale) - vec2f(pixel) - 1.5);
            // A tent in each direction, 1 at the pixel's centre and 0 at its neighbours' centres.
            let weight = max(1.0 - offset.x, 0.0) * max(1.0 - offset.y, 0.0);
            sum += weight * textureLoad(lights, clamp(at, vec2i(0), size - 1), 0);
            total += weight;
        }
    }
    return sum / total;
}

@fragment
fn tone_map(@builtin(position) at: vec4f) -> @location(0) vec4f {
    let light = filtered(vec2i(at.xy) - tone.corner);
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

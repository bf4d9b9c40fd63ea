// Depths of what a light or an eye sees, averaged around each texel: mean, variance, and the share of texels that anything covers.
//
// Variance shadow maps (Donnelly and Lauritzen 2006) keep E[d] and E[d^2] and subtract: in 32 bits that loses a yarn's radius a metre
// away. Here the variance is kept itself, about the mean; averages of it follow the law of total variance.

struct Blur {
    // The way that this pass goes: (1, 0) or (0, 1).
    step: vec2i,
    // Texels to either side.
    reach: i32,
    // Of the Gaussian weights, texels.
    sigma: f32,
    // Depths of the buffer's 0 and 1, mm.
    near: f32,
    far: f32,
    // 1 where depths in the buffer are those of a perspective view.
    perspective: f32,
    // What lies so far behind the nearest of the averaged is another layer of cloth, mm.
    layer: f32,
}

// Whether taps are of a depth buffer, or of averages already.
override FROM_DEPTHS: bool = true;
// Whether only the nearest layer is averaged.
override LAYERED: bool = false;
const FARTHEST = 3.0e38;

@group(0) @binding(0) var<uniform> blur: Blur;
@group(0) @binding(1) var depths: texture_depth_2d;
@group(0) @binding(2) var moments: texture_2d<f32>;

fn linear_depth(depth: f32) -> f32 {
    let range = blur.far - blur.near;
    return select(blur.near + depth * range, blur.near * blur.far / (blur.far - depth * range), blur.perspective > 0.5);
}

// Sums about a first depth, so that nothing cancels.
struct Sums {
    origin: f32,
    weight: f32,
    first: f32,
    second: f32,
}

fn add(sums: ptr<function, Sums>, weight: f32, mean: f32, variance: f32) {
    if (*sums).weight == 0.0 {
        (*sums).origin = mean;
    }
    let offset = mean - (*sums).origin;
    (*sums).weight += weight;
    (*sums).first += weight * offset;
    (*sums).second += weight * (offset * offset + variance);
}

fn moments_of(sums: Sums, total: f32) -> vec4f {
    if sums.weight <= 0.0 {
        return vec4f(0.0);
    }
    let mean = sums.first / sums.weight;
    return vec4f(sums.origin + mean, max(sums.second / sums.weight - mean * mean, 0.0), sums.weight / total, 0.0);
}

fn weight(tap: i32) -> f32 {
    let x = f32(tap) / blur.sigma;
    return exp(-0.5 * x * x);
}

// What a tap sees: depth and variance, and in z its cover.
fn tap_at(place: vec2i, tap: i32) -> vec3f {
    let at = clamp(place + tap * blur.step, vec2i(0), vec2i(textureDimensions(depths)) - 1);
    if FROM_DEPTHS {
        let depth = textureLoad(depths, at, 0);
        return vec3f(linear_depth(depth), 0.0, select(0.0, 1.0, depth < 1.0));
    }
    return textureLoad(moments, at, 0).xyz;
}

@fragment
fn average(@builtin(position) at: vec4f) -> @location(0) vec4f {
    var farthest = FARTHEST;
    if LAYERED {
        for (var tap = -blur.reach; tap <= blur.reach; tap++) {
            let found = tap_at(vec2i(at.xy), tap);
            farthest = min(farthest, select(FARTHEST, found.x + blur.layer, found.z > 0.0));
        }
    }
    var sums = Sums(0.0, 0.0, 0.0, 0.0);
    var total = 0.0;
    for (var tap = -blur.reach; tap <= blur.reach; tap++) {
        let w = weight(tap);
        let found = tap_at(vec2i(at.xy), tap);
        total += w;
        if found.z > 0.0 && found.x < farthest {
            add(&sums, w * found.z, found.x, found.y);
        }
    }
    return moments_of(sums, total);
}

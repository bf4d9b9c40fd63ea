// Moments of depths, filtered around each texel: mean, variance, and cover, the weight of texels
// with any yarn.
//
// Variance shadow maps (Donnelly and Lauritzen 2006, 'Variance shadow maps') store E[d] and E[d^2]
// and subtract. In 32-bit floats this loses a yarn's radius at a metre: the squares of distances
// leave no digits for it. Here the variance about the mean is stored instead. Averages of variances
// follow the law of total variance. The filter is a separable Gaussian, one pass per axis.

struct Blur {
    // Direction of this pass: (1, 0) or (0, 1).
    step: vec2i,
    // Taps to either side, texels.
    reach: i32,
    // Standard deviation of the Gaussian, texels.
    sigma: f32,
    // Distances at the depth buffer's 0 and 1, mm.
    near: f32,
    far: f32,
    // 1 if the depth buffer is that of a perspective view.
    perspective: f32,
    // Thickness of a layer of cloth, mm. Depths that far behind the nearest tap belong to another
    // layer.
    layer: f32,
}

// Whether taps read a depth buffer (first pass) or moments (second pass).
override FROM_DEPTHS: bool = true;
// Whether only the nearest layer is averaged: for the sky. For the sun, all layers cast shadows.
override LAYERED: bool = false;
// About the largest 32-bit float.
const FARTHEST = 3.0e38;

@group(0) @binding(0) var<uniform> blur: Blur;
@group(0) @binding(1) var depths: texture_depth_2d;
@group(0) @binding(2) var moments: texture_2d<f32>;

// Distance in mm from a depth buffer's value: the inverse of the projection.
fn linear_depth(depth: f32) -> f32 {
    let range = blur.far - blur.near;
    let orthographic = blur.near + depth * range;
    let perspective = blur.near * blur.far / (blur.far - depth * range);
    return select(orthographic, perspective, blur.perspective > 0.5);
}

// Sums about the first depth. Sums about 0 would cancel.
struct Sums {
    origin: f32,
    weight: f32,
    first: f32,
    second: f32,
}

// Adds a tap: moments about the origin, its own variance included.
fn add(sums: ptr<function, Sums>, weight: f32, mean: f32, variance: f32) {
    if (*sums).weight == 0.0 {
        (*sums).origin = mean;
    }
    let offset = mean - (*sums).origin;
    (*sums).weight += weight;
    (*sums).first += weight * offset;
    (*sums).second += weight * (offset * offset + variance);
}

// Mean, variance and cover of the sums.
fn moments_of(sums: Sums, total: f32) -> vec4f {
    if sums.weight <= 0.0 {
        return vec4f(0.0);
    }
    // Law of total variance: the mean of squares, which contains the taps' variances, less the
    // square of the mean.
    let mean = sums.first / sums.weight;
    let variance = max(sums.second / sums.weight - mean * mean, 0.0);
    return vec4f(sums.origin + mean, variance, sums.weight / total, 0.0);
}

// Gaussian weight.
fn weight(tap: i32) -> f32 {
    let x = f32(tap) / blur.sigma;
    return exp(-0.5 * x * x);
}

// A tap: depth, variance and cover.
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
    // First the nearest depth, then the mean of those within one layer of it.
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
        // Texels without yarn count in `total` only: they lower the cover and do not change the
        // mean.
        if found.z > 0.0 && found.x < farthest {
            add(&sums, w * found.z, found.x, found.y);
        }
    }
    return moments_of(sums, total);
}

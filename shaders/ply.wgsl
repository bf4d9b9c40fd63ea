// Procedural plies and fibres on a plain tube: src/render/ply.rs, line by line, where the constants
// are explained. A test compares the two on random input.

const PLY_TILT = 0.42;
const GROOVE = 0.30;
const MEAN_GROOVE = 0.25;
const FIBRES = 26;
const FIBRE_LENGTH = 5.0;
const FIBRE_TILT = 0.30;
const FIBRE_SHADE = 0.16;
const MIN_COSINE = 0.05;

// A point on a yarn's surface.
struct YarnPoint {
    normal: vec3f,
    toward_eye: vec3f,
    tangent: vec3f,
    around: f32,
    along: f32,
    radius: f32,
    footprint: f32,
    plies: f32,
    ply_slope: f32,
    fibre_slope: f32,
}

// The perturbed normal, and a factor on the albedo.
struct Detail {
    normal: vec3f,
    shade: f32,
}

// The finaliser of MurmurHash3; `hash` in Rust.
fn mix_bits(bits: u32) -> u32 {
    var b = (bits ^ (bits >> 16u)) * 0x85EBCA6Bu;
    b = (b ^ (b >> 13u)) * 0xC2B2AE35u;
    return b ^ (b >> 16u);
}

// Value noise on a grid that wraps around the yarn, -1..1.
fn noise(column: f32, row: f32) -> f32 {
    let wrapped = u32((i32(column) % FIBRES + FIBRES) % FIBRES);
    let bits = mix_bits((wrapped * 0x9E3779B9u) ^ (bitcast<u32>(i32(row)) * 0x85EBCA6Bu));
    return f32(bits >> 16u) / 32767.5 - 1.0;
}

// Fades detail out: 1 where a pixel is small beside a feature, 0 where it is as large.
fn fade(footprint: f32, feature: f32) -> f32 {
    let share = saturate((feature - footprint) / max(0.7 * feature, TINY));
    return share * share * (3.0 - 2.0 * share);
}

// A normal, bent toward the eye if it faces away.
fn face_eye(normal: vec3f, toward_eye: vec3f) -> vec3f {
    let cosine = dot(normal, toward_eye);
    let bent = normalize(normal + toward_eye * (MIN_COSINE - cosine));
    return select(bent, normal, cosine >= MIN_COSINE);
}

// Slope and height of the fibres' noise: value noise, stretched along the fibres.
fn fibres(p: YarnPoint, turn: f32) -> vec2f {
    let q = f32(FIBRES) * (p.around / TAU + p.fibre_slope * p.along / turn);
    let v = p.along / (FIBRE_LENGTH * p.radius);
    let column = floor(q);
    let row = floor(v);
    let x = q - column;
    let y = v - row;
    let ease = y * y * (3.0 - 2.0 * y);
    let left = mix(noise(column, row), noise(column, row + 1.0), ease);
    let right = mix(noise(column + 1.0, row), noise(column + 1.0, row + 1.0), ease);
    return vec2f((left - right) * 3.0 * x * (1.0 - x), mix(left, right, x * x * (3.0 - 2.0 * x)));
}

// The normal and the factor on the albedo at a point of the yarn.
fn ply_detail(p: YarnPoint) -> Detail {
    let turn = TAU * p.radius;
    let around = cross(p.tangent, p.normal);
    var tilt = vec3f(0.0);
    var groove = 0.0;
    if p.plies > 1.0 {
        let share = fade(p.footprint, turn / p.plies);
        // Helical coordinate: an integer on each ply's crown.
        let ply = p.plies * (p.around / TAU + p.ply_slope * p.along / turn);
        let offset = ply - round(ply);
        tilt = (around + p.tangent * p.ply_slope) * (2.0 * offset * PLY_TILT * share);
        // An unresolved groove darkens by its mean, so that the colour does not change with
        // distance.
        let across = 2.0 * abs(offset);
        groove = across * across * across * share + MEAN_GROOVE * (1.0 - share);
    }
    var shade = 1.0 - GROOVE * groove;
    let fibre_share = fade(p.footprint, 2.0 * turn / f32(FIBRES));
    // A strip is never so wide that fibres show. A software driver computes both sides of a branch,
    // so this one is compiled out.
    if SHAPE != STRIP && fibre_share > 0.0 {
        let fibre = fibres(p, turn);
        tilt += around * (fibre.x * FIBRE_TILT * fibre_share);
        shade *= 1.0 + FIBRE_SHADE * fibre.y * fibre_share;
    }
    return Detail(face_eye(normalize(p.normal + tilt), p.toward_eye), shade);
}

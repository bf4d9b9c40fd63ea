// Specular reflection of parallel fibres: src/render/sheen.rs, line by line, after Irawan and
// Marschner (2012, 'Specular reflection from woven cloth'). A test compares the two on random
// input.

// Whether any yarn of the scene has a sheen.
override SHEEN: bool = true;
// Constants as in src/render/sheen.rs, where they are explained.
const CONCENTRATION = 40.0;
const ISOTROPIC = 0.6;
const FORWARD_CONCENTRATION = 3.0;
const END_ON_LOSS = 0.95;

// Strength, slope of the fibres against the yarn's axis, and the yarn's unit tangent.
struct Sheen {
    share: f32,
    slope: f32,
    tangent: vec3f,
}

// Unit direction of the fibres where the yarn's normal is `normal`.
fn fibre_of(s: Sheen, normal: vec3f) -> vec3f {
    let turned = s.tangent - cross(s.tangent, normal) * s.slope;
    let flat = turned - normal * dot(turned, normal);
    return select(s.tangent, normalize(flat), dot(flat, flat) > 0.0);
}

// The sheen's contribution to the BRDF.
fn sheen_lobe(s: Sheen, normal: vec3f, toward_light: vec3f, toward_eye: vec3f) -> f32 {
    let nl = dot(normal, toward_light);
    let nv = dot(normal, toward_eye);
    if nl <= 0.0 || nv <= 0.0 {
        return 0.0;
    }
    let sine = dot(fibre_of(s, normal), normalize(toward_light + toward_eye));
    // Von Mises distribution of the angle between the half vector and the plane across the fibre.
    let spread = exp(CONCENTRATION * (sqrt(max(1.0 - sine * sine, 0.0)) - 1.0));
    // Isotropic part and forward lobe.
    let forward = exp(-FORWARD_CONCENTRATION * (1.0 + dot(toward_light, toward_eye)));
    let phase = ISOTROPIC + (1.0 - ISOTROPIC) * forward;
    return s.share * spread * phase / (nl + nv);
}

// Reflected light at one place across the yarn's width, -1..1.
fn sheen_at(
    s: Sheen, width: vec3f, front: vec3f, side: f32, toward_light: vec3f, toward_eye: vec3f,
) -> f32 {
    let normal = width * side + front * sqrt(1.0 - side * side);
    return sheen_lobe(s, normal, toward_light, toward_eye) * max(dot(normal, toward_light), 0.0);
}

// Mean over the width by Gauss-Legendre quadrature with four points.
fn sheen_mean_over_width(s: Sheen, toward_light: vec3f, toward_eye: vec3f) -> f32 {
    let sideways = cross(s.tangent, toward_eye);
    let width = select(vec3f(0.0), normalize(sideways), dot(sideways, sideways) > 0.0);
    let front = cross(width, s.tangent);
    let outer = sheen_at(s, width, front, -0.861136, toward_light, toward_eye)
        + sheen_at(s, width, front, 0.861136, toward_light, toward_eye);
    let inner = sheen_at(s, width, front, -0.339981, toward_light, toward_eye)
        + sheen_at(s, width, front, 0.339981, toward_light, toward_eye);
    return 0.173927 * outer + 0.326073 * inner;
}

// The normal at the yarn's brightest line.
fn sheen_highlight_normal(s: Sheen, toward_light: vec3f, toward_eye: vec3f) -> vec3f {
    let sum = toward_light + toward_eye;
    let flat = sum - s.tangent * dot(sum, s.tangent);
    return select(toward_eye, normalize(flat), dot(flat, flat) > 0.0);
}

// Fraction of the rest of the BRDF that is left.
fn sheen_base_share(s: Sheen, light_cosine: f32, view_cosine: f32) -> f32 {
    return 1.0 - s.share / (1.0 + saturate(min(light_cosine, view_cosine)));
}

// The same for light from a whole sky.
fn sheen_base_share_under_sky(s: Sheen, view_cosine: f32) -> f32 {
    let cosine = saturate(view_cosine);
    return 1.0 - s.share * (1.0 + cosine - 2.0 * log(1.0 + cosine));
}

// Fraction of a uniform sky's light that the sheen reflects.
fn sheen_sky_reflectance(s: Sheen, normal: vec3f, toward_eye: vec3f) -> f32 {
    let along = dot(fibre_of(s, normal), toward_eye);
    let view_cosine = saturate(dot(normal, toward_eye));
    return s.share * sqrt(1.0 - END_ON_LOSS * along * along) / (1.0 + view_cosine);
}

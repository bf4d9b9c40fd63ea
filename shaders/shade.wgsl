// Reflection of a yarn's surface: src/render/shade.rs, line by line. Cook and Torrance (1982) with
// Beckmann's distribution and Schlick's (1994) Fresnel and masking terms. A test compares the two
// on random input.

const PI = 3.141592653589793;
// A smoother surface would overflow the distribution.
const MIN_ROUGHNESS = 0.03;
// The smallest normal 32-bit float, against division by zero.
const TINY = 1.1754944e-38;

// The surface's material and normal.
struct Material {
    normal: vec3f,
    albedo: vec3f,
    roughness: f32,
    metallic: f32,
    sheen: Sheen,
}

// Reflectance at normal incidence; `f0` in Rust.
fn reflectance(m: Material) -> vec3f {
    return mix(vec3f(0.04), m.albedo, m.metallic);
}

// Diffuse albedo that is left where the fraction `fresnel` is mirrored.
fn diffuse(m: Material, fresnel: vec3f) -> vec3f {
    return (1.0 - fresnel) * m.albedo * (1.0 - m.metallic);
}

// Products instead of pow(): drivers may compute pow() by logarithms, with fewer digits.
fn fifth_power(x: f32) -> f32 {
    return x * x * x * x * x;
}

// Schlick's approximation of the Fresnel term.
fn schlick(f0: vec3f, cosine: f32) -> vec3f {
    return f0 + (1.0 - f0) * fifth_power(1.0 - saturate(cosine));
}

// Its mean over the microfacets of a rough surface (Lagarde 2011).
fn schlick_rough(f0: vec3f, cosine: f32, roughness: f32) -> vec3f {
    return f0 + (max(f0, vec3f(1.0 - roughness)) - f0) * fifth_power(1.0 - saturate(cosine));
}

// Beckmann's distribution of microfacet normals.
fn beckmann(cosine: f32, a: f32) -> f32 {
    let cos2 = min(cosine * cosine, 1.0);
    let a2 = a * a;
    return exp(-(1.0 - cos2) / (cos2 * a2)) / max(PI * a2 * cos2 * cos2, TINY);
}

// Schlick's approximation of Smith's masking term, divided by its cosine.
fn masking(cosine: f32, k: f32) -> f32 {
    return 1.0 / (cosine * (1.0 - k) + k);
}

// The BRDF with the sheen.
fn brdf(m: Material, toward_light: vec3f, toward_eye: vec3f) -> vec3f {
    let base = base_brdf(m, toward_light, toward_eye);
    if !SHEEN {
        return base;
    }
    return base + sheen_color(m) * sheen_lobe(m.sheen, m.normal, toward_light, toward_eye);
}

// Colour of the sheen: a third is reflected at the fibres' surfaces, so it is white.
fn sheen_color(m: Material) -> vec3f {
    return mix(m.albedo, vec3f(1.0), 1.0 / 3.0);
}

// The BRDF without the sheen, scaled down by the energy that the sheen takes.
fn base_brdf(m: Material, toward_light: vec3f, toward_eye: vec3f) -> vec3f {
    let nl = dot(m.normal, toward_light);
    let nv = dot(m.normal, toward_eye);
    let sum = toward_light + toward_eye;
    // normalize() of a zero vector is undefined, so opposite directions are handled apart.
    let half_way = select(vec3f(0.0), normalize(sum), dot(sum, sum) > 0.0);
    let nh = dot(m.normal, half_way);
    if nl <= 0.0 || nv <= 0.0 || nh <= 0.0 {
        return vec3f(0.0);
    }
    let roughness = clamp(m.roughness, MIN_ROUGHNESS, 1.0);
    let fresnel = schlick(reflectance(m), dot(toward_eye, half_way));
    let k = (roughness + 1.0) * (roughness + 1.0) / 8.0;
    let specular =
        fresnel * (beckmann(nh, roughness * roughness) * masking(nl, k) * masking(nv, k) / 4.0);
    let base = diffuse(m, fresnel) / PI + specular;
    if !SHEEN {
        return base;
    }
    return base * sheen_base_share(m.sheen, nl, nv);
}

// How a place lies among the yarns of the nearest layer, see src/render/shade.rs.
struct LayerRelief {
    // How far before the layer's mean depth it lies, radii.
    before: f32,
    // Standard deviation of the layer's depths, radii.
    deviation: f32,
    // Fraction of the surroundings that yarn covers.
    cover: f32,
}

// Visibility of the sky among neighbouring yarns: a logistic fit, see src/render/shade.rs. `other`
// marks a yarn of another layer.
fn sky_visibility(relief: LayerRelief, other: bool, cosine: f32) -> f32 {
    let slope = 3.722 / (relief.deviation + 2.607);
    let level = 1.0 / (1.0 + exp(0.412 * relief.deviation - 1.038 - slope * relief.before));
    return saturate(mix(1.0, select(level, 0.5, other), relief.cover) * (0.545 + 0.525 * cosine));
}

// The same among ribbons, which have no relief of their own.
fn sky_visibility_of_ribbon(before: f32, other: bool, cover: f32, cosine: f32) -> f32 {
    let level = select(1.0 / (1.0 + exp(-0.35 - 0.427 * before)), 0.5, other);
    return saturate(mix(1.0, level, cover) * mix(0.51, 1.2, cosine));
}

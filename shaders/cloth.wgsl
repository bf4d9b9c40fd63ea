// The light that leaves a yarn toward the eye: sun through its shadow map, sky through the cloth's own depth.

override FUZZ: bool = false;
// Whether yarns have maps.
override MAPS: bool = true;
// Alpha from which yarn is solid; below it is fuzz, blended in a pass of its own.
const SOLID_ALPHA = 0.5;
const MIN_ALPHA = 0.02;
// Share of the variance's bound that counts as full shadow: what bleeds through from other layers stays below it.
const LIGHT_BLEEDING = 0.2;
const SAMPLES = 4.0;

@group(2) @binding(0) var base_map: texture_2d<f32>;
@group(2) @binding(1) var normal_map: texture_2d<f32>;
@group(2) @binding(2) var surface_map: texture_2d<f32>;
@group(2) @binding(3) var map_sampler: sampler;

@group(3) @binding(0) var sun_map: texture_2d<f32>;
@group(3) @binding(1) var depth_map: texture_2d<f32>;

struct Light {
    @location(0) color: vec4f,
    @builtin(sample_mask) samples: u32,
}

// A texel's share in a mean of four, about the depth `origin`: weighted first and second moments, and the weight.
fn weighted_moments(texel: vec4f, origin: f32, share: f32) -> vec3f {
    let offset = texel.x - origin;
    return share * texel.z * vec3f(offset, offset * offset + texel.y, 1.0);
}

// Mean, variance and cover between texels.
fn moments_at(map: texture_2d<f32>, place: vec2f) -> vec3f {
    let corner = floor(place - 0.5);
    let part = place - 0.5 - corner;
    let last = vec2i(textureDimensions(map)) - 1;
    let low = clamp(vec2i(corner), vec2i(0), last);
    let high = clamp(vec2i(corner) + 1, vec2i(0), last);
    let a = textureLoad(map, low, 0);
    let b = textureLoad(map, vec2i(high.x, low.y), 0);
    let c = textureLoad(map, vec2i(low.x, high.y), 0);
    let d = textureLoad(map, high, 0);
    // Any covered texel's depth will do: it only keeps the sums small.
    let origin = max(max(a.x, b.x), max(c.x, d.x));
    let sums = weighted_moments(a, origin, (1.0 - part.x) * (1.0 - part.y)) + weighted_moments(b, origin, part.x * (1.0 - part.y))
        + weighted_moments(c, origin, (1.0 - part.x) * part.y) + weighted_moments(d, origin, part.x * part.y);
    let mean = sums.x / max(sums.z, TINY);
    return vec3f(origin + mean, max(sums.y / max(sums.z, TINY) - mean * mean, 0.0), sums.z);
}

// Share of the sun that reaches a point: Chebyshev's bound on how much of what the map averages lies behind it.
fn sun_visibility(world: vec3f) -> f32 {
    let place = view.sun_from_world * vec4f(world, 1.0);
    let m = moments_at(sun_map, place.xy);
    let behind = place.z - view.sun_bias - m.x;
    if behind <= 0.0 || m.z <= 0.0 {
        return 1.0;
    }
    let variance = max(m.y, view.sun_bias * view.sun_bias);
    let bound = variance / (variance + behind * behind);
    return 1.0 - m.z * (1.0 - saturate((bound - LIGHT_BLEEDING) / (1.0 - LIGHT_BLEEDING)));
}

fn sky(direction: vec3f) -> vec3f {
    return mix(view.sky_below, view.sky_above, 0.5 + 0.5 * dot(direction, view.zenith));
}

// Share of the sky that is open at a depth, by the cloth's mean depth around it.
fn sky_visibility_at(at: vec2f, radius: f32, depth: f32, cosine: f32) -> f32 {
    let m = moments_at(depth_map, (at + vec2f(view.corner_x, view.corner_y)) * view.depth_scale);
    return sky_visibility((m.x - depth) / radius, depth - m.x > view.layer, m.z, cosine, SHAPE == RIBBON);
}

// What sun and sky send to the eye from a place whose round surface looks `outward` and has the BRDF `reflected` for the sun.
fn reflected_light(
    material: Material, sun_brdf: vec3f, outward: vec3f, world: vec3f, toward_eye: vec3f, open: f32, occlusion: f32,
) -> vec3f {
    var light = vec3f(0.0);
    let sun_cosine = dot(material.normal, view.toward_sun);
    if sun_cosine > 0.0 && (SHAPE == RIBBON || dot(outward, view.toward_sun) > 0.0) {
        light = sun_brdf * view.sun * (sun_cosine * sun_visibility(world));
    }
    let mirrored = schlick_rough(reflectance(material), dot(material.normal, toward_eye), material.roughness);
    let mirror = reflect(-toward_eye, material.normal);
    // The mean of a gradient over cosine-weighted directions is the gradient two thirds of the way to the normal.
    let above = sky(material.normal * (2.0 / 3.0)) * open + view.interior * (1.0 - open);
    var skylight = diffuse(material, mirrored) * above + mirrored * sky(mirror) * open;
    if SHEEN {
        skylight = skylight * sheen_base_share_under_sky(material.sheen, dot(material.normal, toward_eye))
            + sheen_color(material) * above * sheen_sky_reflectance(material.sheen, material.normal, toward_eye);
    }
    return light + skylight * occlusion;
}

struct Texel {
    albedo: vec3f,
    alpha: f32,
    // Along the yarn, around it, outward.
    normal: vec3f,
    roughness: f32,
    metallic: f32,
    occlusion: f32,
}

const MAX_TAPS = 8.0;

// The maps around a place (0..1 around, repeats along), over a footprint: as many taps along its longer side as its shorter one fits into it,
// as Maps::sample in src/render/maps.rs takes them. Derivatives would do that in hardware, but they jump at a tube's seam, and a software
// driver has none at a triangle's edge.
fn map_texel(place: vec2f, footprint: vec2f) -> Texel {
    let texels = abs(footprint) * vec2f(textureDimensions(base_map));
    let short = max(min(texels.x, texels.y), 1.0);
    let long = max(max(texels.x, texels.y), 1.0);
    let taps = clamp(ceil(long / short), 1.0, MAX_TAPS);
    let level = log2(max(long / taps, short));
    let way = select(vec2f(footprint.x, 0.0), vec2f(0.0, footprint.y), texels.y > texels.x);
    let border = select(0.0, 0.5 / f32(textureDimensions(base_map).y), SHAPE == RIBBON);
    var base = vec4f(0.0);
    var normal = vec3f(0.0);
    var surface = vec3f(0.0);
    for (var tap = 0.0; tap < taps; tap += 1.0) {
        var at = place + way * ((tap + 0.5) / taps - 0.5);
        // A ribbon ends at its edges; a tube goes on around.
        at.y = select(at.y, clamp(at.y, border, 1.0 - border), SHAPE == RIBBON);
        base += textureSampleLevel(base_map, map_sampler, at, level) / taps;
        normal += textureSampleLevel(normal_map, map_sampler, at, level).xyz / taps;
        surface += textureSampleLevel(surface_map, map_sampler, at, level).xyz / taps;
    }
    normal = normal * 2.0 - 1.0;
    // The picture's top is where `around` is 0.
    return Texel(base.rgb, base.a, vec3f(normal.x, -normal.y, normal.z), surface.y, surface.z, surface.x);
}

// The direction in which the round yarn rises that a strip stands for; both arguments of unit length and across each other.
fn front_of_strip(width: vec3f, tangent: vec3f, toward_eye: vec3f) -> vec3f {
    let front = cross(width, tangent);
    return front * sign(dot(front, toward_eye));
}

@fragment
fn shade(in: Surface) -> Light {
    let look = looks[in.look];
    let to_eye = view.eye.xyz - in.world * view.eye.w;
    let eye_distance = length(to_eye);
    let toward_eye = to_eye / eye_distance;
    let tangent = normalize(in.tangent);
    var world = in.world;
    var outward = normalize(in.normal);
    var around = in.side * 0.5 + 0.5;
    if SHAPE == STRIP {
        // The round yarn that the strip stands for.
        let rise = sqrt(max(1.0 - in.side * in.side, 0.0));
        let front_of = front_of_strip(outward, tangent, toward_eye);
        outward = normalize(outward * in.side + front_of * rise);
        world += front_of * ((rise - MEAN_RISE) * in.radius);
    }
    if SHAPE == RIBBON {
        outward *= select(-1.0, 1.0, dot(outward, toward_eye) >= 0.0);
    } else {
        let start = normalize(in.across - tangent * dot(in.across, tangent));
        around = atan2(dot(outward, cross(tangent, start)), dot(outward, start));
    }
    let cosine = dot(outward, toward_eye);
    let footprint = view.pixel * select(1.0, eye_distance, view.eye.w > 0.5);

    let sheen = Sheen(look.sheen, look.fibre_slope, tangent);
    var material = Material(outward, look.albedo, look.roughness, look.metallic, sheen);
    var alpha = 1.0;
    var occlusion = 1.0;
    if MAPS {
        let turn = select(around / TAU, around, SHAPE == RIBBON);
        let girth = in.radius * select(TAU, 2.0, SHAPE == RIBBON);
        let texel = map_texel(vec2f(in.along / look.repeat, turn), footprint / vec2f(look.repeat, girth));
        // A tube is solid: the fuzz that a picture shows beside its yarn has no place on it.
        alpha = select(1.0, texel.alpha, SHAPE == RIBBON);
        occlusion = texel.occlusion;
        // A ribbon's back is its front seen through: only what looks outward turns.
        let sideways = cross(tangent, select(outward, normalize(in.normal), SHAPE == RIBBON));
        let tilted = tangent * texel.normal.x + sideways * texel.normal.y + outward * texel.normal.z;
        material = Material(face_eye(normalize(tilted), toward_eye), texel.albedo, texel.roughness, texel.metallic, sheen);
    } else if SHAPE != RIBBON {
        let detail = ply_detail(YarnPoint(
            outward, toward_eye, tangent, around, in.along, in.radius, footprint, look.plies, look.ply_slope, look.fibre_slope,
        ));
        material.normal = detail.normal;
        material.albedo *= detail.shade;
    }
    if alpha < MIN_ALPHA || (FUZZ && alpha >= SOLID_ALPHA) || (!FUZZ && alpha < SOLID_ALPHA) {
        discard;
    }

    let open = sky_visibility_at(in.clip.xy, in.radius, 1.0 / in.clip.w, cosine);
    let sun_brdf = brdf(material, view.toward_sun, toward_eye);
    let light = reflected_light(material, sun_brdf, outward, world, toward_eye, open, occlusion);

    // Alpha to coverage, done here so that every driver takes the same samples and a solid sample's alpha is 1. Which samples differs from
    // yarn to yarn, or two half-covering ones would leave the same half open.
    let random = mix_bits(in.seed ^ (u32(in.clip.x) << 8u) ^ (u32(in.clip.y) << 20u));
    let taken = (1u << u32(alpha * SAMPLES + f32(random >> 8u) / 16777216.0)) - 1u;
    let turned = random % 4u;
    let solid = select((taken << turned | taken >> (4u - turned)) & 15u, 0xFFFFFFFFu, alpha > 0.99 || !MAPS);
    return Light(vec4f(light, 1.0) * select(1.0, alpha, FUZZ), select(solid, 0xFFFFFFFFu, FUZZ));
}

// For the depth passes of ribbons with maps: what is fuzz neither hides nor shadows.
@fragment
fn discard_fuzz(in: Surface) {
    let place = vec2f(in.along / looks[in.look].repeat, in.side * 0.5 + 0.5);
    if textureSampleLevel(base_map, map_sampler, place, 0.0).a < SOLID_ALPHA {
        discard;
    }
}

// A plain strip of two pixels or so is lit at its points and not at its pixels: where a software driver shades whole blocks of pixels for
// each small triangle, that takes a third of the time. Its edges get the light from .577 of the way to them, so that their mean is that of
// the round yarn (Gauss' quadrature by two points). Plies are too fine to be seen and darken by their mean.
struct Lit {
    @builtin(position) clip: vec4f,
    @location(0) light: vec3f,
}

const GAUSS = 0.577;

@vertex
fn expand_lit(@builtin(vertex_index) vertex: u32, @builtin(instance_index) instance: u32) -> Lit {
    let in = vertex_of(vertex, instance);
    let look = looks[in.look];
    let toward_eye = normalize(view.eye.xyz - in.world * view.eye.w);
    let rise = sqrt(1.0 - GAUSS * GAUSS);
    let front_of = front_of_strip(in.normal, in.tangent, toward_eye);
    let outward = in.normal * (in.side * GAUSS) + front_of * rise;
    // The strip's edge stands MEAN_RISE before the axis.
    let world = in.world + (in.normal * (in.side * (GAUSS - 1.0)) + front_of * (rise - MEAN_RISE)) * in.radius;
    let shade = 1.0 - GROOVE * select(0.0, MEAN_GROOVE, look.plies > 1.0);
    let sheen = Sheen(look.sheen, look.fibre_slope, normalize(in.tangent));
    let material = Material(face_eye(outward, toward_eye), look.albedo * shade, look.roughness, look.metallic, sheen);
    let pixel = (in.clip.xy / in.clip.w * vec2f(0.5, -0.5) + 0.5) * vec2f(view.tile_width, view.tile_height);
    let open = sky_visibility_at(pixel, in.radius, in.clip.w, dot(outward, toward_eye));
    let sun_brdf = base_brdf(material, view.toward_sun, toward_eye);
    var light = reflected_light(material, sun_brdf, outward, world, toward_eye, open, 1.0);
    if SHEEN {
        // That of the whole width, in the sun where the brightest of it is, as far pictures on the processor have it.
        let brightest = sheen_highlight_normal(sheen, view.toward_sun, toward_eye);
        let shone = sun_visibility(world + (brightest - outward) * in.radius);
        light += sheen_color(material) * view.sun * (sheen_mean_over_width(sheen, view.toward_sun, toward_eye) * shone);
    }
    return Lit(in.clip, light);
}

@fragment
fn lit(in: Lit) -> @location(0) vec4f {
    return vec4f(in.light, 1.0);
}

// The light that leaves a yarn toward the eye. Sun: through a variance shadow map (Donnelly and
// Lauritzen 2006, 'Variance shadow maps'). Sky: ambient occlusion from the cloth's own mean depth,
// and from how much its depths vary. Surface: textures or procedural plies.

// Whether this pass draws fuzz: translucent fragments, blended.
override FUZZ: bool = false;
// Whether yarns have textures.
override MAPS: bool = true;
// Alpha from which a fragment is solid. Below it is fuzz, which a pass of its own blends.
const SOLID_ALPHA = 0.5;
// Alpha below which a fragment is dropped, because blending it costs more than it shows.
const MIN_ALPHA = 0.02;
// Chebyshev's bound up to this value counts as full shadow. That hides light bleeding, the light
// that variance shadow maps let through where layers at several depths overlap (Lauritzen 2007,
// 'Summed-area variance shadow maps', section 8.4.3). Higher values narrow penumbras.
const LIGHT_BLEEDING = 0.2;
// Texels to a side at which the slope of a layer is taken: where the picture shows yarns well, a
// standard deviation of the depth map's filter.
const SLOPE_TEXELS = 3;
// Samples per pixel of alpha to coverage.
const SAMPLES = 4.0;

@group(2) @binding(0) var base_map: texture_2d<f32>;
@group(2) @binding(1) var normal_map: texture_2d<f32>;
@group(2) @binding(2) var surface_map: texture_2d<f32>;
@group(2) @binding(3) var map_sampler: sampler;

@group(3) @binding(0) var sun_map: texture_2d<f32>;
@group(3) @binding(1) var depth_map: texture_2d<f32>;

// A fragment's light, and the samples that it covers.
struct Light {
    @location(0) color: vec4f,
    @builtin(sample_mask) samples: u32,
}

// A texel's part in the mean of four, relative to the depth `origin`: weighted first and second
// moment, and the weight.
fn weighted_moments(texel: vec4f, origin: f32, share: f32) -> vec3f {
    let offset = texel.x - origin;
    return share * texel.z * vec3f(offset, offset * offset + texel.y, 1.0);
}

// Mean, variance and cover, interpolated between texels. The hardware's filter would interpolate
// variances, which ignores the differences of the means.
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
    // Any covered texel's depth will do as the origin: it keeps the sums small, so that no digits
    // cancel.
    let origin = max(max(a.x, b.x), max(c.x, d.x));
    let sums = weighted_moments(a, origin, (1.0 - part.x) * (1.0 - part.y))
        + weighted_moments(b, origin, part.x * (1.0 - part.y))
        + weighted_moments(c, origin, (1.0 - part.x) * part.y)
        + weighted_moments(d, origin, part.x * part.y);
    // Law of total variance: E[x^2] - E[x]^2, where x^2 includes each texel's own variance.
    let mean = sums.x / max(sums.z, TINY);
    return vec3f(origin + mean, max(sums.y / max(sums.z, TINY) - mean * mean, 0.0), sums.z);
}

// Visibility of the sun past what lies at least `bias` before a point: Chebyshev's upper bound of
// the fraction of the filtered depths that lie behind the point (Donnelly and Lauritzen 2006, eq.
// 5). A bound up to `bleeding` counts as full shadow.
fn visibility_past(m: vec3f, depth: f32, bias: f32, bleeding: f32) -> f32 {
    let behind = depth - bias - m.x;
    if behind <= 0.0 || m.z <= 0.0 {
        return 1.0;
    }
    // A lower limit of the variance: on flat texels it would be 0, and rounding would decide.
    let variance = max(m.y, view.sun_bias * view.sun_bias);
    let bound = variance / (variance + behind * behind);
    return 1.0 - m.z * (1.0 - saturate((bound - bleeding) / (1.0 - bleeding)));
}

// Visibility of the sun. From afar the map's texels are wider than yarns: only the shadows of
// distant cloth are taken from it, and a mean share stands for the yarns of the same cloth.
fn sun_visibility(world: vec3f) -> f32 {
    let place = view.sun_from_world * vec4f(world, 1.0);
    let m = moments_at(sun_map, place.xy);
    let mapped = visibility_past(m, place.z, view.sun_bias, LIGHT_BLEEDING);
    // Of two layers, the bound is the fraction of the sun that the first one's gaps let through.
    let distant = visibility_past(m, place.z, view.sun_bias + view.layer, 0.0);
    return mix(mapped, view.near_sunshine * distant, view.farness);
}

// Radiance of the sky in a unit direction: a linear gradient.
fn sky(direction: vec3f) -> vec3f {
    return mix(view.sky_below, view.sky_above, 0.5 + 0.5 * dot(direction, view.zenith));
}

// How much deeper the layer lies per texel between two places of the depth map, mm. 0 where either
// shows no yarn or both are one.
fn depth_difference(one: vec2i, other: vec2i) -> f32 {
    let last = vec2i(textureDimensions(depth_map)) - 1;
    let a = clamp(one, vec2i(0), last);
    let b = clamp(other, vec2i(0), last);
    let apart = abs(b.x - a.x) + abs(b.y - a.y);
    let low = textureLoad(depth_map, a, 0);
    let high = textureLoad(depth_map, b, 0);
    let is_known = apart > 0 && min(low.z, high.z) > 0.0;
    return select(0.0, (high.x - low.x) / f32(max(apart, 1)), is_known);
}

// How much deeper the layer lies a texel further along an axis, mm. Of both sides the flatter one
// counts: beyond an outline there is another layer.
fn depth_slope(at: vec2i, step: vec2i) -> f32 {
    let before = depth_difference(at - step, at);
    let behind = depth_difference(at, at + step);
    return select(behind, before, abs(before) < abs(behind));
}

// Visibility of the sky at a depth, from the cloth's depths around it, or from afar by the mean.
fn sky_visibility_at(at: vec2f, radius: f32, depth: f32, cosine: f32) -> f32 {
    let place = (at + vec2f(view.corner_x, view.corner_y)) * view.depth_scale;
    let m = moments_at(depth_map, place);
    let before = m.x - depth;
    let other = -before > view.layer;
    var mapped = 0.0;
    if SHAPE == RIBBON {
        mapped = sky_visibility_of_ribbon(before / radius, other, m.z, cosine);
    } else {
        // A layer that is seen obliquely has other depths at each place. What is left of them
        // without its slope, along its normal, is the relief of its yarns.
        let step = vec2i(SLOPE_TEXELS, 0);
        let slope = vec2f(depth_slope(vec2i(place), step), depth_slope(vec2i(place), step.yx));
        let texel = view.depth_texel * select(1.0, depth, view.eye.w > 0.5);
        let steep = dot(slope, slope) / (texel * texel);
        let spread = sqrt(max(m.y - dot(slope, slope) * view.depth_sigma * view.depth_sigma, 0.0));
        let per_radius = inverseSqrt(1.0 + steep) / radius;
        mapped = sky_visibility(LayerRelief(before * per_radius, spread * per_radius, m.z), other, cosine);
    }
    let mean = saturate(view.near_open.x + view.near_open.y * cosine);
    return mix(mapped, mean, view.farness);
}

// Light of sun and sky reflected to the eye. The tube's own normal is `outward`, and `sun_brdf` is
// the BRDF for the sun.
fn reflected_light(
    material: Material,
    sun_brdf: vec3f,
    outward: vec3f,
    world: vec3f,
    toward_eye: vec3f,
    open: f32,
    occlusion: f32,
) -> vec3f {
    var light = vec3f(0.0);
    let sun_cosine = dot(material.normal, view.toward_sun);
    // The tube's normal must face the sun too. A tilted normal on the dark side would leak light.
    if sun_cosine > 0.0 && (SHAPE == RIBBON || dot(outward, view.toward_sun) > 0.0) {
        light = sun_brdf * view.sun * (sun_cosine * sun_visibility(world));
    }
    let cosine = dot(material.normal, toward_eye);
    let mirrored = schlick_rough(reflectance(material), cosine, material.roughness);
    // The specular part takes the sky's radiance in the mirror direction, times the mean Fresnel
    // term.
    let mirror = reflect(-toward_eye, material.normal);
    // The sky is linear in the direction's height. So its cosine-weighted mean over the hemisphere
    // is its value two thirds of the way from the horizontal to the normal.
    let visible = sky(material.normal * (2.0 / 3.0)) * mix(1.0, view.near_brightness, view.farness);
    let gaps = view.gap_light.x + view.gap_light.y * open + view.gap_to_sun * sun_cosine;
    let above = visible * open + view.on_cloth * gaps * (1.0 - open);
    var skylight = diffuse(material, mirrored) * above + mirrored * sky(mirror) * open;
    if SHEEN {
        skylight = skylight * sheen_base_share_under_sky(material.sheen, cosine)
            + sheen_color(material) * above
                * sheen_sky_reflectance(material.sheen, material.normal, toward_eye);
    }
    return light + skylight * occlusion;
}

// A yarn's surface at one place of its textures.
struct Texel {
    albedo: vec3f,
    alpha: f32,
    // Along the yarn, around it, outward.
    normal: vec3f,
    roughness: f32,
    metallic: f32,
    occlusion: f32,
}

// Limit of anisotropic filtering, as in src/render/maps.rs.
const MAX_TAPS = 8.0;

// The textures at a place (repeats along the yarn, 0..1 around it), averaged over a footprint.
// Anisotropic filtering, as Maps::sample in src/render/maps.rs does it: several lookups along the
// footprint's longer side, at the mip level of the shorter one. Hardware derivatives would do the
// same, but they jump at a tube's seam, and a software driver has none at a triangle's edge.
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
        // A ribbon ends at its edges; a tube wraps around.
        at.y = select(at.y, clamp(at.y, border, 1.0 - border), SHAPE == RIBBON);
        base += textureSampleLevel(base_map, map_sampler, at, level) / taps;
        normal += textureSampleLevel(normal_map, map_sampler, at, level).xyz / taps;
        surface += textureSampleLevel(surface_map, map_sampler, at, level).xyz / taps;
    }
    normal = normal * 2.0 - 1.0;
    // The picture's top is where `around` is 0, so its y axis is reversed.
    let flipped = vec3f(normal.x, -normal.y, normal.z);
    return Texel(base.rgb, base.a, flipped, surface.y, surface.z, surface.x);
}

// The shaded fragment of a yarn.
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
    // Interpolation leaves the section not quite across the yarn.
    let oval = in.oval - tangent * dot(in.oval, tangent);
    var circle = outward;
    // An impostor: restore the tube's normal and position from the place across the strip.
    if SHAPE == STRIP {
        let front_of = front_of_strip(outward, tangent, toward_eye);
        let place = surface_place(oval, outward, front_of, in.side, in.radius);
        world += strip_to_axis(oval, outward, front_of, in.side, in.radius) + place.offset;
        outward = place.outward;
        circle = place.circle;
    } else if FLATTENED {
        circle = normalize(grown(oval, outward));
    }
    if SHAPE == RIBBON {
        outward *= select(-1.0, 1.0, dot(outward, toward_eye) >= 0.0);
    } else {
        // Orthogonalise: interpolation leaves the frame's vectors not quite perpendicular.
        let start = normalize(in.across - tangent * dot(in.across, tangent));
        around = atan2(dot(circle, cross(tangent, start)), dot(circle, start));
    }
    let cosine = dot(outward, toward_eye);
    // Size of a pixel here, mm. An eye at infinity has w = 0.
    let footprint = view.pixel * select(1.0, eye_distance, view.eye.w > 0.5);

    let sheen = Sheen(look.sheen, look.fibre_slope, tangent);
    var material = Material(outward, look.albedo, look.roughness, look.metallic, sheen);
    var alpha = 1.0;
    var occlusion = 1.0;
    if MAPS {
        let turn = select(around / TAU, around, SHAPE == RIBBON);
        let girth = in.radius * select(TAU, 2.0, SHAPE == RIBBON);
        let place = vec2f(in.along / look.repeat, turn);
        let texel = map_texel(place, footprint / vec2f(look.repeat, girth));
        // A tube is solid: the fuzz that a photo shows beside its yarn has no place on it.
        alpha = select(1.0, texel.alpha, SHAPE == RIBBON);
        occlusion = texel.occlusion;
        // A ribbon's back shows its front from behind: only the outward direction is reversed.
        let sideways = cross(tangent, select(outward, normalize(in.normal), SHAPE == RIBBON));
        let n = texel.normal;
        let tilted = tangent * n.x + sideways * n.y + outward * n.z;
        let normal = face_eye(normalize(tilted), toward_eye);
        material = Material(normal, texel.albedo, texel.roughness, texel.metallic, sheen);
    } else if SHAPE != RIBBON {
        // Twist turns by the length of the yarn, however thick the yarn is there.
        let detail = ply_detail(YarnPoint(
            outward, toward_eye, tangent, around, in.along, look.radius, footprint,
            look.plies, look.ply_slope, look.fibre_slope,
        ));
        material.normal = detail.normal;
        material.albedo *= detail.shade;
    }
    material.albedo *= in.lightness;
    // This pass draws either solid fragments or fuzz.
    if alpha < MIN_ALPHA || (FUZZ && alpha >= SOLID_ALPHA) || (!FUZZ && alpha < SOLID_ALPHA) {
        discard;
    }

    let open = sky_visibility_at(in.clip.xy, sky_radius(oval, in.radius), 1.0 / in.clip.w, cosine);
    let sun_brdf = brdf(material, view.toward_sun, toward_eye);
    let light = reflected_light(material, sun_brdf, outward, world, toward_eye, open, occlusion);

    // Alpha to coverage, computed here so that every driver chooses the same samples, and so that
    // the colour of a solid sample has alpha 1. Rounding is stochastic. A hash of the yarn and the
    // pixel rotates the samples, or two half-covering yarns would leave the same half open.
    let random = mix_bits(in.seed ^ (u32(in.clip.x) << 8u) ^ (u32(in.clip.y) << 20u));
    let taken = (1u << u32(alpha * SAMPLES + f32(random >> 8u) / 16777216.0)) - 1u;
    let turned = random % 4u;
    let some = (taken << turned | taken >> (4u - turned)) & 15u;
    let solid = select(some, 0xFFFFFFFFu, alpha > 0.99 || !MAPS);
    return Light(vec4f(light, 1.0) * select(1.0, alpha, FUZZ), select(solid, 0xFFFFFFFFu, FUZZ));
}

// Depth passes of ribbons with textures: fuzz neither occludes nor casts shadows.
@fragment
fn discard_fuzz(in: Surface) {
    let place = vec2f(in.along / looks[in.look].repeat, in.side * 0.5 + 0.5);
    if textureSampleLevel(base_map, map_sampler, place, 0.0).a < SOLID_ALPHA {
        discard;
    }
}

// Light per vertex, for plain strips up to two pixels or so wide. A software driver shades whole
// blocks of pixels for each small triangle; light per vertex takes a third of the time. The
// vertices at the edges get the light from 0.577 of the way to them. So their mean is that of the
// round yarn (Gauss-Legendre quadrature with two points). Plies are too fine to show and darken the
// yarn by their mean.
struct Lit {
    @builtin(position) clip: vec4f,
    // A pixel's centre may lie far outside of a thin strip, where extrapolated light would be a
    // speck.
    @location(0) @interpolate(perspective, centroid) light: vec3f,
}

// Node of the quadrature, 1 / sqrt(3).
const GAUSS = 0.577;

@vertex
fn expand_lit(@builtin(vertex_index) vertex: u32, @builtin(instance_index) instance: u32) -> Lit {
    let in = vertex_of(vertex, instance);
    let look = looks[in.look];
    let toward_eye = normalize(view.eye.xyz - in.world * view.eye.w);
    let front_of = front_of_strip(in.normal, in.tangent, toward_eye);
    let place = surface_place(in.oval, in.normal, front_of, in.side * GAUSS, in.radius);
    let outward = place.outward;
    // The strip's vertices stand MEAN_RISE before the axis, at its edges; move to the point of the
    // tube at the node.
    let axis = in.world + strip_to_axis(in.oval, in.normal, front_of, in.side, in.radius);
    let world = axis + place.offset;
    let shade = in.lightness * (1.0 - GROOVE * select(0.0, MEAN_GROOVE, look.plies > 1.0));
    let sheen = Sheen(look.sheen, look.fibre_slope, normalize(in.tangent));
    let normal = face_eye(outward, toward_eye);
    let material = Material(normal, look.albedo * shade, look.roughness, look.metallic, sheen);
    let tile_size = vec2f(view.tile_width, view.tile_height);
    let pixel = (in.clip.xy / in.clip.w * vec2f(0.5, -0.5) + 0.5) * tile_size;
    let radius = sky_radius(in.oval, in.radius);
    let open = sky_visibility_at(pixel, radius, in.clip.w, dot(outward, toward_eye));
    let sun_brdf = base_brdf(material, view.toward_sun, toward_eye);
    var light = reflected_light(material, sun_brdf, outward, world, toward_eye, open, 1.0);
    if SHEEN {
        // The sheen's mean over the width, with one shadow lookup at its brightest line, as in the
        // CPU renderer's splatting.
        let brightest = sheen_highlight_normal(sheen, view.toward_sun, toward_eye);
        let sun_share = sun_visibility(axis + place_facing(in.oval, brightest, in.radius));
        let shine = sheen_mean_over_width(sheen, view.toward_sun, toward_eye);
        light += sheen_color(material) * view.sun * (shine * sun_share);
    }
    return Lit(in.clip, light);
}

@fragment
fn lit(in: Lit) -> @location(0) vec4f {
    return vec4f(in.light, 1.0);
}

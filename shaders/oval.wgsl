// Elliptic sections of flattened yarns: crates/warpknit-render/src/oval.rs, which says what the
// vector q is. A round section has q = 0.

// Whether yarns are flattened.
override FLATTENED: bool = false;

// Three signed numbers of ten bits.
fn unpack_oval(bits: u32) -> vec3f {
    let signed = bitcast<i32>(bits);
    let parts = vec3i(extractBits(signed, 0u, 10u), extractBits(signed, 10u, 10u),
        extractBits(signed, 20u, 10u));
    return vec3f(parts) / 511.0;
}

// The shorter half-axis over the longer one.
fn shrinking(q: vec3f) -> f32 {
    return 1.0 - dot(q, q);
}

// A vector in the space where the section is a circle.
fn shrunk(q: vec3f, v: vec3f) -> vec3f {
    return v - q * dot(q, v);
}

// The reverse.
fn grown(q: vec3f, v: vec3f) -> vec3f {
    return v + q * (dot(q, v) / shrinking(q));
}

// The shorter half-axis of a yarn of this radius.
fn half_height(q: vec3f, radius: f32) -> f32 {
    if !FLATTENED {
        return radius;
    }
    return radius * sqrt(shrinking(q));
}

// The radius in which the relief around a flattened yarn counts for its sky: the longer
// half-axis. Wide yarns leave wide gaps, which show more sky at the same depth.
fn sky_radius(q: vec3f, radius: f32) -> f32 {
    if !FLATTENED {
        return radius;
    }
    return radius / sqrt(shrinking(q));
}

// A yarn's section as a viewer sees it.
struct Section {
    // Half of the width that is seen, and the rise toward the viewer, mm.
    half_width: f32,
    rise: f32,
}

// The section across a unit direction of the width and one toward the viewer, for a yarn of this
// radius.
fn section_seen(q: vec3f, width: vec3f, front: vec3f, radius: f32) -> Section {
    if !FLATTENED {
        return Section(radius, radius);
    }
    let s = shrinking(q);
    let half = half_height(q, radius);
    let share = dot(q, width) / s;
    let wide = sqrt(1.0 + (1.0 + s) * share * share);
    // A yarn without a direction has no front.
    let away = length(shrunk(q, front));
    return Section(half * wide, select(half, half / max(away, 1e-6), away > 0.0));
}

// A place on the surface of a yarn.
struct SurfacePlace {
    // From the axis, mm.
    offset: vec3f,
    // Unit normal.
    outward: vec3f,
    // The same where the section is a circle: angles around the yarn count there.
    circle: vec3f,
}

// The place that a viewer sees from -1 to 1 between the outlines.
fn surface_place(q: vec3f, width: vec3f, front: vec3f, side: f32, radius: f32) -> SurfacePlace {
    let rise = sqrt(max(1.0 - side * side, 0.0));
    if !FLATTENED {
        let outward = normalize(width * side + front * rise);
        return SurfacePlace(outward * radius, outward, outward);
    }
    let circle = unit(grown(q, width)) * side + unit(shrunk(q, front)) * rise;
    let half = half_height(q, radius);
    return SurfacePlace(grown(q, circle) * half, unit(shrunk(q, circle)), circle);
}

// Where the surface faces a unit direction across the yarn, from the axis, mm.
fn place_facing(q: vec3f, normal: vec3f, radius: f32) -> vec3f {
    if !FLATTENED {
        return normal * radius;
    }
    return grown(q, unit(grown(q, normal))) * half_height(q, radius);
}

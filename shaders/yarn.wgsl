// Expansion of yarns from their points, in the vertex shader: tubes with a given number of edges,
// strips that face the eye and stand for distant tubes (impostors), and ribbons in the fabric's
// plane.
//
//     ring k+1  3───4───5 ─ 3     An instance is eight steps of one chunk, and a step is `stride`
//               │ ╲ │ ╲ │ ╲ │     points long. That makes nine rings. Vertices are numbered ring
//     ring k    0───1───2 ─ 0     by ring, `edges` a ring (two for strips and ribbons). All
//                                 instances share one index buffer.
//
// Only points are stored. Expanding them here was measured as fast as stored vertices, and takes a
// fortieth of the memory. Beyond a chunk's end, rings coincide with its last one, and their
// triangles have no area.

override SHAPE: u32 = 0u;
const TUBE = 0u;
const STRIP = 1u;
const RIBBON = 2u;

const TAU = 6.283185307179586;
// Steps of an instance, and instances of a full chunk at stride 1.
const STEPS = 8u;
const PARTS = 32u;
// Limit of the widening of a step, against steps of no length. Steps keep most of the yarn's length.
const MAX_WIDENING = 3.0;
// Limit of the widening at a mitre joint. Sharper turns have a bevel: a mitre would be a spike.
const MAX_MITRE = 3.0;
// Largest difference from 1 of the factors on a yarn's radius and on its base colour.
const MOST_UNEVEN = 0.25;
// Places along a chunk that have a thickness of their own.
const KNOTS = 8u;
// Mean height of a tube over its axis toward the eye, pi / 4 radii. The strip that stands for the
// tube lies there.
const MEAN_RISE = 0.785;

struct Chunk {
    first: u32,
    // Number of pieces; the chunk has one more point.
    count: u32,
    look: u32,
    // Share of MOST_UNEVEN by which the yarn is lighter, a signed byte.
    lightness: u32,
    // The same for its thickness at KNOTS even places from the chunk's start to its end.
    thickness: vec2u,
}

struct Draw {
    // Where the instances of this draw begin in `parts`.
    first: u32,
    stride: u32,
    edges: u32,
    spare: u32,
}

// Position and arc length, mm.
@group(1) @binding(0) var<storage, read> points: array<vec4f>;
// Packed unit vectors: the tangent, and a direction across it. For tubes angles count from that,
// for ribbons it is the fabric's normal.
@group(1) @binding(1) var<storage, read> tangent_frames: array<vec2u>;
@group(1) @binding(2) var<storage, read> chunks: array<Chunk>;
// Chunk times PARTS plus the part.
@group(1) @binding(3) var<storage, read> parts: array<u32>;
@group(1) @binding(4) var<uniform> draw: Draw;
// Sections, packed, where yarns are flattened.
@group(1) @binding(5) var<storage, read> ovals: array<u32>;

// Interpolants. Centroid sampling: at an edge, the pixel's centre may lie outside of the triangle,
// where extrapolated normals would be wrong. `@invariant` makes the depths of the pre-pass and the
// light pass equal.
struct Surface {
    @builtin(position) @invariant clip: vec4f,
    @location(0) @interpolate(perspective, centroid) world: vec3f,
    // Of tubes and ribbons the normal, of strips the direction of their width.
    @location(1) @interpolate(perspective, centroid) normal: vec3f,
    @location(2) @interpolate(perspective, centroid) tangent: vec3f,
    @location(3) @interpolate(perspective, centroid) across: vec3f,
    @location(4) @interpolate(perspective, centroid) along: f32,
    // From one edge of a strip or ribbon to the other, -1 to 1.
    @location(5) @interpolate(perspective, centroid) side: f32,
    // Of flattened yarns that of the circle of the same area.
    @location(6) @interpolate(perspective, centroid) radius: f32,
    @location(7) @interpolate(flat, either) look: u32,
    // Differs from chunk to chunk.
    @location(8) @interpolate(flat, either) seed: u32,
    // Factor on the base colour.
    @location(9) @interpolate(flat, either) lightness: f32,
    // The vector q of the section, see oval.wgsl.
    @location(10) @interpolate(perspective, centroid) oval: vec3f,
}

// Octahedral decoding of a unit vector (Meyer et al. 2010, 'On floating-point normal vectors').
fn unpack_unit(bits: u32) -> vec3f {
    let flat = unpack2x16snorm(bits);
    let z = 1.0 - abs(flat.x) - abs(flat.y);
    let folded = (1.0 - abs(flat.yx)) * select(vec2f(-1.0), vec2f(1.0), flat >= vec2f(0.0));
    return normalize(vec3f(select(folded, flat, z >= 0.0), z));
}

// The points that a step goes to before and after a point of a chunk. At its ends they are the same.
fn neighbours(at: u32, chunk: Chunk) -> vec2u {
    let low = max(at, chunk.first + draw.stride) - draw.stride;
    return vec2u(low, min(at + draw.stride, chunk.first + chunk.count));
}

// Factor on the radius so that a chord covers the same area as the winding path that it replaces:
// arc length over chord length.
fn widening(at: u32, near: vec2u) -> f32 {
    if draw.stride == 1u {
        return 1.0;
    }
    let here = points[at].xyz;
    let chords = distance(points[near.x].xyz, here) + distance(here, points[near.y].xyz);
    return clamp((points[near.y].w - points[near.x].w) / max(chords, 1e-6), 1.0, MAX_WIDENING);
}

// The joint of a strip's steps at a point: its unit direction across, in the plane that faces the eye,
// times a factor on the radius. A mitre joint keeps a step's width where the strip turns, as joints
// along the curve's tangents don't: seen from afar, cloth would lose a third of its cover.
fn mitre(at: u32, near: vec2u, toward: vec3f) -> vec3f {
    let here = points[at].xyz;
    let before = cross(here - points[near.x].xyz, toward);
    let after = cross(points[near.y].xyz - here, toward);
    // At an end of the chunk, and beside a step of no length, there is one step.
    let steps = f32(dot(before, before) > 0.0) + f32(dot(after, after) > 0.0);
    let middle = unit(before) + unit(after);
    let share = length(middle) / max(steps, 1.0);
    let bevel = select(unit(after), unit(before), dot(before, before) > 0.0);
    return select(bevel, unit(middle) / max(share, 1e-3), share * MAX_MITRE >= 1.0);
}

// The direction of a strip at a point: the mean of its steps. Their light is that of the straight
// steps, as they hide others and cast shadows; the curve's tangent would light surfaces that they
// do not have.
fn along_steps(at: u32, near: vec2u) -> vec3f {
    let here = points[at].xyz;
    let mean = unit(here - points[near.x].xyz) + unit(points[near.y].xyz - here);
    return select(unpack_unit(tangent_frames[at].x), normalize(mean), dot(mean, mean) > 1e-6);
}

// A unit vector, or zero.
fn unit(v: vec3f) -> vec3f {
    return select(vec3f(0.0), normalize(v), dot(v, v) > 0.0);
}

// The unit direction, across the yarn toward the eye, in which the tube that a strip stands for
// bulges.
fn front_of_strip(width: vec3f, tangent: vec3f, toward_eye: vec3f) -> vec3f {
    let front = unit(cross(width, tangent));
    return front * sign(dot(front, toward_eye));
}

// From a strip's point, at a place across it, to the yarn's axis.
fn strip_to_axis(oval: vec3f, width: vec3f, front: vec3f, side: f32, radius: f32) -> vec3f {
    let seen = section_seen(oval, width, front, radius);
    return -(width * (side * seen.half_width) + front * (MEAN_RISE * seen.rise));
}

// Factor on the radius at one of the places along a chunk that have their own.
fn knot(chunk: Chunk, number: u32) -> f32 {
    let word = select(chunk.thickness.x, chunk.thickness.y, number >= 4u);
    return 1.0 + MOST_UNEVEN * unpack4x8snorm(word)[number % 4u];
}

// Factor on the radius at a share of the way along a chunk.
fn thickness(chunk: Chunk, share: f32) -> f32 {
    let place = share * f32(KNOTS - 1u);
    let low = min(u32(place), KNOTS - 2u);
    return mix(knot(chunk, low), knot(chunk, low + 1u), place - f32(low));
}

// Expands one vertex of an instance.
fn vertex_of(vertex: u32, instance: u32) -> Surface {
    let part = parts[draw.first + instance];
    let chunk = chunks[part / PARTS];
    let look = looks[chunk.look];
    let step = (part % PARTS) * STEPS + vertex / draw.edges;
    // Steps beyond the chunk's end stay at its last point, so that their triangles have no area.
    let at = chunk.first + min(step * draw.stride, chunk.count);
    let tangent = unpack_unit(tangent_frames[at].x);
    let across = unpack_unit(tangent_frames[at].y);
    let centre = points[at].xyz;

    var out: Surface;
    out.tangent = tangent;
    out.across = across;
    out.along = points[at].w;
    let share = f32(at - chunk.first) / f32(chunk.count);
    let near = neighbours(at, chunk);
    out.radius = look.radius * thickness(chunk, share) * widening(at, near);
    out.lightness = 1.0 + MOST_UNEVEN * unpack4x8snorm(chunk.lightness).x;
    out.look = chunk.look;
    out.seed = part / PARTS;
    out.oval = vec3f(0.0);
    if FLATTENED {
        out.oval = unpack_oval(ovals[at]);
    }
    let edge = f32(vertex % draw.edges);
    var joint: vec3f;
    if SHAPE == TUBE {
        // A tube: a regular polygon around the axis, in the tangent frame.
        let angle = TAU * edge / f32(draw.edges);
        let start = normalize(across - tangent * dot(across, tangent));
        out.normal = start * cos(angle) + cross(tangent, start) * sin(angle);
        var outward = out.normal * out.radius;
        if FLATTENED {
            outward = grown(out.oval, out.normal) * half_height(out.oval, out.radius);
            out.normal = normalize(shrunk(out.oval, out.normal));
        }
        out.side = 0.0;
        // Corners lie so far out that the polygon hides as much as a circle: both have the same
        // perimeter, and with it the same mean width (Cauchy).
        let half = 0.5 * TAU / f32(draw.edges);
        out.world = centre + outward * (half / sin(half));
        joint = out.world;
    } else {
        out.side = edge * 2.0 - 1.0;
        // A strip faces the eye. A ribbon lies in the fabric's plane, across its normal.
        let toward = view.eye.xyz - centre * view.eye.w;
        let width = select(unit(cross(tangent, across)), mitre(at, near, toward), SHAPE == STRIP);
        joint = centre + width * (out.side * out.radius);
        out.normal = across;
        out.world = joint;
        if SHAPE == STRIP {
            // Lit where the round yarn is, and drawn where the joint is.
            out.normal = unit(width);
            out.tangent = along_steps(at, near);
            out.oval -= out.tangent * dot(out.oval, out.tangent);
            let front = front_of_strip(out.normal, out.tangent, toward);
            let seen = section_seen(out.oval, out.normal, front, out.radius);
            let rise = normalize(toward) * (MEAN_RISE * seen.rise);
            out.world = centre + out.normal * (out.side * seen.half_width) + rise;
            joint = centre + width * (out.side * seen.half_width) + rise;
        }
    }
    out.clip = view.clip_from_world * vec4f(joint, 1.0);
    return out;
}

@vertex
fn expand(@builtin(vertex_index) vertex: u32, @builtin(instance_index) instance: u32) -> Surface {
    return vertex_of(vertex, instance);
}

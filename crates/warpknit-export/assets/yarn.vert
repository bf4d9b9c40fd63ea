#version 300 es
// A vertex of a yarn: a ribbon that faces the eye (two sides), or a tube of more sides.
//
// There are no vertex buffers. `gl_VertexID` gives a ring and a side of it, and the ring's place is a point
// of the curve through the yarn's data points, which lie in a texture. The curve is the centripetal
// Catmull-Rom spline of warpknit (Barry and Goldman 1988; Yuksel, Schaefer and Keyser 2009).
precision highp float;
precision highp int;
precision highp usampler2D;

const uint END = 256u;                // this flag marks the entries that fill up a strand behind its last point

uniform usampler2D points;            // x, y, z on the grid; height 0 to 255 and the flag
uniform sampler2D directions;         // octahedral: the cloth's normal, and the first direction of a tube's ring
uniform mat4 clip;
uniform vec3 eye, low;                // mm from the cloth's middle
uniform float grid, radius, pixel;    // mm; mm; mm a pixel has at a distance of 1 mm
uniform float twist;                  // radians an entry
uniform vec2 heights;                 // mm of depth at 0 and at 255
uniform float opacity;                // of a ribbon: the yarn's width over its own
uniform ivec3 shape;                  // first entry; rings an entry; sides. Of an area: 1, or 0 for a disc; 1; its paint

out vec3 sight, side, front, along, cloth;
out float across, height, size, around, phase;

uvec4 entry(int at) { return texelFetch(points, ivec2(at & 2047, at >> 11), 0); }
vec4 direction(int at) { return texelFetch(directions, ivec2(at & 2047, at >> 11), 0); }
vec3 place(uvec4 e) { return low + grid * vec3(e.xyz); }
vec3 unit(vec2 flattened) {
  vec3 v = vec3(flattened, 1. - abs(flattened.x) - abs(flattened.y));
  float fold = max(-v.z, 0.);
  return normalize(v - vec3(v.x < 0. ? -fold : fold, v.y < 0. ? -fold : fold, 0.));
}
float interval(vec3 chord) { return sqrt(max(length(chord), 1e-6)); }
// The curve's slope where one chord ends and the next begins, by its knot parameter.
vec3 slope(vec3 a, vec3 b) {
  float i = interval(a), j = interval(b);
  return a / i + b / j - (a + b) / (i + j);
}

void main() {
  int sides = shape.z, ring, corner;
  if (sides <= 0) {                   // a fan of 64 triangles behind everything: a disc, or more than the viewport
    float turn = 6.2831853 * float(gl_VertexID - 1) / 64., reach = shape.x == 1 ? 1.5 : 1.;
    gl_Position = vec4(gl_VertexID == 0 ? vec2(0) : reach * vec2(cos(turn), sin(turn)), 1., 1.);
    return;
  }
  if (sides == 2) {
    ring = gl_VertexID >> 1;
    corner = gl_VertexID & 1;
  } else {                            // a strip around each segment, from ring to ring
    int turn = 2 * sides + 2, segment = gl_VertexID / turn, at = gl_VertexID - segment * turn;
    ring = segment + (at & 1);
    corner = at >> 1;
  }
  int at = shape.x + ring / shape.y;
  float t = float(ring % shape.y) / float(shape.y);
  uvec4 e = entry(at), next = entry(at + 1);
  // Between strands a ribbon's vertices coincide, first with a corner of the last ring, then with one of the next
  // strand's first ring. So its triangles have no area there.
  if (sides == 2 && (e.w >= END || t > 0. && next.w >= END)) {
    bool is_behind = e.w < END || corner == 0 && t == 0.;
    if (e.w >= END) at += is_behind ? -1 : 1;
    corner = is_behind ? 1 : 0;
    t = 0.;
    e = entry(at);
    next = entry(at + 1);
  }
  uvec4 before = entry(max(at - 1, 0));
  bool ends = next.w >= END;

  vec3 p = place(e), chord = place(next) - p;
  // Beyond its ends a strand goes on as it came.
  vec3 came = before.w >= END ? chord : p - place(before);
  if (ends) chord = came;
  float step = interval(chord), level = float(e.w & 255u);
  vec3 m = slope(came, chord) * step;
  vec4 here = direction(at);
  vec3 first = vec3(0);
  if (sides > 2) first = unit(here.zw);
  along = m;
  cloth = unit(here.xy);
  // Tubes are closed: a ring without width stands behind the last one of a strand and before the first one. Those
  // between them have no width either.
  int cap = 0;
  if (t > 0.) {
    uvec4 after = entry(at + 2);
    vec3 goes = ends || after.w >= END ? chord : place(after) - place(next);
    vec3 n = slope(chord, goes) * step, a = m + n - 2. * chord, b = 3. * chord - 2. * m - n;
    p += ((a * t + b) * t + m) * t;
    along = (3. * a * t + 2. * b) * t + m;
    vec4 there = direction(ends ? at : at + 1);
    cloth = mix(cloth, unit(there.xy), t);
    first = mix(first, unit(there.zw), t);
    level = mix(level, float((ends ? e : next).w & 255u), t);
    if (sides > 2 && e.w < END && ends) cap = 1;
    if (sides > 2 && e.w >= END && !ends && ring % shape.y == shape.y - 1) {
      cap = -1;
      p = place(next);
      along = place(after) - p;
    }
  }
  along = normalize(along + 1e-9);
  phase = twist * (float(at & 4095) + t);
  height = mix(heights.x, heights.y, level / 255.);
  sight = p - eye;
  float dot_size = pixel * length(sight);
  size = radius / dot_size;

  float width = radius;
  around = 0.;
  across = 0.;
  if (sides == 2) {
    side = normalize(cross(along, sight) + 1e-9 * cloth);
    front = cross(along, side);
    front *= dot(front, sight) > 0. ? -1. : 1.;
    across = float(2 * corner - 1);
    // Yarns that are far behind what is looked at would still break up into dots.
    width = max(radius / opacity, .45 * dot_size);
    p += width * across * side;
  } else {
    first = normalize(first - along * dot(first, along));
    around = 6.2831853 * float(corner) / float(sides);
    side = cos(around) * first + sin(around) * cross(along, first);
    if (cap != 0) side = float(cap) * along;
    else if (e.w < END) p += radius * side;
    front = side;
  }
  gl_Position = clip * vec4(p, 1.);
}

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
uniform ivec3 shape;                  // first entry; rings an entry; sides

out vec3 sight, side, front, along, cloth;
out float across, height, gone, size, around, phase;

uvec4 entry(int at) { return texelFetch(points, ivec2(at & 2047, at >> 11), 0); }
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
  if (sides == 0) {                   // a triangle over the whole window, behind everything
    gone = 0.;
    gl_Position = vec4(4. * vec2(gl_VertexID & 1, gl_VertexID >> 1) - 1., 1., 1.);
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
  uvec4 e = entry(at), next = entry(at + 1), before = entry(at - 1), after = entry(at + 2);
  bool ends = next.w >= END;
  gone = e.w >= END || ends && t > 0. ? 1. : 0.;

  vec3 p = place(e), chord = place(next) - p;
  // Beyond its ends a strand goes on as it came.
  vec3 came = before.w >= END ? chord : p - place(before);
  if (ends) chord = came;
  vec3 goes = ends || after.w >= END ? chord : place(after) - place(next);
  float step = interval(chord);
  vec3 m = slope(came, chord) * step, n = slope(chord, goes) * step;
  vec3 a = m + n - 2. * chord, b = 3. * chord - 2. * m - n;
  p += ((a * t + b) * t + m) * t;
  along = normalize((3. * a * t + 2. * b) * t + m + 1e-9);
  phase = twist * (float(at & 4095) + t);
  // Tubes are closed: a ring without width stands behind the last one of a strand and before the first one.
  int cap = 0;
  if (sides > 2 && e.w < END && ends && t > 0.) cap = 1;
  if (sides > 2 && e.w >= END && !ends && ring % shape.y == shape.y - 1) {
    cap = -1;
    p = place(next);
    along = normalize(place(after) - p + 1e-9);
  }
  if (cap != 0) gone = 0.;

  vec4 here = texelFetch(directions, ivec2(at & 2047, at >> 11), 0);
  int then = ends ? at : at + 1;
  vec4 there = texelFetch(directions, ivec2(then & 2047, then >> 11), 0);
  cloth = mix(unit(here.xy), unit(there.xy), t);
  height = mix(heights.x, heights.y, mix(float(e.w & 255u), float((ends ? e : next).w & 255u), t) / 255.);
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
    // Yarns thinner than a pixel would break up into dots.
    width = max(radius, .6 * dot_size);
    p += width * across * side;
  } else {
    vec3 first = mix(unit(here.zw), unit(there.zw), t);
    first = normalize(first - along * dot(first, along));
    around = 6.2831853 * float(corner) / float(sides);
    side = cos(around) * first + sin(around) * cross(along, first);
    if (cap != 0) side = float(cap) * along;
    else p += radius * side;
    front = side;
  }
  gl_Position = clip * vec4(p, 1.);
}

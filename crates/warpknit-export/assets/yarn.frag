#version 300 es
// The light on a yarn. Lambert's law around a lamp over the viewer's shoulder, a highlight along the fibres
// (Kajiya and Kay 1989) and their sheen at grazing angles. Self-occlusion is not traced: a place is darker the
// deeper it lies in the cloth's thickness, seen from the side that faces the eye, and at the flanks of yarns.
precision highp float;

uniform vec3 color, lamp, sky;        // linear; directions
uniform vec3 colorsFromAfar[2];       // means of what is seen of the front and of the back, linear
uniform float repeat;                 // the longer side of the fabric's repeat, mm
uniform vec2 heights;                 // mm of depth at the back and the face of the cloth
uniform float closed;                 // 1 for cloth whose yarns hide the sky from each other, 0 for one yarn alone
uniform float radius;
uniform int sides;
uniform float opacity;                // alpha of light that fills an area
uniform highp sampler2D picture;      // linear light, and how much of the ground's light it stops
uniform vec3 ground;                  // linear

// How light closed cloth is in its depth, how light a place of it is from afar, and how much of the difference
// between places is left out there.
const float DEEP_OPEN = .22, FAR_OPEN = .62, FAR_SHARE = .8;

in vec3 sight, side, front, along, cloth;
in float across, height, size, around, phase;
out vec4 result;

// Products: `pow` is slow where a processor takes the card's place.
float power24(float x) {
  float x2 = x * x, x4 = x2 * x2, x8 = x4 * x4;
  return x8 * x8 * x8;
}

void main() {
  if (sides == 0) {                   // the loupe's ground, or what lets light through
    result = vec4(0, 0, 0, opacity);
    return;
  }
  if (sides < 0) {                    // the finished picture over the ground, with the display's transfer curve
    vec4 seen = texelFetch(picture, ivec2(gl_FragCoord.xy), 0);
    result = vec4(pow(seen.rgb + (1. - seen.a) * ground, vec3(1. / 2.2)), 1.);
    return;
  }
  vec3 v = -normalize(sight), c = normalize(cloth), f = normalize(along);
  vec3 n = sides == 2 ? normalize(across * side + sqrt(max(0., 1. - across * across)) * front) : normalize(side);
  float facing = dot(c, v) < 0. ? -1. : 1.;
  float depth = (height + radius * dot(n, c) - heights.x) / (heights.y - heights.x);
  if (facing < 0.) depth = 1. - depth;
  // From afar a pixel shows many yarns: their mean is lit like the cloth, and as open as it is on the whole. Which of
  // them a pixel's samples meet would make bands that are not there.
  float near = smoothstep(.25, 1.1, size);
  vec3 lit = normalize(mix(facing * c, n, .3 + .7 * near));

  float open = mix(mix(DEEP_OPEN, 1., smoothstep(.05, .95, depth)), FAR_OPEN, FAR_SHARE * (1. - near));
  open = mix(1., open, closed);
  open *= mix(1., .62 + .38 * smoothstep(0., .75, dot(n, v)), near);
  // Nor does a pixel show which yarns a small repeat is made of. Stripes of a large one stay.
  float mixed = (1. - smoothstep(.2, .6, size)) * (1. - smoothstep(8., 16., repeat * size / radius));
  vec3 base = mix(color, colorsFromAfar[facing < 0. ? 1 : 0], mixed);
  float key = max(0., (dot(lit, lamp) + .18) / 1.18);
  float dome = .5 + .5 * dot(lit, sky);
  vec3 h = normalize(lamp + v);
  float fibre = dot(f, h), shine = power24(max(0., 1. - fibre * fibre)) * max(0., dot(n, h));
  float rim = 1. - max(0., dot(n, v)), sheen = rim * rim * rim;
  // Two plies, and the filaments in them, show once a yarn is some pixels wide.
  float filament = 0.;
  if (size > 1.5) {
    float turn = sides == 2 ? 1.5708 + asin(clamp(across, -1., 1.)) : around;
    float ply = sin(2. * turn + phase) * smoothstep(1.5, 4., size), hollow = .5 - .5 * ply;
    filament = sin(15. * turn + 6. * phase) * smoothstep(5., 12., size);
    open *= 1. - .16 * hollow * hollow;
  }
  vec3 light = base * (1. + .05 * filament) * open * (.92 * key + .34 * dome)
    + open * (base * .22 * sheen * dome + vec3(.10) * shine * near * key);
  // A soft shoulder keeps white yarns from running out.
  result = vec4(light / (1. + .18 * max(light.r, max(light.g, light.b))), 1.);
}

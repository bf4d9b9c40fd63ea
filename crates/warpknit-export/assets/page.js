// Shows the yarns of a cloth: unpacks their centre lines, and lets the graphics card make ribbons and tubes of them.
//
// In: the page's elements `cloth` (JSON) and `data` (base64 of deflated planes of bytes, as src/html_lines.rs lays
// them out), and the shaders. `document.body.dataset` tells what was done: `first` is the time of the first picture,
// a coarse one, ms from the start of this script, `frames` counts pictures, `error` is WebGL's error at the first one.
'use strict';
(async () => {
const started = performance.now();
const $ = id => document.getElementById(id);
const cloth = JSON.parse($('cloth').textContent), canvas = $('view');
const clamp = (x, low, high) => Math.min(high, Math.max(low, x));

const WIDTH = 2048;                    // of the textures; yarn.vert knows it too
const END = 256;                       // flag of the entries behind a strand's last point
const CLOSED = 0.75;                   // cover from which on cloth is as dark in its depth as can be: that of tricot and locknit
const LIGHT = 0, PICTURE = -1;         // what fills an area, in the place of a yarn's sides; yarn.frag knows them too
const FOV = Math.PI / 6;
const THINNEST = 0.6;                  // pixels to each side of a ribbon: thinner ones would break up into dots

// Vectors of three numbers.
const add = (a, b, k = 1) => [a[0] + k * b[0], a[1] + k * b[1], a[2] + k * b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = a => { const n = Math.hypot(...a) || 1; return [a[0] / n, a[1] / n, a[2] / n]; };

// ---- The yarns

async function inflate(text) {
  const raw = atob(text), bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('deflate-raw'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// The textures' entries, in which an END entry stands before the first strand and behind each.
function unpack(data) {
  const { points, strands } = cloth, lengths = new Uint32Array(data.buffer, 0, strands);
  const count = lengths.reduce((sum, n) => sum + n + 1, 1), rows = Math.ceil((count + 1) / WIDTH);
  const places = new Uint16Array(4 * WIDTH * rows).fill(END), directions = new Int8Array(4 * WIDTH * rows), starts = [];
  const signed = (at, i) => { const code = data[at + i] | data[at + points + i] << 8; return code >> 1 ^ -(code & 1); };
  const first = 4 * strands, now = [0, 0, 0, 0, 0, 0];
  let at = 1, i = 0;
  for (const n of lengths) {
    starts.push(at);
    const end = at + n + 1, filled = at + n;
    for (; at < end; at++) {
      if (at < filled) {
        for (let k = 0; k < 3; k++) {
          now[k] = now[k] + signed(first + 2 * k * points, i) & 65535;
          now[3 + k] = now[3 + k] + data[first + (6 + k) * points + i] & 255;
        }
        i++;
      }
      for (let k = 0; k < 3; k++) places[4 * at + k] = now[k];
      places[4 * at + 3] = at < filled ? now[3] : now[3] | END;
      directions[4 * at] = now[4];
      directions[4 * at + 1] = now[5];
    }
  }
  starts.push(at);
  return { places, directions, rows, starts };
}

// Runs of entries of one bar that are shown or left out together, each with the sphere around it, from the cloth's
// middle. Short runs fit a close-up better, and long ones take less time to go through in large cloth.
function divide({ places, starts }) {
  const chunks = [], CHUNK = starts.at(-1) < 500000 ? 128 : 512;
  let strand = 0;
  for (const [bar, strands] of cloth.runs) {
    const last = strand + strands;
    for (let a = starts[strand], b; strand < last; a = b) {
      // Part of a long strand, or short strands that are near each other. A run from the end of a long strand into the
      // next would span the cloth, and seem nearer than it is.
      b = Math.min(starts[strand + 1], a + CHUNK);
      while (b === starts[strand + 1] && ++strand < last && starts[strand + 1] - a <= CHUNK) b = starts[strand + 1];
      const low = [65535, 65535, 65535], high = [0, 0, 0];
      for (let i = a; i < b; i++)
        for (let k = 0; k < 3; k++) {
          const q = places[4 * i + k];
          if (q < low[k]) low[k] = q;
          if (q > high[k]) high[k] = q;
        }
      chunks.push({ bar, a, b, low, high });
    }
  }
  const low = [0, 1, 2].map(k => chunks.reduce((least, c) => Math.min(least, c.low[k]), 65535));
  const high = [0, 1, 2].map(k => chunks.reduce((most, c) => Math.max(most, c.high[k]), 0));
  const origin = low.map((q, k) => -cloth.step * (q + high[k]) / 2);
  for (const c of chunks) {
    c.middle = c.low.map((q, k) => origin[k] + cloth.step * (q + c.high[k]) / 2);
    c.radius = cloth.step * Math.hypot(...c.high.map((q, k) => q - c.low[k])) / 2;
  }
  return { chunks, origin, size: high.map((q, k) => Math.max(1, cloth.step * (q - low[k]))) };
}

// The mean distance between points of each bar, mm.
function spacings({ places }, chunks) {
  return cloth.bars.map((_, bar) => {
    let sum = 0, count = 0;
    for (const c of chunks.filter(c => c.bar === bar).slice(0, 50))
      for (let i = 4 * c.a; i < 4 * c.b - 4; i += 4)
        if (!(places[i + 7] & END)) {
          sum += Math.hypot(places[i + 4] - places[i], places[i + 5] - places[i + 1], places[i + 6] - places[i + 2]);
          count++;
        }
    return cloth.step * sum / Math.max(1, count);
  });
}

// The first direction of a tube's ring at each entry, carried along the yarn without twist (Wang, Jüttler, Zheng and
// Liu 2008, "Computation of rotation minimizing frames": double reflection). Only tubes need it, so it waits for them.
function carryFrames({ places, directions, starts }) {
  const point = i => [places[4 * i], places[4 * i + 1], places[4 * i + 2]];
  const reflect = (v, axis, square) => square > 1e-9 ? add(v, axis, -2 * dot(axis, v) / square) : v;
  for (let s = 0; s + 1 < starts.length; s++) {
    let p = point(starts[s]), tangent = unit(add(point(starts[s] + 1), p, -1));
    let frame = unit(cross(tangent, Math.abs(tangent[2]) < 0.8 ? [0, 0, 1] : [1, 0, 0]));
    for (let i = starts[s]; i < starts[s + 1]; i++) {
      const next = point(i), ahead = places[4 * i + 3] & END || places[4 * i + 7] & END ? null : point(i + 1);
      const came = add(next, p, -1), square = dot(came, came);
      if (square > 0) {
        const went = ahead ? unit(came) : null, turned = ahead ? unit(add(unit(add(ahead, next, -1)), went)) : unit(came);
        frame = reflect(frame, came, square);
        const mirrored = reflect(tangent, came, square), axis = add(turned, mirrored, -1);
        frame = unit(reflect(frame, axis, dot(axis, axis)));
        tangent = turned;
      }
      const sum = Math.abs(frame[0]) + Math.abs(frame[1]) + Math.abs(frame[2]);
      let x = frame[0] / sum, y = frame[1] / sum;
      if (frame[2] < 0) [x, y] = [(1 - Math.abs(y)) * (x < 0 ? -1 : 1), (1 - Math.abs(x)) * (y < 0 ? -1 : 1)];
      directions[4 * i + 2] = Math.round(127 * x);
      directions[4 * i + 3] = Math.round(127 * y);
      p = next;
    }
  }
}

// ---- The graphics card

const fail = text => { $('message').textContent = text; document.body.dataset.error = text; };
// Sets the pixels of a picture: fewer where it is coarse. This is done before there is a context, since a change of size
// afterwards takes time.
function fit(coarse) {
  const scale = Math.min(devicePixelRatio, 2) * (coarse ? 0.6 : 1);
  const [width, height] = [canvas.clientWidth, canvas.clientHeight].map(length => Math.max(1, Math.round(length * scale)));
  if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
  return { width, height, scale };
}
fit(true);
const gl = canvas.getContext('webgl2', { antialias: false, alpha: true, depth: false });
if (!gl) return fail('This page needs WebGL 2, which this browser or its settings do not offer.');
if (!self.DecompressionStream) return fail('This browser is too old for this page: it needs one of 2023 or later.');

// The card compiles while the yarns are unpacked.
const program = gl.createProgram(), shaders = ['vertex', 'fragment'].map(name => {
  const shader = gl.createShader(name === 'vertex' ? gl.VERTEX_SHADER : gl.FRAGMENT_SHADER);
  gl.shaderSource(shader, $(name).textContent.trim());
  gl.compileShader(shader);
  gl.attachShader(program, shader);
  return shader;
});
gl.linkProgram(program);

const yarns = unpack(await inflate($('data').textContent)), { chunks, origin, size } = divide(yarns);
if (!chunks.length) return fail('This cloth has no yarns.');
const spacing = spacings(yarns, chunks), thickest = Math.max(...cloth.bars.map(bar => bar.radius));
const heights = [cloth.heights[0] - thickest, cloth.heights[1] + thickest];
let hasFrames = false;

if (!gl.getProgramParameter(program, gl.LINK_STATUS))
  return fail([gl.getProgramInfoLog(program), ...shaders.map(shader => gl.getShaderInfoLog(shader))].filter(Boolean).join(' '));
gl.useProgram(program);
const places = {}, at = name => places[name] ??= gl.getUniformLocation(program, name);

const textures = [];
function texture(unitNumber, name, ...image) {
  gl.activeTexture(gl.TEXTURE0 + unitNumber);
  gl.bindTexture(gl.TEXTURE_2D, textures[unitNumber] ??= gl.createTexture());
  for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, filter, gl.NEAREST);
  gl.texImage2D(gl.TEXTURE_2D, 0, ...image);
  gl.uniform1i(at(name), unitNumber);
}
const texels = [WIDTH, yarns.rows, 0];
texture(0, 'points', gl.RGBA16UI, ...texels, gl.RGBA_INTEGER, gl.UNSIGNED_SHORT, yarns.places);
texture(1, 'directions', gl.RGBA8_SNORM, ...texels, gl.RGBA, gl.BYTE, yarns.directions);
// Pictures are drawn with up to four samples a pixel, coarse ones with one, in a framebuffer that adds light as light
// (sRGB). Their samples' mean goes into a texture, and that onto the canvas.
const drawn = gl.createFramebuffer(), resolved = gl.createFramebuffer(), SAMPLES = Math.min(4, gl.getParameter(gl.MAX_SAMPLES));
const layers = [[gl.SRGB8_ALPHA8, gl.COLOR_ATTACHMENT0], [gl.DEPTH24_STENCIL8, gl.DEPTH_STENCIL_ATTACHMENT]].map(([format, place]) => {
  const buffer = gl.createRenderbuffer();
  gl.bindFramebuffer(gl.FRAMEBUFFER, drawn);
  gl.bindRenderbuffer(gl.RENDERBUFFER, buffer);
  gl.framebufferRenderbuffer(gl.FRAMEBUFFER, place, gl.RENDERBUFFER, buffer);
  return { buffer, format };
});
let drawnAs = '', mostSamples = SAMPLES;
function prepare(width, height, wanted) {
  const samples = Math.min(wanted, mostSamples), asked = `${width} x ${height}, ${samples}`;
  if (asked !== drawnAs) {
    drawnAs = asked;
    for (const { buffer, format } of layers) {
      gl.bindRenderbuffer(gl.RENDERBUFFER, buffer);
      gl.renderbufferStorageMultisample(gl.RENDERBUFFER, samples, format, width, height);
    }
    texture(2, 'picture', gl.SRGB8_ALPHA8, width, height, 0, gl.RGBA, gl.UNSIGNED_BYTE, null);
    gl.bindFramebuffer(gl.FRAMEBUFFER, resolved);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, textures[2], 0);
  }
  gl.bindFramebuffer(gl.FRAMEBUFFER, drawn);
  // A card without the memory for four samples may have that for one.
  if (samples && gl.checkFramebufferStatus(gl.FRAMEBUFFER) !== gl.FRAMEBUFFER_COMPLETE) {
    mostSamples = 0;
    prepare(width, height, 0);
  }
}
gl.enable(gl.DEPTH_TEST);
gl.uniform1f(at('grid'), cloth.step);
gl.uniform3fv(at('low'), origin);
gl.uniform3fv(at('colorsFromAfar'), cloth.colors_from_afar.flat());
gl.uniform1f(at('closed'), Math.min(1, (cloth.cover ?? CLOSED) / CLOSED));

// How finely a chunk is drawn where a mm at its distance has so many pixels: rings an entry, and sides. Each entry has
// a ring at least: with fewer, chords would leave out the tops of loops, and another bar would colour the cloth.
function detailOf({ bar }, pixels) {
  const thick = cloth.bars[bar].radius * pixels, span = spacing[bar] * pixels;
  // Chords and edges then are less than a third of a pixel off the curve.
  if (thick > 2) return [clamp(Math.ceil(Math.sqrt(span / 2)), 2, 12), clamp(Math.ceil(4 * Math.sqrt(thick)), 6, 20)];
  return [span < 3 ? 1 : span < 7 ? 2 : 3, 2];
}

function isOutside(planes, [x, y, z], reach) {
  for (const p of planes) if (p[0] * x + p[1] * y + p[2] * z + p[3] < -reach) return true;
  return false;
}

// How opaque a ribbon is: where yarns are thinner than a pixel it is wider than they are, and stops as little light.
// One number serves all yarns of a picture, since `showThrough` only knows how many of them there are.
function opacityOf({ pixel, distance }) {
  const shown = cloth.bars.filter((_, bar) => !hidden.has(bar)), mean = shown.reduce((sum, { radius }) => sum + radius, 0) / shown.length;
  return Math.min(1, mean / (THINNEST * pixel * distance));
}

// Fills the viewport, or a disc as wide as it, behind everything: with light of an opacity, or with the picture.
function fill(paint, opacity = 1, isDisc = false) {
  gl.uniform1i(at('sides'), paint);
  gl.uniform3i(at('shape'), !isDisc, 1, paint);
  gl.uniform1f(at('opacity'), opacity);
  gl.drawArrays(gl.TRIANGLE_FAN, 0, 66);
}

// Puts the picture that was drawn onto the canvas, over the page's ground.
function present(width, height) {
  gl.bindFramebuffer(gl.READ_FRAMEBUFFER, drawn);
  gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, resolved);
  gl.blitFramebuffer(0, 0, width, height, 0, 0, width, height, gl.COLOR_BUFFER_BIT, gl.NEAREST);
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  gl.viewport(0, 0, width, height);
  const ground = getComputedStyle(document.body).backgroundColor.match(/\d+/g).slice(0, 3);
  gl.uniform3fv(at('ground'), ground.map(code => (code / 255) ** 2.2));
  gl.disable(gl.DEPTH_TEST);
  fill(PICTURE);
  gl.enable(gl.DEPTH_TEST);
}

// Lets the ground through between yarns, as far as all ribbons before it stop its light. Each sample's stencil counts
// them, in any order and behind others too. Where n of them let the share p through each, p to the power of n passes: a
// product over the binary digits of n, which gathers in the framebuffer's alpha.
function showThrough(opacity) {
  gl.disable(gl.DEPTH_TEST);
  gl.stencilOp(gl.KEEP, gl.KEEP, gl.KEEP);
  gl.colorMask(false, false, false, true);
  gl.clearColor(0, 0, 0, 1);
  gl.clear(gl.COLOR_BUFFER_BIT);
  gl.enable(gl.BLEND);
  gl.blendFuncSeparate(gl.ZERO, gl.ONE, gl.ZERO, gl.SRC_ALPHA);
  let passes = (1 - opacity) ** cloth.optical_depth;
  for (let digit = 1; digit < 256; digit *= 2, passes *= passes) {
    const isLast = passes < 0.002;
    gl.stencilFunc(isLast ? gl.LEQUAL : gl.EQUAL, digit, isLast ? 255 : digit);
    fill(LIGHT, passes);
    if (isLast) break;
  }
  // The yarns' colour is as strong as the light that they stop.
  gl.disable(gl.STENCIL_TEST);
  gl.colorMask(true, true, true, true);
  gl.blendEquationSeparate(gl.FUNC_ADD, gl.FUNC_SUBTRACT);
  gl.blendFuncSeparate(gl.ZERO, gl.ONE_MINUS_DST_ALPHA, gl.ONE, gl.ONE);
  fill(LIGHT);
  gl.blendEquation(gl.FUNC_ADD);
  gl.disable(gl.BLEND);
  gl.enable(gl.DEPTH_TEST);
}

// Draws all that a camera sees; `fineness` is the pixels that count as one.
function drawYarns({ clip, eye, pixel }, fineness, opacity = 1) {
  gl.uniform1f(at('opacity'), opacity);
  gl.uniformMatrix4fv(at('clip'), false, clip);
  gl.uniform3fv(at('eye'), eye);
  gl.uniform1f(at('pixel'), pixel);
  // Rows of the matrix give the planes of what is seen: left, right, bottom, top, near.
  const row = k => [clip[k], clip[4 + k], clip[8 + k], clip[12 + k]], w = row(3);
  const planes = [[0, 1], [0, -1], [1, 1], [1, -1], [2, 1]].map(([k, sign]) => {
    const r = row(k).map((x, i) => w[i] + sign * x), n = Math.hypot(r[0], r[1], r[2]);
    return r.map(x => x / n);
  });
  let waiting = null, bar = -1;
  const flush = () => {
    if (!waiting) return;
    const { a, b, detail: [rings, sides] } = waiting, isEnd = at => yarns.places[4 * at + 3] & END;
    if (waiting.bar !== bar) {
      ({ bar } = waiting);
      gl.uniform3fv(at('color'), cloth.bars[bar].color);
      gl.uniform1f(at('radius'), cloth.bars[bar].radius);
      // Two plies turn once in 16 radii; whole turns in 4096 entries, after which the shader begins again.
      gl.uniform1f(at('twist'), Math.round(0.8 * spacing[bar] / cloth.bars[bar].radius * 4096 / (2 * Math.PI)) * 2 * Math.PI / 4096);
    }
    if (sides > 2 && !hasFrames) {
      hasFrames = true;
      carryFrames(yarns);
      gl.activeTexture(gl.TEXTURE1);
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, WIDTH, yarns.rows, gl.RGBA, gl.BYTE, yarns.directions);
    }
    // A run that ends with a strand stops at its last point. What follows belongs to another run, or is nothing. A tube
    // also has the caps on the entries around its strands.
    const from = sides > 2 && isEnd(a - 1) ? a - 1 : a, segments = ((isEnd(b - 1) ? b - 1 : b) - from) * rings;
    const points = isEnd(b - 1) ? segments - rings + 1 : segments + 1;
    gl.uniform3i(at('shape'), from, rings, sides);
    gl.uniform1i(at('sides'), sides);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, sides === 2 ? 2 * Math.max(0, points) : segments * (2 * sides + 2));
    waiting = null;
  };
  for (const chunk of chunks) {
    const { a, b, middle, radius } = chunk, reach = radius + thickest;
    if (hidden.has(chunk.bar) || isOutside(planes, middle, reach)) continue;
    const distance = Math.max(Math.hypot(middle[0] - eye[0], middle[1] - eye[1], middle[2] - eye[2]) - radius, 1e-3);
    const detail = detailOf(chunk, fineness / (pixel * distance));
    if (!waiting || waiting.b !== a || waiting.bar !== chunk.bar || waiting.detail.some((d, k) => d !== detail[k])) {
      flush();
      waiting = { a, b, bar: chunk.bar, detail };
    }
    waiting.b = b;
  }
  flush();
}

// ---- The camera

const view = {}, hidden = new Set(), loupe = { on: false, x: 0.5, y: 0.5 };

// The whole cloth, from an angle.
function showWhole(yaw, pitch = 0) {
  const [w, h] = [canvas.clientWidth, canvas.clientHeight];
  const wide = Math.hypot(size[0] * Math.cos(yaw), size[2] * Math.sin(yaw)), deep = Math.hypot(size[0] * Math.sin(yaw), size[2] * Math.cos(yaw));
  Object.assign(view, { isWhole: true, yaw, pitch, target: [0, 0, 0], span: 1.08 * Math.max(size[1], wide * h / w) + deep * Math.tan(FOV / 2) });
  invalidate();
}

// Directions and matrix of the view.
function camera(aspect) {
  const { yaw, pitch, target, span } = view, [sy, cy, sp, cp] = [Math.sin(yaw), Math.cos(yaw), Math.sin(pitch), Math.cos(pitch)];
  const right = [cy, 0, -sy], back = [sy * cp, sp, cy * cp], up = cross(back, right);
  const distance = span / 2 / Math.tan(FOV / 2), eye = add(target, back, distance);
  const reach = Math.hypot(...size) / 2 + Math.hypot(...target), far = distance + reach;
  const near = Math.max(distance - reach, distance / 50), f = 1 / Math.tan(FOV / 2);
  const rows = [right.map(x => x * f / aspect), up.map(x => x * f), back.map(x => x * -(far + near) / (far - near)), back.map(x => -x)];
  const lasts = rows.map(row => -dot(row, eye));
  lasts[2] -= 2 * far * near / (far - near);
  const clip = [0, 1, 2].flatMap(k => rows.map(row => row[k])).concat(lasts);
  return { clip, eye, right, up, back, distance };
}

// The camera of a square window of `pixels` around a place of the picture, magnified so many times.
function magnified(camera, x, y, times, width, height, pixels) {
  const [kx, ky] = [times * width / pixels, times * height / pixels], clip = camera.clip.slice();
  for (let k = 0; k < 16; k += 4) {
    clip[k] = kx * (clip[k] - (2 * x - 1) * clip[k + 3]);
    clip[k + 1] = ky * (clip[k + 1] - (1 - 2 * y) * clip[k + 3]);
  }
  return { ...camera, clip, pixel: camera.pixel / times };
}

// Moves the target to the depth of the cloth at a place of the picture, without a change of the picture. So one turns
// and zooms about what one sees, and doesn't fall through the cloth.
function anchor(x, y) {
  const [w, h] = [canvas.clientWidth, canvas.clientHeight], { eye, right, up, back, distance } = camera(w / h);
  const mm = view.span / h, ray = unit(add(add(add([0, 0, 0], back, -distance), right, (x - 0.5) * w * mm), up, (0.5 - y) * h * mm));
  const slack = Math.max(3 * mm, 2 * Math.max(...spacing));
  const from = add(origin, eye, -1);
  let nearest = Infinity;
  for (const { a, b, bar, middle, radius } of chunks) {
    const to = add(middle, eye, -1), along = dot(to, ray);
    if (hidden.has(bar) || dot(to, to) - along * along > (radius + slack) ** 2) continue;
    for (let i = a; i < b; i++) {
      const x = from[0] + cloth.step * yarns.places[4 * i], y = from[1] + cloth.step * yarns.places[4 * i + 1];
      const z = from[2] + cloth.step * yarns.places[4 * i + 2], s = x * ray[0] + y * ray[1] + z * ray[2];
      if (s > 0 && s < nearest && x * x + y * y + z * z - s * s < slack * slack) nearest = s;
    }
  }
  const depth = -nearest * dot(ray, back);
  if (!(depth > 0 && depth < Infinity)) return;
  view.isWhole = false;
  view.target = add(eye, back, -depth);
  view.span *= depth / distance;
}

function turn(yaw, pitch) {
  view.yaw += yaw;
  view.pitch = clamp(view.pitch + pitch, -1.55, 1.55);
  invalidate(true);
}
function move(dx, dy) {                // pixels
  const { right, up } = camera(1), mm = view.span / canvas.clientHeight;
  view.isWhole = false;
  view.target = add(add(view.target, right, -dx * mm), up, dy * mm);
  invalidate(true);
}
function zoom(factor, x = 0.5, y = 0.5) {
  const span = clamp(view.span * factor, 8 * thickest, 4 * Math.hypot(...size)), k = span / view.span;
  move((0.5 - x) * canvas.clientWidth * (1 - k), (0.5 - y) * canvas.clientHeight * (1 - k));
  view.span = span;
}

// ---- Pictures

let asked = true, moved = -Infinity, slow = false, late = 0, sharpening = 0, frames = 0;
function invalidate(moving = false) {
  if (moving) moved = performance.now();
  if (!asked) requestAnimationFrame(draw);
  asked = true;
}

function draw(now) {
  asked = false;
  // A card (or a processor in its place) whose frames come over 80 ms late draws coarser pictures while the view moves.
  // One such frame may be the first that shows tubes, so it takes two.
  const moving = now - moved < 250;
  if (moving && !slow) requestAnimationFrame(next => { late = next - now > 80 ? late + 1 : 0; slow = late > 1; });
  // The first picture is coarse too, so that it comes sooner.
  const coarse = slow && moving || !frames;
  const { width, height, scale } = fit(coarse), fineness = coarse ? 0.4 : 1;
  const seen = camera(width / height);
  seen.pixel = 2 * Math.tan(FOV / 2) / height;
  prepare(width, height, coarse ? 0 : SAMPLES);
  gl.viewport(0, 0, width, height);
  gl.clearColor(0, 0, 0, 0);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
  gl.uniform3fv(at('lamp'), unit(add(add(seen.back, seen.right, -0.55), seen.up, 0.75)));
  gl.uniform3fv(at('sky'), unit(add(seen.up, seen.back, 0.6)));
  gl.uniform2fv(at('heights'), heights);
  // With a bar left out, the cloth from afar has other colours than these.
  gl.uniform1f(at('repeat'), hidden.size ? 1e9 : cloth.repeat ?? 1e9);
  const opacity = opacityOf(seen);
  if (opacity < 1) {
    gl.enable(gl.STENCIL_TEST);
    gl.stencilFunc(gl.ALWAYS, 0, 255);
    gl.stencilOp(gl.KEEP, gl.INCR, gl.INCR);
  }
  drawYarns(seen, fineness, opacity);
  if (opacity < 1) showThrough(opacity);
  if (loupe.on) drawLoupe(seen, width, height, scale, fineness);
  present(width, height);
  showScale();
  // The sharp one follows once the view rests, in a frame after the one that shows this one.
  clearTimeout(sharpening);
  if (coarse && moving) sharpening = setTimeout(() => performance.now() - moved >= 250 && invalidate(), 300);
  else if (coarse) requestAnimationFrame(() => invalidate());
  document.body.dataset.frames = ++frames;
}

function drawLoupe(seen, width, height, scale, fineness) {
  const radius = Math.round(clamp(0.24 * Math.min(width, height), 60 * scale, 150 * scale));
  const [x, y] = [Math.round(loupe.x * width), Math.round((1 - loupe.y) * height)];
  const thick = thickest / (seen.pixel * seen.distance) / scale, times = clamp(7 / thick, 2.5, 16);
  const near = magnified(seen, loupe.x, loupe.y, times, width, height, 2 * radius);
  gl.viewport(x - radius, y - radius, 2 * radius, 2 * radius);
  gl.enable(gl.SCISSOR_TEST);
  gl.scissor(x - radius, y - radius, 2 * radius, 2 * radius);
  // All depths of the window become the least, so that nothing is drawn. The disc then sets its own to the greatest.
  gl.clearDepth(0);
  gl.clear(gl.DEPTH_BUFFER_BIT);
  gl.clearDepth(1);
  gl.depthFunc(gl.ALWAYS);
  fill(LIGHT, 0, true);
  gl.depthFunc(gl.LESS);
  drawYarns(near, fineness);
  gl.disable(gl.SCISSOR_TEST);
  const ring = $('ring').style;
  [ring.left, ring.top, ring.width, ring.height] = [x / scale, (height - y) / scale, 2 * radius / scale, 2 * radius / scale].map(n => n + 'px');
}

// A length in mm, drawn to scale where the target lies.
function showScale() {
  const most = 0.32 * Math.min(canvas.clientWidth, 600) * view.span / canvas.clientHeight, ten = 10 ** Math.floor(Math.log10(most));
  const mm = [5, 2, 1].find(k => k * ten <= most) * ten, bar = $('scale').firstElementChild;
  bar.style.width = mm * canvas.clientHeight / view.span + 'px';
  bar.textContent = mm >= 10 ? `${mm / 10} cm` : `${+mm.toPrecision(2)} mm`;
}

// ---- The page around it

function toggleBar(bar, shown) {
  hidden[shown ? 'delete' : 'add'](bar);
  $('bars').querySelectorAll('input')[bar].checked = shown;
  invalidate();
}
function toggleLoupe(on = !loupe.on) {
  loupe.on = on;
  $('ring').hidden = !on;
  $('loupe').setAttribute('aria-pressed', on);
  invalidate();
}
function element(kind, parent, text = '') {
  const made = parent.appendChild(document.createElement(kind));
  made.textContent = text;
  return made;
}

$('about').textContent = cloth.about;
cloth.bars.forEach((bar, number) => {
  const label = element('label', element('li', $('bars'))), input = element('input', label);
  Object.assign(input, { type: 'checkbox', checked: true, onchange: () => toggleBar(number, input.checked) });
  element('i', label).style.background = bar.shown;
  element('span', label, bar.name);
  element('small', label, bar.facts.join(' · '));
});
for (const [label, value] of cloth.facts) {
  element('dt', $('facts'), label);
  element('dd', $('facts'), value);
}
const looks = { front: () => showWhole(0), back: () => showWhole(Math.PI), whole: () => showWhole(view.yaw, view.pitch) };
for (const name in looks) $(name).onclick = looks[name];
$('loupe').onclick = () => toggleLoupe();

const share = event => {
  const box = canvas.getBoundingClientRect();
  return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
};
const fingers = new Map();
let dragsLoupe = false;
const middleOf = all => [0, 1].map(k => all.reduce((sum, p) => sum + p[k], 0) / all.length);
const spreadOf = all => all.length > 1 ? Math.hypot(all[0][0] - all[1][0], all[0][1] - all[1][1]) : 0;
canvas.onpointerdown = event => {
  canvas.setPointerCapture(event.pointerId);
  fingers.set(event.pointerId, [event.clientX, event.clientY]);
  const [x, y] = share(event), ring = $('ring').getBoundingClientRect();
  dragsLoupe = loupe.on && event.pointerType !== 'mouse' && fingers.size === 1
    && Math.hypot(event.clientX - ring.x - ring.width / 2, event.clientY - ring.y - ring.height / 2) < ring.width / 2;
  if (!dragsLoupe) anchor(x, y);
};
canvas.onpointermove = event => {
  if (loupe.on && (event.pointerType === 'mouse' && !event.buttons || dragsLoupe)) {
    [loupe.x, loupe.y] = share(event);
    return invalidate(true);
  }
  if (!fingers.has(event.pointerId)) return;
  const old = [...fingers.values()];
  fingers.set(event.pointerId, [event.clientX, event.clientY]);
  const all = [...fingers.values()], [a, b] = [middleOf(old), middleOf(all)], [dx, dy] = [b[0] - a[0], b[1] - a[1]];
  if (all.length > 1) {
    move(dx, dy);
    zoom(spreadOf(old) / Math.max(1, spreadOf(all)), ...share({ clientX: b[0], clientY: b[1] }));
  } else if (event.buttons & 6 || event.shiftKey) move(dx, dy);
  else turn(-dx * 0.008, dy * 0.008);
};
canvas.onpointerup = canvas.onpointercancel = event => { fingers.delete(event.pointerId); dragsLoupe = false; };
canvas.oncontextmenu = event => event.preventDefault();
let wheeled = 0;
canvas.addEventListener('wheel', event => {
  event.preventDefault();
  const [x, y] = share(event), now = performance.now();
  if (now - wheeled > 300) anchor(x, y);
  wheeled = now;
  zoom(Math.exp(clamp(event.deltaY * (event.deltaMode ? 20 : 1), -200, 200) * 0.0015), x, y);
}, { passive: false });
canvas.ondblclick = event => {
  const [x, y] = share(event);
  anchor(x, y);
  zoom(0.4, x, y);
};
addEventListener('keydown', event => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.tagName === 'INPUT' && event.key === ' ') return;
  const arrow = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key], key = event.key.toLowerCase();
  if (arrow && event.shiftKey) move(-40 * arrow[0], -40 * arrow[1]);
  else if (arrow) turn(0.12 * arrow[0], 0.12 * arrow[1]);
  else if (key === '+' || key === '=') { anchor(0.5, 0.5); zoom(0.8); }
  else if (key === '-') zoom(1.25);
  else if (key === 'f') looks.front();
  else if (key === 'b') looks.back();
  else if (key === '0') looks.whole();
  else if (key === 'l') toggleLoupe();
  else if (cloth.bars[key - 1]) toggleBar(key - 1, hidden.has(key - 1));
  else return;
  event.preventDefault();
});

// A link may choose the view: page.html#yaw=150&pitch=20&zoom=8&x=0.4&y=0.3&loupe=1 (degrees; shares of the picture).
const asks = new URLSearchParams(location.hash.slice(1)), ask = (name, other) => +(asks.get(name) ?? other);
showWhole(ask('yaw', 0) * Math.PI / 180, ask('pitch', 0) * Math.PI / 180);
if (asks.has('zoom')) {
  const [x, y] = [ask('x', 0.5), ask('y', 0.5)];
  anchor(x, y);
  move((0.5 - x) * canvas.clientWidth, (0.5 - y) * canvas.clientHeight);
  zoom(1 / ask('zoom', 1));
}
moved = -Infinity;
if (ask('loupe', 0)) toggleLoupe(true);
draw(performance.now());
gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
$('message').textContent = '';
// The whole cloth stays whole in a window of another shape.
new ResizeObserver(() => view.isWhole ? looks.whole() : invalidate()).observe(canvas);
// Its ground is the page's, whose colours may change.
matchMedia('(prefers-color-scheme: dark)').onchange = () => invalidate();
Object.assign(document.body.dataset, { first: Math.round(performance.now() - started), error: gl.getError() || '' });
})();

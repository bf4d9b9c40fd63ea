// Put at the end of a page by tests/it/page.rs: uses the page as a person would, and says on the console what it
// found, as words such as `turns=true`.
(async () => {
const errors = [], canvas = document.getElementById('view'), data = document.body.dataset;
addEventListener('error', event => errors.push(event.message));
addEventListener('unhandledrejection', event => errors.push(String(event.reason)));
addEventListener('securitypolicyviolation', event => errors.push(event.blockedURI));
console.error = console.warn = (...words) => errors.push(words.join(' '));
while (!data.first && !data.error) await new Promise(done => setTimeout(done, 50));

// Whether a pixel shows yarn: the ground's colour is that of the page.
const ground = getComputedStyle(document.body).backgroundColor.match(/\d+/g).slice(0, 3).map(Number);
const showsYarn = (bytes, i) => ground.some((code, k) => Math.abs(bytes[i + k] - code) > 1);

// The canvas after an event, in the frame that draws it: its pixels as a number, and how many of them show yarn.
async function after(event, target = window) {
  target.dispatchEvent(event);
  await new Promise(requestAnimationFrame);
  const copy = Object.assign(document.createElement('canvas'), { width: canvas.width, height: canvas.height });
  const pixels = copy.getContext('2d');
  pixels.drawImage(canvas, 0, 0);
  const bytes = pixels.getImageData(0, 0, copy.width, copy.height).data;
  let hash = 0, covered = 0;
  for (let i = 0; i < bytes.length; i++) hash = hash * 31 + bytes[i] | 0;
  for (let i = 0; i < bytes.length; i += 4) covered += showsYarn(bytes, i);
  const [width, height] = [copy.width, copy.height];
  return { hash, covered: covered / (width * height), uneven: uneven(bytes, width, height), stops: stops(bytes, width, height) };
}

// How much of the ground's light black yarn in the middle of the canvas stops, of 100.
function stops(bytes, width, height) {
  const light = code => (code / 255) ** 2.2;
  let sum = 0, count = 0;
  for (let y = Math.round(0.4 * height); y < 0.6 * height; y++)
    for (let x = Math.round(0.4 * width); x < 0.6 * width; x++, count++) sum += 1 - light(bytes[4 * (y * width + x) + 1]) / light(ground[1]);
  return Math.round(100 * sum / count);
}

// How far the mean colours of a grid of 5 x 5 places differ at most, of 255; places that are hardly yarn are left out.
function uneven(bytes, width, height) {
  const cells = Array.from({ length: 25 }, () => [0, 0, 0, 0, 0]);
  for (let y = 0; y < height; y++)
    for (let x = 0; x < width; x++) {
      const cell = cells[5 * Math.floor(5 * y / height) + Math.floor(5 * x / width)], i = 4 * (y * width + x);
      cell[3]++;
      if (showsYarn(bytes, i)) {
        for (let k = 0; k < 3; k++) cell[k] += bytes[i + k];
        cell[4]++;
      }
    }
  const full = cells.filter(cell => cell[4] > 0.5 * cell[3]);
  const range = k => { const all = full.map(cell => cell[k] / cell[4]); return Math.max(...all) - Math.min(...all); };
  return full.length > 3 ? Math.round(Math.max(range(0), range(1), range(2))) : 'unknown';
}
const key = name => after(new KeyboardEvent('keydown', { key: name, bubbles: true }));
// A slow machine draws coarser pictures for a quarter of a second after the view has moved.
const rest = () => new Promise(done => setTimeout(done, 1500));
const box = canvas.getBoundingClientRect(), middle = { clientX: box.x + box.width / 2, clientY: box.y + box.height / 2 };

// The first picture is a coarse one. A sharp one follows by itself, with all pixels of the canvas.
const isSharp = () => +data.frames > 1 && canvas.width === Math.round(canvas.clientWidth * Math.min(devicePixelRatio, 2));
for (let waited = 0; waited < 100 && !isSharp(); waited++) await new Promise(done => setTimeout(done, 200));
const sharpens = isSharp();
await rest();
const front = await key('f'), turned = await key('ArrowRight'), back = await key('b');
await rest();
const again = await key('f'), without = await key('1');
await key('1');
const loupe = await key('l');
await key('l');
const zoomed = await after(new WheelEvent('wheel', { deltaY: -400, ...middle }), canvas);
const found = {
  draws: front.covered > 0.05,
  sharpens,
  turns: turned.hash !== front.hash && back.hash !== front.hash,
  returns: again.hash === front.hash,
  hides: without.covered < front.covered,
  magnifies: loupe.hash !== front.hash,
  zooms: zoomed.covered > front.covered,
  fetched: performance.getEntriesByType('resource').length,
  uneven: again.uneven,
  stops: again.stops,
  facts: document.querySelectorAll('#facts dd').length,
  error: data.error || 'none',
  gl_error: canvas.getContext('webgl2').getError(),
  errors: errors.length ? errors.join(';').replaceAll(/[\s"<>&]+/g, '_') : 'none',
};
console.log('probe: ' + Object.entries(found).map(([name, value]) => `${name}=${value}`).join(' '));
})();

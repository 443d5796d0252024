// The grey levels on the canvas: brightness, the mask's colour, pixel values when they are large enough.

const cache = new Map();
const KEPT = 6, LIT = 0.2; // share of the full scale from which the usual level is a lit scene, not the dark

export function keep(index, image) {
  cache.delete(index);
  cache.set(index, image);
  if (cache.size > KEPT) cache.delete(cache.keys().next().value);
}

export const kept = (index) => cache.get(index);
export const forget = (index) => cache.delete(index);

function levels(floor, top, gamma) {
  const table = new Uint8ClampedArray(top + 1);
  for (let i = floor; i <= top; i++) table[i] = 255 * ((i - floor) / (top - floor || 1)) ** gamma;
  return table;
}

// The dark level of the frame: the median of every 97th pixel.
function dark(image) {
  if (image.dark !== undefined) return image.dark;
  const every = image.values.constructor.from({ length: Math.ceil(image.values.length / 97) }, (_, k) => image.values[97 * k]).sort();
  image.dark = every[Math.floor(image.values.length / 194)] ?? 0;
  return image.dark;
}

// The image as a bitmap to draw from; brightness 0 is linear, above it the darkest are lifted and the dark level is black.
export function paint(image, saturation, brightness, mask, clipped) {
  const surface = image.surface ?? (image.surface = new OffscreenCanvas(image.width, image.height));
  const key = `${saturation} ${brightness} ${clipped}`;
  if (image.painted === key && image.mask === mask) return surface;
  const floor = brightness > 0 && dark(image) < LIT * saturation ? Math.min(dark(image), saturation - 1) : 0;
  const table = levels(floor, saturation, 1 / (1 + 3 * brightness));
  fill(surface, image, table, saturation, mask?.values, clipped ? saturation : Infinity);
  image.painted = key;
  image.mask = mask;
  return surface;
}

// A smooth image (the background) over its own range of grey levels, which is kept beside it.
export function paintRange(image) {
  if (image.range) return image.surface;
  let low = Infinity, high = -Infinity;
  for (const v of image.values) { if (v < low) low = v; if (v > high) high = v; }
  image.range = [low, high];
  image.surface = new OffscreenCanvas(image.width, image.height);
  fill(image.surface, image, levels(low, Math.max(high, low + 1), 1), high);
  return image.surface;
}

function fill(surface, image, table, top, lit, clip = Infinity) {
  const data = new ImageData(image.width, image.height);
  const out = new Uint32Array(data.data.buffer), values = image.values;
  for (let i = 0; i < out.length; i++) {
    const g = table[values[i] > top ? top : values[i]];
    out[i] = values[i] >= clip ? 0xff3030ff : lit && lit[i] ? 0xff33c2ff : 0xff000000 | (g << 16) | (g << 8) | g;
  }
  surface.getContext("2d").putImageData(data, 0, 0);
}

export function draw(context, view, image, surface, width, height) {
  context.imageSmoothingEnabled = view.scale < 1;
  context.imageSmoothingQuality = "medium";
  const [x, y] = view.toScreen(-0.5, -0.5); // pixel (0, 0) is the centre of the first pixel
  context.drawImage(surface, x, y, image.width * view.scale, image.height * view.scale);
  if (view.scale >= 26) values(context, view, image, width, height);
}

function values(context, view, image, width, height) {
  const [u0, v0] = view.toContent(0, 0).map((x) => Math.max(0, Math.floor(x)));
  const [u1, v1] = view.toContent(width, height).map((x) => Math.ceil(x));
  context.font = "10px ui-monospace, Menlo, Consolas, monospace";
  context.textAlign = "center";
  context.textBaseline = "middle";
  for (let v = v0; v <= Math.min(v1, image.height - 1); v++) {
    for (let u = u0; u <= Math.min(u1, image.width - 1); u++) {
      const value = image.values[v * image.width + u];
      const [a, b] = view.toScreen(u, v);
      context.fillStyle = "rgb(0 0 0 / .45)";
      context.fillRect(a - 11, b - 6, 22, 12);
      context.fillStyle = "#e8edf2";
      context.fillText(value, a, b + 0.5);
    }
  }
}

// The grey level at (u, v) between pixels, or null outside.
export function sample(image, u, v) {
  const i = Math.floor(u), j = Math.floor(v);
  if (i < 0 || j < 0 || i >= image.width - 1 || j >= image.height - 1) return null;
  const a = u - i, b = v - j, k = j * image.width + i, w = image.width, p = image.values;
  return (1 - b) * ((1 - a) * p[k] + a * p[k + 1]) + b * ((1 - a) * p[k + w] + a * p[k + w + 1]);
}

// Between the pixels of the image and the millimetres of the laser plane: a grid from the server, straight between its nodes.

import { pixels } from "./api.js";

const STEPS = 4; // Newton's, from the nearest node: a lens bends little within one cell
let grid = null;

export async function loadPlane() {
  const { width, height, values, step } = await pixels("plane");
  grid = { columns: width / 3, rows: height, step, at: values };
}

const node = (i, j) => grid.at.subarray(3 * (j * grid.columns + i), 3 * (j * grid.columns + i) + 3); // (y, z, 1) / depth

// The point (y, z) [mm] seen at pixel (u, v) and its derivatives, or null where none is.
function map(u, v) {
  const i = Math.min(Math.max(Math.floor(u / grid.step), 0), grid.columns - 2), a = u / grid.step - i;
  const j = Math.min(Math.max(Math.floor(v / grid.step), 0), grid.rows - 2), b = v / grid.step - j;
  const p = node(i, j), q = node(i + 1, j), r = node(i, j + 1), s = node(i + 1, j + 1);
  const mix = (k) => (1 - b) * ((1 - a) * p[k] + a * q[k]) + b * ((1 - a) * r[k] + a * s[k]);
  const byU = (k) => ((1 - b) * (q[k] - p[k]) + b * (s[k] - r[k])) / grid.step;
  const byV = (k) => ((1 - a) * (r[k] - p[k]) + a * (s[k] - q[k])) / grid.step;
  const w = mix(2), yz = [mix(0) / w, mix(1) / w];
  const by = [0, 1].flatMap((k) => [(byU(k) - yz[k] * byU(2)) / w, (byV(k) - yz[k] * byV(2)) / w]);
  return yz.every(Number.isFinite) ? { yz, by } : null;
}

export function toPlane(u, v) {
  return grid && u > -1 && v > -1 && u < grid.columns * grid.step && v < grid.rows * grid.step ? map(u, v)?.yz ?? null : null;
}

export function toImage(y, z) {
  if (!grid) return null;
  let best = null, nearest = Infinity;
  for (let k = 0; k < grid.at.length; k += 3) {
    const w = grid.at[k + 2], d = Math.hypot(grid.at[k] / w - y, grid.at[k + 1] / w - z);
    if (d < nearest) { nearest = d; best = k / 3; }
  }
  if (best === null) return null;
  let u = (best % grid.columns) * grid.step, v = Math.floor(best / grid.columns) * grid.step;
  for (let n = 0; n < STEPS; n++) {
    const here = map(u, v);
    if (!here) return null;
    const [a, b, c, d] = here.by, ey = y - here.yz[0], ez = z - here.yz[1], det = a * d - b * c;
    u += (d * ey - b * ez) / det;
    v += (a * ez - c * ey) / det;
  }
  return Number.isFinite(u + v) && u > -1 && v > -1 && u < grid.columns * grid.step && v < grid.rows * grid.step ? [u, v] : null;
}

// The grey levels of the shown image, on a logarithmic scale; what is clipped in red.

import { $, fitCanvas, style } from "./dom.js";
import { state } from "./state.js";

const BINS = 128;

function count(image, top) {
  if (image.histogram) return image.histogram;
  const bins = new Uint32Array(BINS), step = (top + 1) / BINS, { values } = image;
  let clipped = 0;
  for (let i = 0; i < values.length; i++) {
    const g = values[i];
    if (g >= top) clipped++;
    bins[Math.min(BINS - 1, Math.floor(g / step))]++;
  }
  image.histogram = { bins, clipped };
  return image.histogram;
}

// None where the picture can not be measured: the last one's would be another's.
export function drawHistogram(image) {
  const canvas = $("histogram");
  if (!canvas || !canvas.clientWidth) return;
  if (!image) { const { context, width, height } = fitCanvas(canvas); context.clearRect(0, 0, width, height); return; }
  const top = state.session.sensor.saturation, { bins, clipped } = count(image, top);
  const { context, width, height } = fitCanvas(canvas), high = Math.log1p(Math.max(...bins));
  context.clearRect(0, 0, width, height);
  const floor = height - 14, bar = width / BINS;
  bins.forEach((n, i) => {
    const tall = Math.log1p(n) / high * (floor - 2);
    context.fillStyle = i === BINS - 1 && clipped ? style("--bad") : style("--quiet");
    context.fillRect(i * bar, floor - tall, Math.max(bar - 0.5, 0.5), tall);
  });
  context.font = "10.5px system-ui, sans-serif";
  context.fillStyle = style("--quiet");
  context.textBaseline = "alphabetic";
  context.textAlign = "left";
  context.fillText("0", 0, height - 2);
  context.textAlign = "right";
  context.fillText(`${top} DN`, width, height - 2);
}

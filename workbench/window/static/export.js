// What leaves the page: the overlay as PNG or SVG, points and tables as CSV.

import { post } from "./api.js";
import { el } from "./dom.js";
import { SvgContext } from "./svg.js";
import { state, text } from "./state.js";

export function download(name, content, type) {
  const blob = content instanceof Blob ? content : new Blob([content], { type });
  const link = el("a", { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

const stem = () => state.session.images[state.index].name.split("/").pop().replace(/\.[^.]*$/, "");
const blobOf = (canvas) => (canvas.convertToBlob ? canvas.convertToBlob({ type: "image/png" }) : new Promise((done) => canvas.toBlob(done, "image/png")));

// The whole image with its layers, one pixel a pixel: `paint(context, view)` draws the layers.
export async function exportPng(surface, size, paint) {
  const canvas = new OffscreenCanvas(size.width, size.height), context = canvas.getContext("2d");
  if (surface) context.drawImage(surface, 0, 0);
  paint(context, whole(size));
  download(`${stem()}_overlay.png`, await blobOf(canvas));
}

export async function exportSvg(surface, size, paint) {
  const context = new SvgContext(size.width, size.height);
  if (surface) context.picture(await dataOf(await blobOf(surface)));
  paint(context, whole(size));
  download(`${stem()}_overlay.svg`, context.document(), "image/svg+xml");
}

// Pixel (0, 0) is the centre of the first pixel.
const whole = ({ width, height }) => ({ scale: 1, toScreen: (u, v) => [u + 0.5, v + 0.5], canvas: { width, height } });

const dataOf = (blob) => new Promise((done) => {
  const reader = new FileReader();
  reader.onload = () => done(reader.result);
  reader.readAsDataURL(blob);
});

export async function exportPoints() {
  const { csv } = await post("points", { index: state.index, config: text() });
  download(`${stem()}_points.csv`, csv, "text/csv");
}

// Enough of a canvas's context to draw the layers as vectors.

const round = (x) => Math.round(x * 100) / 100;
const safe = (text) => String(text).replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;").replaceAll('"', "&quot;");

export class SvgContext {
  constructor(width, height) {
    this.canvas = { width, height };
    this.out = [];
    this.path = [];
    Object.assign(this, { strokeStyle: "#000", fillStyle: "#000", lineWidth: 1, globalAlpha: 1, font: "12px sans-serif", textAlign: "left", textBaseline: "alphabetic" });
    this.dash = [];
  }

  picture(href) { this.out.push(`<image href="${href}" width="${this.canvas.width}" height="${this.canvas.height}" image-rendering="pixelated"/>`); }
  beginPath() { this.path = []; }
  closePath() { this.path.push("Z"); }
  moveTo(x, y) { this.path.push(`M${round(x)} ${round(y)}`); }
  lineTo(x, y) { this.path.push(`${this.path.length ? "L" : "M"}${round(x)} ${round(y)}`); }
  rect(x, y, w, h) { this.path.push(`M${round(x)} ${round(y)}h${round(w)}v${round(h)}h${round(-w)}Z`); }
  arc(x, y, r, from = 0, to = 2 * Math.PI) { this.ellipse(x, y, r, r, 0, from, to); }

  ellipse(x, y, rx, ry, turn, from = 0, to = 2 * Math.PI) {
    const at = (a) => [x + rx * Math.cos(a) * Math.cos(turn) - ry * Math.sin(a) * Math.sin(turn), y + rx * Math.cos(a) * Math.sin(turn) + ry * Math.sin(a) * Math.cos(turn)].map(round).join(" ");
    const steps = Math.max(2, Math.ceil(Math.abs(to - from) / (Math.PI / 2)));
    this.path.push(`${this.path.length && to - from < 6.28 ? "L" : "M"}${at(from)}`);
    for (let k = 1; k <= steps; k++) this.path.push(`A${round(rx)} ${round(ry)} ${round(turn * 180 / Math.PI)} 0 1 ${at(from + (to - from) * k / steps)}`);
  }

  add(extra) { this.out.push(`<path d="${this.path.join("")}" ${extra} opacity="${this.globalAlpha}"/>`); }
  stroke() { this.add(`fill="none" stroke="${safe(this.strokeStyle)}" stroke-width="${this.lineWidth}" stroke-dasharray="${this.dash.join(" ")}"`); }
  fill(rule = "nonzero") { this.add(`fill="${safe(this.fillStyle)}" fill-rule="${rule}"`); }
  setLineDash(dash) { this.dash = dash; }
  box(x, y, w, h, kind) { const kept = this.path; this.path = []; this.rect(x, y, w, h); if (kind === "fill") this.fill(); else this.stroke(); this.path = kept; }
  fillRect(x, y, w, h) { this.box(x, y, w, h, "fill"); }
  strokeRect(x, y, w, h) { this.box(x, y, w, h, "stroke"); }
  clearRect() {}
  save() {}
  restore() {}

  words(text, x, y, paint) {
    const anchor = { left: "start", right: "end", center: "middle" }[this.textAlign], base = { middle: "central", top: "hanging", bottom: "auto" }[this.textBaseline] ?? "auto";
    this.out.push(`<text x="${round(x)}" y="${round(y)}" style="font: ${safe(this.font)}" text-anchor="${anchor}" dominant-baseline="${base}" ${paint}>${safe(text)}</text>`);
  }

  fillText(text, x, y) { this.words(text, x, y, `fill="${safe(this.fillStyle)}"`); }
  strokeText(text, x, y) { this.words(text, x, y, `fill="none" stroke="${safe(this.strokeStyle)}" stroke-width="${this.lineWidth}"`); }

  document() {
    const { width, height } = this.canvas;
    return `<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 ${width} ${height}" width="${width}" height="${height}">\n${this.out.join("\n")}\n</svg>\n`;
  }
}

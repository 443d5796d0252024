// A pannable, zoomable plane under a canvas: one transform, the same for images and for the (y, z) plot.

const LOWEST = 0.02, HIGHEST = 96;

export class View {
  // box: [x0, y0, x1, y1] of the content in its own units.
  constructor(canvas, changed) {
    this.canvas = canvas;
    this.changed = changed;
    this.scale = 1;
    this.x = this.y = 0;
    this.box = [0, 0, 1, 1];
    this.fitted = true;
    this.limits = [LOWEST, HIGHEST];
    this.margins = [0, 0, 0, 0]; // left, top, right, bottom: for what is written there, of canvases with room for it
    canvas.addEventListener("wheel", (e) => this.wheel(e), { passive: false });
    canvas.addEventListener("pointerdown", (e) => this.down(e));
    canvas.addEventListener("pointermove", (e) => this.move(e));
    canvas.addEventListener("pointerup", (e) => this.up(e));
    canvas.addEventListener("pointercancel", () => { this.drag = null; });
    canvas.addEventListener("pointerleave", () => this.hover?.(null));
    canvas.addEventListener("dblclick", () => this.fit());
    new ResizeObserver(() => { if (this.fitted) this.fit(); else this.changed(); }).observe(canvas);
  }

  toScreen(u, v) { return [u * this.scale + this.x, v * this.scale + this.y]; }
  toContent(a, b) { return [(a - this.x) / this.scale, (b - this.y) / this.scale]; }

  fit() {
    const [x0, y0, x1, y1] = this.box;
    const w = this.canvas.clientWidth, h = this.canvas.clientHeight;
    if (!w || !h) return;
    const [left, top, right, bottom] = this.margins.map((m, i) => Math.min(m, (i % 2 ? h : w) / 6));
    this.scale = Math.min((w - left - right) / (x1 - x0), (h - top - bottom) / (y1 - y0)) * 0.99;
    this.x = (left + w - right) / 2 - this.scale * (x0 + x1) / 2;
    this.y = (top + h - bottom) / 2 - this.scale * (y0 + y1) / 2;
    this.fitted = true;
    this.changed();
  }

  zoom(factor, a = this.canvas.clientWidth / 2, b = this.canvas.clientHeight / 2) {
    const [u, v] = this.toContent(a, b);
    this.scale = Math.min(this.limits[1], Math.max(this.limits[0], this.scale * factor));
    this.x = a - u * this.scale;
    this.y = b - v * this.scale;
    this.fitted = false;
    this.changed();
  }

  centre(u, v, scale = this.scale) {
    this.scale = scale;
    this.x = this.canvas.clientWidth / 2 - u * scale;
    this.y = this.canvas.clientHeight / 2 - v * scale;
    this.fitted = false;
    this.changed();
  }

  pan(dx, dy) {
    this.x += dx;
    this.y += dy;
    this.fitted = false;
    this.changed();
  }

  wheel(event) {
    event.preventDefault();
    const lines = event.deltaMode === 1 ? 30 : 1;
    const [a, b] = this.at(event);
    this.zoom(Math.exp(-event.deltaY * lines * 0.0016), a, b);
  }

  at(event) {
    const r = this.canvas.getBoundingClientRect();
    return [event.clientX - r.left, event.clientY - r.top];
  }

  down(event) {
    if (event.button > 1) return;
    this.canvas.setPointerCapture(event.pointerId);
    this.drag = { at: this.at(event), moved: false, grabbed: this.grab?.(this.at(event), false) ?? false };
  }

  move(event) {
    const here = this.at(event);
    if (this.drag?.grabbed) this.grab(here, true);
    else if (this.drag) {
      const dx = here[0] - this.drag.at[0], dy = here[1] - this.drag.at[1];
      if (this.drag.moved || Math.hypot(dx, dy) > 3) {
        this.drag = { ...this.drag, at: here, moved: true };
        this.pan(dx, dy);
      }
    }
    this.hover?.(here);
  }

  up(event) {
    const still = this.drag && !this.drag.moved && !this.drag.grabbed;
    this.drag = null;
    if (still) this.click?.(this.at(event));
  }
}

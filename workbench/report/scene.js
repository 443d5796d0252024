// The cell in three dimensions by WebGL: arm, sensor, sheet, targets, measured points. Works offline, alone in a page.
"use strict";
{
  const VERTEX = `attribute vec3 at; attribute vec4 ink; uniform mat4 camera; uniform float size; varying vec4 colour;
    void main() { gl_Position = camera * vec4(at, 1.0); gl_PointSize = size; colour = ink; }`;
  const FRAGMENT = `precision mediump float; varying vec4 colour; uniform bool round;
    void main() { if (round && length(gl_PointCoord - 0.5) > 0.5) discard; gl_FragColor = colour; }`;
  const multiply = (a, b) => { // columns first
    const out = new Float32Array(16);
    for (let c = 0; c < 4; c++) for (let r = 0; r < 4; r++) for (let k = 0; k < 4; k++) out[4 * c + r] += a[4 * k + r] * b[4 * c + k];
    return out;
  };
  const rgba = (text, alpha = 1) => { const n = parseInt(text.slice(1), 16); return [(n >> 16 & 255) / 255, (n >> 8 & 255) / 255, (n & 255) / 255, alpha]; };

  // scene: as the program's JSON has it; colours: ground, text, quiet, accent, good, bad, warn as #rrggbb. Gives { show, colours, redraw }.
  globalThis.startScene = (canvas, scene, colours, changed = () => {}) => {
    const gl = canvas.getContext("webgl", { antialias: true, preserveDrawingBuffer: true });
    if (!gl) return null;
    const program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.bindAttribLocation(program, 0, "at");
    gl.bindAttribLocation(program, 1, "ink");
    gl.linkProgram(program);
    gl.useProgram(program);
    const buffer = gl.createBuffer(), place = { turn: -0.9, tilt: 0.35, distance: 1, centre: [0, 0, 0] };
    let shown = scene.frames.find((f) => f.used)?.frame ?? scene.frames[0]?.frame, owed = 0, drag = null;

    const all = [[0, 0, 0], ...scene.targets.flatMap((t) => t.lines.flat()), ...scene.frames.flatMap((f) => f.arm)];
    const low = [0, 1, 2].map((k) => Math.min(...all.map((p) => p[k]))), high = [0, 1, 2].map((k) => Math.max(...all.map((p) => p[k])));
    const reach = Math.max(200, Math.hypot(...high.map((h, k) => h - low[k])));
    const home = () => { Object.assign(place, { turn: -0.9, tilt: 0.35, distance: 1.25 * reach, centre: low.map((l, k) => (l + high[k]) / 2) }); redraw(); };

    const lines = [], faces = [], dots = [];
    const line = (a, b, ink) => lines.push([...a, ...ink], [...b, ...ink]);

    function collect() {
      lines.length = faces.length = dots.length = 0;
      const soft = rgba(colours.quiet, 0.28), arm = rgba(colours.text, 0.9), step = 200, span = Math.ceil(reach / 2 / step) * step;
      const [cx, cy] = place.floor ??= [0, 1].map((k) => Math.round((low[k] + high[k]) / 2 / step) * step);
      for (let d = -span; d <= span; d += step) {
        line([cx + d, cy - span, 0], [cx + d, cy + span, 0], soft);
        line([cx - span, cy + d, 0], [cx + span, cy + d, 0], soft);
      }
      const axis = 0.09 * reach;
      line([0, 0, 0], [axis, 0, 0], rgba(colours.bad));
      line([0, 0, 0], [0, axis, 0], rgba(colours.good));
      line([0, 0, 0], [0, 0, axis], rgba(colours.accent));
      for (const t of scene.targets) for (const [a, b] of t.lines) line(a, b, rgba(t.role === "verify" ? colours.warn : colours.accent));
      for (const f of scene.frames) {
        const current = f.frame === shown;
        for (const p of f.points) dots.push([...p, ...rgba(!f.used ? colours.bad : current ? colours.good : colours.quiet, current ? 1 : 0.75)]);
        dots.push([...f.sensor, ...rgba(f.used ? colours.text : colours.bad, current ? 1 : 0.4)]);
        if (!current) continue;
        const joints = f.arm.length > 1 ? [[0, 0, 0], ...f.arm] : f.arm;
        joints.forEach((p, i) => { if (i) line(joints[i - 1], p, arm); dots.push([...p, ...arm]); });
        if (joints.length && !f.target.length) line(joints[joints.length - 1], f.sensor, arm);
        for (const [a, b] of f.target) line(a, b, rgba(colours.accent));
        f.sheet.forEach((p, i) => {
          const q = f.sheet[(i + 1) % f.sheet.length], ink = rgba(colours.bad, 0.16);
          line(p, q, rgba(colours.bad, 0.8));
          faces.push([...f.laser, ...ink], [...p, ...ink], [...q, ...ink]);
        });
      }
    }

    function camera(width, height) {
      const { turn, tilt, distance, centre } = place, c = Math.cos(tilt), s = Math.sin(tilt);
      const back = [c * Math.cos(turn), c * Math.sin(turn), s], right = [-Math.sin(turn), Math.cos(turn), 0];
      const up = [-s * Math.cos(turn), -s * Math.sin(turn), c], eye = centre.map((x, k) => x + distance * back[k]);
      const dot = (a) => -a.reduce((n, x, k) => n + x * eye[k], 0);
      const view = new Float32Array([right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0, dot(right), dot(up), dot(back), 1]);
      const f = 1 / Math.tan(0.35), near = 0.02 * distance, far = distance + 4 * reach;
      return multiply(new Float32Array([f * height / width, 0, 0, 0, 0, f, 0, 0, 0, 0, (near + far) / (near - far), -1, 0, 0, 2 * near * far / (near - far), 0]), view);
    }

    function paint() {
      owed = 0;
      const ratio = globalThis.devicePixelRatio || 1, width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
      if (!width || !height) return;
      if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
      gl.viewport(0, 0, width, height);
      gl.clearColor(...rgba(colours.ground));
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      gl.enable(gl.BLEND);
      gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
      gl.uniformMatrix4fv(gl.getUniformLocation(program, "camera"), false, camera(width, height));
      gl.uniform1f(gl.getUniformLocation(program, "size"), 5 * ratio);
      collect();
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      for (const [kind, list] of [[gl.LINES, lines], [gl.TRIANGLES, faces], [gl.POINTS, dots]]) {
        gl.uniform1i(gl.getUniformLocation(program, "round"), kind === gl.POINTS ? 1 : 0);
        gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(list.flat()), gl.DYNAMIC_DRAW);
        gl.enableVertexAttribArray(0);
        gl.enableVertexAttribArray(1);
        gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 28, 0);
        gl.vertexAttribPointer(1, 4, gl.FLOAT, false, 28, 12);
        gl.drawArrays(kind, 0, list.length);
      }
    }

    function redraw() { owed ||= requestAnimationFrame(paint); }
    const tilt = (by) => { place.tilt = Math.min(1.5, Math.max(-0.4, place.tilt + by)); };
    const shift = (dx, dy) => {
      const k = place.distance * 0.0011;
      place.centre[0] += k * dx * Math.sin(place.turn); place.centre[1] -= k * dx * Math.cos(place.turn); place.centre[2] += k * dy;
    };
    canvas.addEventListener("pointerdown", (e) => { drag = [e.clientX, e.clientY, e.shiftKey || e.button > 0]; canvas.setPointerCapture(e.pointerId); });
    canvas.addEventListener("pointermove", (e) => {
      if (!drag) return;
      const [dx, dy] = [e.clientX - drag[0], e.clientY - drag[1]];
      if (drag[2]) shift(dx, dy); else { place.turn -= 0.008 * dx; tilt(0.008 * dy); }
      drag = [e.clientX, e.clientY, drag[2]];
      redraw();
    });
    canvas.addEventListener("pointerup", () => { drag = null; });
    canvas.addEventListener("contextmenu", (e) => e.preventDefault());
    canvas.addEventListener("wheel", (e) => { e.preventDefault(); place.distance *= Math.exp(0.0012 * e.deltaY); redraw(); }, { passive: false });
    canvas.addEventListener("dblclick", home);
    canvas.addEventListener("keydown", (e) => {
      const act = {
        ArrowLeft: () => { place.turn += 0.1; }, ArrowRight: () => { place.turn -= 0.1; }, ArrowUp: () => tilt(0.1), ArrowDown: () => tilt(-0.1),
        "+": () => { place.distance *= 0.85; }, "-": () => { place.distance /= 0.85; }, Home: home,
        PageDown: () => step(1), PageUp: () => step(-1),
      }[e.key];
      if (!act) return;
      e.preventDefault();
      e.stopPropagation();
      act();
      redraw();
    });
    new ResizeObserver(redraw).observe(canvas);

    function step(by) {
      const numbers = scene.frames.map((f) => f.frame);
      show(numbers[(numbers.indexOf(shown) + by + numbers.length) % numbers.length]);
    }
    function show(frame) { shown = frame; changed(frame); redraw(); }
    home();
    return { show, redraw, step, colour(next) { Object.assign(colours, next); redraw(); } };
  };
}

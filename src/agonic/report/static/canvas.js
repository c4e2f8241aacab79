// Points and cells of a sphere on plain 2-D canvases, for the report and for the live page.
"use strict";
const sphere = (() => {
  const FAR_ALPHA = 70;      // of 255: points on the far half
  const DRAG = 0.008;        // radians a CSS pixel
  const STEP = Math.PI / 18; // of an arrow key
  const FILL = 0.40;         // radius of the sphere, in widths of the canvas
  const START = { yaw: -0.6, pitch: 0.4 };

  // Rows: screen right, screen up, towards the viewer; z is up at pitch 0.
  function rotation({ yaw, pitch }) {
    const [cy, sy, cp, sp] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
    return [-sy, cy, 0, -sp * cy, -sp * sy, cp, cp * cy, cp * sy, sp];
  }

  function product(a, b) {
    return a.map((_, k) => {
      const [row, column] = [3 * Math.floor(k / 3), k % 3];
      return a[row] * b[column] + a[row + 1] * b[column + 3] + a[row + 2] * b[column + 6];
    });
  }

  const scaled = (matrix, by) => matrix.map((v) => v * by);
  const turned = (m, x, y, z) => [0, 3, 6].map((r) => m[r] * x + m[r + 1] * y + m[r + 2] * z);

  // ---- colours ----------------------------------------------------------------------------

  const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const rgb = (hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16));
  const css = (colour) => `rgb(${colour.join(" ")})`;

  function theme() {
    const [low, mid, high] = ["--low", "--mid", "--high"].map((name) => rgb(style(name)));
    const mix = (a, b, t) => a.map((v, i) => Math.round(v + (b[i] - v) * t));
    const ramp = Array.from({ length: 256 }, (_, i) => {
      const t = (i - 127.5) / 127.5;
      return mix(mid, t < 0 ? low : high, Math.abs(t));
    });
    const packed = (alpha) =>
      Uint32Array.from(ramp, ([r, g, b]) => ((alpha << 24) | (b << 16) | (g << 8) | r) >>> 0);
    return {
      ramp, near: packed(255), far: packed(FAR_ALPHA),
      ink: style("--ink"), line: style("--line"), empty: style("--refused"),
    };
  }

  // Index into the ramp of each point's deviation: |matrix (point + shift)| against its level.
  function shades(points, matrix, shift, level, limit) {
    const result = new Uint8Array(points.length / 3);
    for (let i = 0; i < result.length; i++) {
      const [x, y, z] = shift.map((by, axis) => points[3 * i + axis] + by);
      const size = Math.hypot(...turned(matrix, x, y, z));
      const t = Math.max(-1, Math.min(1, (size / level - 1) / limit));
      result[i] = Math.round(127.5 + 127.5 * t);
    }
    return result;
  }

  // ---- drawing ----------------------------------------------------------------------------

  function fitted(canvas, aspect) {
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const width = Math.max(2, Math.round(canvas.clientWidth * ratio));
    const height = Math.round(width / aspect);
    if (canvas.width !== width || canvas.height !== height) {
      canvas.width = width;
      canvas.height = height;
    }
    return ratio;
  }

  // An empty picture of the size of the canvas, the same one for every frame.
  const pictures = new WeakMap();
  function blank(canvas, context) {
    let picture = pictures.get(canvas);
    if (!picture || picture.image.width !== canvas.width || picture.image.height !== canvas.height) {
      const image = context.createImageData(canvas.width, canvas.height);
      picture = { image, pixels: new Uint32Array(image.data.buffer) };
      pictures.set(canvas, picture);
    }
    picture.pixels.fill(0);
    return picture;
  }

  // Rotate, project, and write squares of pixels; near points hide far ones.
  function drawPoints(context, points, shade, matrix, colours, dot) {
    const { width, height } = context.canvas;
    const { image, pixels } = blank(context.canvas, context);
    const unit = FILL * width;
    const [rx, ry, rz, ux, uy, uz, tx, ty, tz] = matrix;
    for (let i = 0, k = 0; i < shade.length; i++, k += 3) {
      const x = points[k], y = points[k + 1], z = points[k + 2];
      const near = tx * x + ty * y + tz * z >= 0;
      const left = Math.round(width / 2 + unit * (rx * x + ry * y + rz * z) - dot / 2);
      const top = Math.round(height / 2 - unit * (ux * x + uy * y + uz * z) - dot / 2);
      if (left < 0 || top < 0 || left + dot > width || top + dot > height) continue;
      const colour = near ? colours.near[shade[i]] : colours.far[shade[i]];
      for (let row = top; row < top + dot; row++) {
        for (let at = row * width + left, end = at + dot; at < end; at++) {
          if (near || pixels[at] === 0) pixels[at] = colour;
        }
      }
    }
    context.putImageData(image, 0, 0);
  }

  // Visits the cells of one half as paths in pixels: near (side 1) or far (side −1).
  function eachCell(corners, matrix, side, centre, unit, visit) {
    for (let cell = 0; cell < 80; cell++) {
      const path = new Path2D();
      let depth = 0;
      for (let corner = 0; corner < 3; corner++) {
        const k = 9 * cell + 3 * corner;
        const [right, up, towards] = turned(matrix, corners[k], corners[k + 1], corners[k + 2]);
        path.lineTo(centre[0] + unit * right, centre[1] - unit * up);
        depth += towards;
      }
      path.closePath();
      if (depth * side > 0) visit(cell, path);
    }
  }

  function drawCoverage(context, corners, view, counts, colours, ratio) {
    const centre = [context.canvas.width / 2, context.canvas.height / 2];
    const unit = FILL * context.canvas.width;
    for (const [side, layer, strength] of [[-1, "destination-over", 0.35], [1, "source-over", 1]]) {
      context.globalCompositeOperation = layer;
      for (const empty of [false, true]) {
        eachCell(corners, view, side, centre, unit, (cell, path) => {
          if ((counts[cell] === 0) !== empty) return;
          context.strokeStyle = context.fillStyle = empty ? colours.empty : colours.line;
          context.lineWidth = (empty ? 1.5 : 0.75) * ratio;
          context.globalAlpha = strength * (empty ? 1 : 0.6);
          context.stroke(path);
          context.globalAlpha = strength * 0.14;
          if (empty) context.fill(path);
        });
      }
    }
    context.globalAlpha = 1;
    context.globalCompositeOperation = "source-over";
  }

  // The axes with their names, which stay inside the picture.
  function drawAxes(context, view, colours, ratio, names = ["x", "y", "z"]) {
    const { width, height } = context.canvas;
    context.font = `600 ${12 * ratio}px system-ui, sans-serif`;
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.lineWidth = ratio;
    names.forEach((name, i) => {
      const [right, up, towards] = [view[i], view[3 + i], view[6 + i]];
      const at = (r) => [width / 2 + r * FILL * width * right, height / 2 - r * FILL * width * up];
      context.globalAlpha = towards < 0 ? 0.5 : 1;
      context.strokeStyle = context.fillStyle = colours.ink;
      context.beginPath();
      context.moveTo(...at(1));
      context.lineTo(...at(1.1));
      context.stroke();
      const [x, y] = at(1.17);
      const half = context.measureText(name).width / 2;
      context.fillText(name, Math.max(half, Math.min(width - half, x)), y);
    });
    context.globalAlpha = 1;
  }

  // A cross where readings of zero lie: how far the bias has moved the cloud.
  function drawZero(context, place, colours, ratio) {
    const { width, height } = context.canvas;
    const [x, y] = [width / 2 + FILL * width * place[0], height / 2 - FILL * width * place[1]];
    const arm = 7 * ratio;
    context.strokeStyle = colours.ink;
    context.lineWidth = 2 * ratio;
    context.beginPath();
    context.moveTo(x - arm, y);
    context.lineTo(x + arm, y);
    context.moveTo(x, y - arm);
    context.lineTo(x, y + arm);
    context.stroke();
  }

  // ---- turning ----------------------------------------------------------------------------

  // Pointer and arrow keys turn `angles` and ask for `redraw`; Home goes back to the start.
  function turnable(canvas, angles, redraw) {
    function turn(yaw, pitch) {
      angles.yaw += yaw;
      angles.pitch = Math.max(-Math.PI / 2, Math.min(Math.PI / 2, angles.pitch + pitch));
      redraw();
    }
    const keys = {
      ArrowLeft: () => turn(STEP, 0), ArrowRight: () => turn(-STEP, 0),
      ArrowUp: () => turn(0, -STEP), ArrowDown: () => turn(0, STEP),
      Home: () => { Object.assign(angles, START); redraw(); },
    };
    let last = null;
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      last = event;
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!canvas.hasPointerCapture(event.pointerId)) return;
      turn(DRAG * (last.clientX - event.clientX), DRAG * (event.clientY - last.clientY));
      last = event;
    });
    canvas.addEventListener("keydown", (event) => {
      if (!(event.key in keys)) return;
      event.preventDefault();
      keys[event.key]();
    });
  }

  return {
    FILL, START, css, drawAxes, drawCoverage, drawPoints, drawZero, eachCell, fitted, product,
    rotation, scaled, shades, theme, turnable, turned,
  };
})();

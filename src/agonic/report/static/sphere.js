// The sphere before and after, and the residuals over it: what each sensor of the report shows.
"use strict";
(() => {
  const {
    START, css, drawAxes, drawCoverage, drawPoints, drawZero, eachCell, fitted, product, rotation,
    scaled, shades, theme, turnable, turned,
  } = sphere;
  const json = (id) => JSON.parse(document.getElementById(id).textContent);
  const corners = json("icosphere");

  function decoded(base64) {
    const bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
    const view = new DataView(bytes.buffer);
    return Float32Array.from({ length: bytes.length / 2 }, (_, i) => view.getInt16(2 * i, true));
  }

  // ---- one sensor -------------------------------------------------------------------------

  function sensor(article) {
    const data = json(article.dataset.source);
    const points = decoded(data.points).map((v) => v * data.step);
    const identity = [1, 0, 0, 0, 1, 0, 0, 0, 1];
    const clouds = {
      before: {
        shape: scaled(identity, 1 / data.radius),
        shade: shades(points, identity, data.bias, data.levelRaw, data.deviation),
      },
      after: {
        shape: scaled(data.matrix, 1 / data.level),
        shade: shades(points, data.matrix, [0, 0, 0], data.level, data.deviation),
      },
    };
    const shown = data.middle.some((m) => m !== 0) ? points.map((v, i) => v - data.middle[i % 3]) : points;
    const zero = data.bias.map((b, i) => (-b - data.middle[i]) / data.radius);
    const canvases = [...article.querySelectorAll("canvas")];
    const angles = { ...START };
    let colours = theme();
    let waiting = false;

    function drawCloud(canvas, cloud, view) {
      const ratio = fitted(canvas, 1);
      const dot = Math.round(ratio * (points.length < 15000 ? 3 : 2));
      const context = canvas.getContext("2d");
      drawPoints(context, cloud === clouds.before ? shown : points, cloud.shade, product(view, cloud.shape), colours, dot);
      if (cloud === clouds.after) drawCoverage(context, corners, view, data.counts, colours, ratio);
      else drawZero(context, turned(view, ...zero), colours, ratio);
      drawAxes(context, view, colours, ratio);
    }

    // Near half on the left, far half on the right, the latter as seen through the sphere.
    function drawResiduals(canvas, view) {
      const ratio = fitted(canvas, 2);
      const context = canvas.getContext("2d");
      const { width, height } = canvas;
      context.clearRect(0, 0, width, height);
      context.lineWidth = 0.75 * ratio;
      for (const side of [1, -1]) {
        const centre = [width * (side > 0 ? 0.25 : 0.75), height / 2];
        eachCell(corners, view, side, centre, 0.23 * width, (cell, path) => {
          const mean = data.means[cell];
          if (mean !== null) {
            const index = Math.round(127.5 + 127.5 * mean / data.meanLimit);
            context.fillStyle = css(colours.ramp[index]);
            context.fill(path);
          }
          context.strokeStyle = colours.line;
          context.stroke(path);
        });
      }
    }

    function draw() {
      waiting = false;
      const view = rotation(angles);
      for (const canvas of canvases) {
        if (canvas.dataset.part === "residuals") drawResiduals(canvas, view);
        else drawCloud(canvas, clouds[canvas.dataset.part], view);
      }
    }

    function redraw() {
      if (!waiting) requestAnimationFrame(draw);
      waiting = true;
    }

    canvases.forEach((canvas) => turnable(canvas, angles, redraw));
    const observer = new ResizeObserver(draw);
    canvases.forEach((canvas) => observer.observe(canvas));
    return () => { colours = theme(); draw(); };
  }

  const repaint = [...document.querySelectorAll("[data-source]")].map(sensor);
  for (const query of ["(prefers-color-scheme: dark)", "print"]) {
    matchMedia(query).addEventListener("change", () => repaint.forEach((again) => again()));
  }
})();

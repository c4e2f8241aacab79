// The figures of a fleet: what is selected is drawn over them, and they select.
"use strict";
const fleetFigures = (() => {
  const KEYS = "Arrow keys choose a bar, with Shift several; Enter selects, Escape clears.";
  const { counted, make, minused } = fleetRows;

  const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const rgb = (hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16));

  function fitted(canvas) {
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((v) => Math.max(1, Math.round(v * ratio)));
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    return canvas.getContext("2d");
  }

  // A canvas over the area of a figure, with the columns and axes that it was drawn with.
  function figure(box) {
    const canvas = make("canvas");
    box.querySelector(".area").after(canvas);
    const { kind, group, columns: names, bins, name, size } = box.dataset;
    const [x, y] = [box.dataset.x, box.dataset.y].map((text) => text.split(" ").map(Number));
    return { box, canvas, kind, name, x, y, group: Number(group), bins: Number(bins),
             size: Number(size), columns: names.split(" "), said: box.querySelector(".picked") };
  }

  function tallied(one, data, kept, rows) {
    const counts = new Uint32Array(one.bins);
    const values = data[one.columns[0]];
    const [low, high] = one.x;
    const by = one.bins / (high - low);
    for (let i = 0; i < rows; i++) {
      if (!kept[i] || data.group[i] !== one.group) continue;
      const at = (one.size * values[i] - low) * by;
      if (at === at) counts[Math.max(0, Math.min(one.bins - 1, Math.floor(at)))]++;
    }
    return counts;
  }

  function drawBars(one, data, chosen, rows, range) {
    const context = fitted(one.canvas);
    const { width, height } = one.canvas;
    context.clearRect(0, 0, width, height);
    context.fillStyle = style("--accent");
    one.counts = tallied(one, data, chosen.kept, rows);
    if (chosen.count < rows) {
      one.counts.forEach((n, k) => {
        const tall = (n / one.y[1]) * height;
        const left = Math.round((k * width) / one.bins);
        context.fillRect(left, height - tall, Math.round(((k + 1) * width) / one.bins) - left, tall);
      });
    }
    const across = (value) => ((Math.max(one.x[0], Math.min(one.x[1], value)) - one.x[0]) / (one.x[1] - one.x[0])) * width;
    if (range) {
      context.globalAlpha = 0.16;
      context.fillRect(across(range.low), 0, Math.max(2, across(range.high) - across(range.low)), height);
      context.globalAlpha = 1;
    }
    if (one.cursor >= 0) {
      context.strokeStyle = style("--ink");
      context.lineWidth = 2;
      context.strokeRect((one.cursor * width) / one.bins, 1, width / one.bins, height - 2);
    }
  }

  // How many of the points that belong cover each pixel, as squares of `dot` pixels.
  function piled(one, data, rows, width, height, dot, belongs) {
    const piles = new Uint16Array(width * height);
    const [across, along] = one.columns.map((name) => data[name]);
    const [xs, ys] = [width / (one.x[1] - one.x[0]), height / (one.y[1] - one.y[0])];
    for (let i = 0; i < rows; i++) {
      if (data.group[i] !== one.group || !belongs(i)) continue;
      const left = Math.round((across[i] - one.x[0]) * xs - dot / 2);
      const top = Math.round(height - (along[i] - one.y[0]) * ys - dot / 2);
      if (!(left >= 0 && top >= 0 && left + dot <= width && top + dot <= height)) continue;
      for (let row = top; row < top + dot; row++) {
        for (let at = row * width + left, end = at + dot; at < end; at++) piles[at]++;
      }
    }
    return piles;
  }

  // Points, the darker the more of them; what is not selected below, what stands out on top.
  function drawPoints(one, data, chosen, rows, ranges) {
    const context = fitted(one.canvas);
    const { width, height } = one.canvas;
    const image = context.createImageData(width, height);
    const pixels = new Uint32Array(image.data.buffer);
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const few = rows < 5000 ? 1 : 0;
    const layers = [["--line", 2 + few, (i) => !chosen.kept[i]],
                    ["--accent", 2 + few, (i) => chosen.kept[i] && data.noted[i] < 2],
                    ["--high", 4 + few, (i) => chosen.kept[i] && data.noted[i] === 2]];
    for (const [name, dot, belongs] of layers) {
      const piles = piled(one, data, rows, width, height, Math.round(dot * ratio), belongs);
      const [r, g, b] = rgb(style(name));
      const most = Math.log1p(piles.reduce((a, n) => Math.max(a, n), 1));
      const faint = name === "--high" || most < 2 ? 255 : 70;
      for (let k = 0; k < piles.length; k++) {
        if (!piles[k]) continue;
        const alpha = Math.round(faint + ((255 - faint) * Math.log1p(piles[k])) / most);
        pixels[k] = ((alpha << 24) | (b << 16) | (g << 8) | r) >>> 0;
      }
    }
    const [xs, ys] = [width / (one.x[1] - one.x[0]), height / (one.y[1] - one.y[0])];
    context.putImageData(image, 0, 0);
    if (!ranges) return;
    const [bx, by] = ranges;
    context.fillStyle = style("--accent");
    context.globalAlpha = 0.16;
    context.fillRect((bx.low - one.x[0]) * xs, height - (by.high - one.y[0]) * ys, (bx.high - bx.low) * xs, (by.high - by.low) * ys);
    context.globalAlpha = 1;
  }

  const short = (value, axis) => {
    const places = Math.max(0, Math.min(6, 2 - Math.floor(Math.log10(axis[1] - axis[0]))));
    return minused(value.toFixed(places));
  };

  // The range from one bar to another; the outermost bars hold what lies beyond the axis.
  function barRange(one, from, to) {
    const [first, last] = [Math.min(from, to), Math.max(from, to)];
    const edge = (k) => one.x[0] + (k * (one.x[1] - one.x[0])) / one.bins;
    return { column: one.columns[0], group: one.group, size: one.size,
             low: first === 0 ? -Infinity : edge(first), high: last === one.bins - 1 ? Infinity : edge(last + 1) };
  }

  function rangeWords(range, axis) {
    if (range.low === -Infinity) return `up to ${short(range.high, axis)}`;
    if (range.high === Infinity) return `from ${short(range.low, axis)}`;
    return `${short(range.low, axis)} to ${short(range.high, axis)}`;
  }

  function selectable(one, select) {
    const place = (event) => {
      const area = one.canvas.getBoundingClientRect();
      const share = (value, start, size) => Math.max(0, Math.min(1, (value - start) / size));
      return [share(event.clientX, area.left, area.width), 1 - share(event.clientY, area.top, area.height)];
    };
    const bar = (share) => Math.min(one.bins - 1, Math.floor(share * one.bins));
    const value = (axis, share) => axis[0] + share * (axis[1] - axis[0]);
    function ranges([fx, fy], [tx, ty]) {
      if (one.kind === "histogram") return [barRange(one, bar(fx), bar(tx))];
      const near = (a, b) => (Math.abs(a - b) < 0.02 ? [(a + b) / 2 - 0.015, (a + b) / 2 + 0.015] : [Math.min(a, b), Math.max(a, b)]);
      const base = { group: one.group, size: 1 };
      return [[one.columns[0], one.x, near(fx, tx)], [one.columns[1], one.y, near(fy, ty)]].map(
        ([column, axis, [low, high]]) => ({ ...base, column, low: value(axis, low), high: value(axis, high) }));
    }
    let from = null;
    one.canvas.addEventListener("pointerdown", (event) => {
      one.canvas.setPointerCapture(event.pointerId);
      from = place(event);
    });
    one.canvas.addEventListener("pointermove", (event) => {
      if (from) select(one, ranges(from, place(event)));
      else if (one.kind === "histogram") tell(one, bar(place(event)[0]));
    });
    one.canvas.addEventListener("pointerup", (event) => {
      if (from) select(one, ranges(from, place(event)));
      from = null;
    });
    one.canvas.addEventListener("pointercancel", () => { from = null; });
    one.canvas.addEventListener("pointerleave", () => { if (one.cursor === undefined) one.said.textContent = ""; });
    if (one.kind === "histogram") keyed(one, select);
  }

  function tell(one, k) {
    if (one.counts) one.said.textContent = `${rangeWords(barRange(one, k, k), one.x)}: ${counted(one.counts[k])}`;
  }

  function keyed(one, select) {
    const { canvas } = one;
    canvas.tabIndex = 0;
    canvas.setAttribute("role", "application");
    canvas.setAttribute("aria-label", `${one.name}. ${KEYS}`);
    let start = null;
    canvas.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -1, ArrowRight: 1, Home: -one.bins, End: one.bins }[event.key];
      const cursor = one.cursor ?? Math.floor(one.bins / 2);
      if (step) {
        if (!event.shiftKey) start = null;
        else start ??= cursor;
        one.cursor = Math.max(0, Math.min(one.bins - 1, cursor + step));
        if (start !== null) select(one, [barRange(one, start, one.cursor)]);
        else select(one, undefined);
        tell(one, one.cursor);
      } else if (event.key === "Enter" || event.key === " ") {
        select(one, [barRange(one, start ?? cursor, cursor)]);
      } else if (event.key === "Escape") {
        start = null;
        select(one, null);
      } else return;
      event.preventDefault();
    });
    canvas.addEventListener("blur", () => { delete one.cursor; select(one, undefined); });
  }

  return { drawBars, drawPoints, figure, rangeWords, selectable };
})();

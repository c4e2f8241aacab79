// The rows of a fleet: unpacked once, selected by words, verdicts and ranges, put in order.
"use strict";
const fleetRows = (() => {
  const NO_TIME = -(2 ** 31);
  const KINDS = ["good", "check", "refused"];

  const make = (name, properties = {}, ...children) => {
    const made = Object.assign(document.createElement(name), properties);
    made.append(...children);
    return made;
  };
  const grouped = (n) => n.toLocaleString("en").replaceAll(",", "\u202f");
  const minused = (text) => text.replace(/^-/, "\u2212");
  const counted = (n) => `${grouped(n)} ${n === 1 ? "calibration" : "calibrations"}`;

  // ---- unpacking --------------------------------------------------------------------------

  async function unpacked(text) {
    const letters = atob(text);
    const packed = new Uint8Array(letters.length);
    for (let i = 0; i < packed.length; i++) packed[i] = letters.charCodeAt(i);
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  }

  // Bytes lie plane by plane: all first bytes, then all second ones.
  function words32(bytes, n) {
    const whole = new Uint32Array(n);
    for (let plane = 0; plane < 4; plane++) {
      const [start, shift] = [plane * n, 8 * plane];
      for (let i = 0; i < n; i++) whole[i] |= bytes[start + i] << shift;
    }
    return whole.buffer;
  }

  const decoded = {
    u8: (bytes) => bytes,
    i8: (bytes) => new Int8Array(bytes.buffer, bytes.byteOffset, bytes.length),
    f32: (bytes, n) => new Float32Array(words32(bytes, n)),
    minutes: (bytes, n) => Float64Array.from(
      new Int32Array(words32(bytes, n)), (t) => (t === NO_TIME ? NaN : t)),
    text: (bytes) => new TextDecoder().decode(bytes).split("\n"),
  };

  function columns(bytes) {
    const view = new DataView(bytes.buffer, bytes.byteOffset);
    const size = view.getUint32(0, true);
    const index = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + size)));
    const data = {};
    let at = 4 + size;
    for (const { name, kind, bytes: length } of index.columns) {
      data[name] = decoded[kind](bytes.subarray(at, at + length), index.rows);
      at += length;
    }
    return { rows: index.rows, data };
  }

  // ---- what is selected -------------------------------------------------------------------

  // Rows in the order of the table that pass the words, the verdict and every range.
  function selection(rows, data) {
    const orders = new Map();
    const state = { words: "", verdict: "", ranges: new Map(), sort: "", down: false };
    const kept = new Uint8Array(rows);
    let haystack = null;
    let order = new Uint32Array(rows);
    let count = 0;

    function sorted(name) {
      if (!orders.has(name)) {
        const index = Uint32Array.from({ length: rows }, (_, i) => i);
        const values = data[name];
        if (!name) return index;
        if (Array.isArray(values)) {
          index.sort((a, b) => (values[a] < values[b] ? -1 : values[a] > values[b] ? 1 : a - b));
        } else {
          const keys = Float64Array.from(values, (v) => (v === v ? v : Infinity));
          index.sort((a, b) => (keys[a] === keys[b] ? a - b : keys[a] < keys[b] ? -1 : 1));
        }
        orders.set(name, index);
      }
      return orders.get(name);
    }

    function search(words) {
      haystack ??= data.sensor.map((name, i) =>
        `${name}\n${data.source[i]}\n${data.said[i]}`.toLowerCase());
      for (let i = 0; i < rows; i++) {
        if (kept[i] && !words.every((word) => haystack[i].includes(word))) kept[i] = 0;
      }
    }

    function limit({ column, low, high, size, group }) {
      const values = data[column];
      for (let i = 0; i < rows; i++) {
        const value = size * values[i];
        if (!(value >= low && value <= high && data.group[i] === group)) kept[i] = 0;
      }
    }

    function apply() {
      const kind = KINDS.indexOf(state.verdict);
      if (state.verdict === "noted") for (let i = 0; i < rows; i++) kept[i] = data.noted[i] ? 1 : 0;
      else if (kind < 0) kept.fill(1);
      else for (let i = 0; i < rows; i++) kept[i] = data.verdict[i] === kind ? 1 : 0;
      for (const ranges of state.ranges.values()) ranges.forEach(limit);
      const words = state.words.toLowerCase().split(/\s+/).filter(Boolean);
      if (words.length) search(words);
      const [by, values] = [sorted(state.sort), data[state.sort]];
      const missing = (i) => values && !Array.isArray(values) && values[i] !== values[i];
      count = 0;
      for (let k = 0; k < rows; k++) {
        const i = by[state.down ? rows - 1 - k : k];
        if (kept[i] && !missing(i)) order[count++] = i;
      }
      for (let k = 0; k < rows; k++) if (kept[by[k]] && missing(by[k])) order[count++] = by[k];
    }

    return { state, kept, apply, at: (k) => order[k], get count() { return count; } };
  }

  return { KINDS, columns, counted, grouped, make, minused, selection, unpacked };
})();

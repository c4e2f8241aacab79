// The table of all rows: however many there are, those in view are drawn.
"use strict";
const fleetTable = (() => {
  const ROW = 34;        // height of a row, CSS pixels, as in fleet.css
  const BEYOND = 8;      // rows drawn above and below what is seen
  const WIDTHS = { name: 8, word: 4.8, said: 8.4, number: 5.1 };  // rem: all within 1280 pixels
  const WORDS = ["Good", "Check", "Refused"];
  const { KINDS, make, minused } = fleetRows;

  const DATE = (minutes) => new Date(minutes * 60000).toISOString().slice(0, 16).replace("T", " ");

  // Decimal places that show two digits of how the middle half of a column differs.
  function decimals(values, size) {
    const step = Math.ceil(values.length / 2000);
    const some = Array.from({ length: Math.floor(values.length / step) }, (_, k) => size * values[k * step]);
    const known = some.filter((v) => v === v).sort((a, b) => a - b);
    const apart = known[Math.floor(0.75 * known.length)] - known[Math.floor(0.25 * known.length)];
    const least = apart > 0 ? apart : Math.abs(known[0]) || 1;
    return Math.max(0, Math.min(6, 1 - Math.floor(Math.log10(least))));
  }

  function cells(data) {
    const numeric = [
      ["bias_x", "Bias x"], ["bias_y", "y"], ["bias_z", "z"], ["gain_x", "Gain x"], ["gain_y", "y"],
      ["gain_z", "z"], ["noise", "Noise"], ["spread_after", "Spread, %", 100],
      ["heading_sd_deg", "Heading, °"], ["temperature_C", "°C"], ["rows", "Readings"],
    ].filter(([name]) => name in data).map(([name, head, size = 1]) => {
      const places = name === "rows" ? 0 : decimals(data[name], size);
      const show = (i) => minused((size * data[name][i]).toFixed(places));
      return { name, head, kind: "number", show: (i) => (data[name][i] === data[name][i] ? show(i) : "–") };
    });
    const dated = data.start.some((t) => t === t)
      ? [{ name: "start", head: "Begins (UTC)", aside: true,
           show: (i) => (data.start[i] === data.start[i] ? DATE(data.start[i]) : "–") }] : [];
    return [
      { name: "sensor", head: "Sensor", kind: "name", show: (i) => data.sensor[i] },
      { name: "verdict", head: "Verdict", kind: "word", show: (i) => WORDS[data.verdict[i]] },
      { name: "said", head: "What is said of it", kind: "said", show: (i) => data.said[i] },
      ...numeric, ...dated,
      { name: "source", head: "Log", aside: true, show: (i) => data.source[i] },
    ];
  }

  function table(chosen, data, rows, changed, picked) {
    const every = cells(data);
    const shown = every.filter(({ aside }) => !aside);  // the rest is in the details of a row
    const head = make("tr");
    const body = make("tbody");
    const [above, below] = [make("tr", { className: "space" }), make("tr", { className: "space" })];
    const pool = [];
    for (const cell of shown) {
      const button = make("button", { type: "button", textContent: cell.head });
      button.addEventListener("click", () => {
        const { state } = chosen;
        const again = state.sort === cell.name;
        [state.sort, state.down] = again && state.down ? ["", false] : [cell.name, again];
        changed();
      });
      head.append(make("th", { scope: "col", className: cell.kind }, button));
    }
    const whole = make("table", {}, make("thead", {}, head), body);
    whole.style.width = `${shown.reduce((sum, { kind }) => sum + WIDTHS[kind], 0)}rem`;
    [...head.children].forEach((th, c) => { th.style.width = `${WIDTHS[shown[c].kind]}rem`; });
    const scroller = make("div", { className: "scroller", tabIndex: 0 }, whole);
    scroller.setAttribute("role", "region");
    scroller.setAttribute("aria-label", "All calibrations, a table");

    function line() {
      const row = make("tr");
      shown.forEach(({ kind }) => row.append(make(kind === "name" ? "th" : "td", { className: kind })));
      row.firstChild.scope = "row";
      return row;
    }

    function fill(row, k) {
      const i = chosen.at(k);
      row.dataset.row = i;
      row.className = data.noted[i] ? "noted" : "";
      row.setAttribute("aria-rowindex", k + 2);
      shown.forEach((cell, c) => {
        const [box, text] = [row.children[c], cell.show(i)];
        if (cell.kind === "name") {
          box.replaceChildren(data.report[i] ? make("a", { href: data.report[i], textContent: text })
            : make("button", { type: "button", textContent: text }));
        } else if (cell.kind === "word") {
          box.replaceChildren(make("span", { className: `word ${KINDS[data.verdict[i]]}`, textContent: text }));
        } else {
          box.textContent = text;
        }
        if (cell.kind === "said") box.title = text;
      });
    }

    // Rows that stay in view are kept; those that leave it at one end come in at the other.
    let first = 0;
    let seen = 0;
    function draw(all) {
      const room = Math.ceil(scroller.clientHeight / ROW) + 2 * BEYOND;
      const top = Math.max(0, Math.floor(scroller.scrollTop / ROW) - BEYOND);
      const begin = Math.min(top, Math.max(0, chosen.count - room));
      const moved = begin - first;
      if (moved === 0 && !all) return;
      const many = Math.min(room, chosen.count - begin);
      if (all || many !== seen || Math.abs(moved) >= seen) {
        while (pool.length < many) pool.push(line());
        for (let k = 0; k < many; k++) fill(pool[k], begin + k);
        body.replaceChildren(above, ...pool.slice(0, many), below);
      } else if (moved > 0) {
        const turned = pool.splice(0, moved);
        turned.forEach((row, k) => fill(row, first + seen + k));
        pool.splice(seen - moved, 0, ...turned);
        below.before(...turned);
      } else {
        const turned = pool.splice(seen + moved, -moved);
        turned.forEach((row, k) => fill(row, begin + k));
        pool.unshift(...turned);
        above.after(...turned);
      }
      [first, seen] = [begin, many];
      above.style.height = `${begin * ROW}px`;
      below.style.height = `${(chosen.count - begin - many) * ROW}px`;
    }

    let waiting = false;
    scroller.addEventListener("scroll", () => {
      if (waiting) return;
      waiting = true;
      requestAnimationFrame(() => { waiting = false; draw(false); });
    });
    body.addEventListener("click", (event) => {
      const row = event.target.closest("tr[data-row]");
      if (row && !event.target.closest("a")) picked(Number(row.dataset.row), every);
    });
    window.addEventListener("resize", () => draw(true));

    return {
      scroller,
      refresh() {
        const { state } = chosen;
        whole.setAttribute("aria-rowcount", chosen.count + 1);
        [...head.children].forEach((th, c) => {
          const on = shown[c].name === state.sort;
          th.setAttribute("aria-sort", !on ? "none" : state.down ? "descending" : "ascending");
        });
        scroller.scrollTop = 0;
        draw(true);
      },
    };
  }

  return { table };
})();

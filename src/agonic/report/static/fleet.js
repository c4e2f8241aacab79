// The page of a fleet: its controls, its table and its figures know of each other.
"use strict";
(() => {
  const { columns, counted, grouped, make, selection, unpacked } = fleetRows;
  const { drawBars, drawPoints, figure, rangeWords, selectable } = fleetFigures;

  function controls(chosen, data, changed) {
    const words = make("input", { type: "search", placeholder: "sensor, log or words", id: "find" });
    const kinds = make("select", { id: "kind" },
      ...[["", "all"], ["good", "good"], ["check", "to check"], ["refused", "refused"], ["noted", "stands out"]]
        .map(([value, textContent]) => make("option", { value, textContent })));
    const chips = make("span", { className: "chips" });
    const count = make("output", { className: "count" });
    const clear = make("button", { type: "button", textContent: "Show all" });
    const far = make("output");
    const away = make("button", { type: "button", textContent: "Show all" });
    const float = make("p", { className: "float", hidden: true }, far,
      make("a", { href: "#browse", textContent: "To the table" }), away);
    let timer = 0;
    words.addEventListener("input", () => {
      clearTimeout(timer);
      timer = setTimeout(() => { chosen.state.words = words.value; changed(); }, 80);
    });
    kinds.addEventListener("change", () => { chosen.state.verdict = kinds.value; changed(); });
    for (const button of [clear, away]) button.addEventListener("click", () => {
      Object.assign(chosen.state, { words: "", verdict: "" });
      [words.value, kinds.value] = ["", ""];
      chosen.state.ranges.clear();
      changed();
    });
    const bar = make("form", { className: "controls" },
      make("label", { htmlFor: "find" }, "Find ", words), make("label", { htmlFor: "kind" }, "Show ", kinds),
      chips, count, clear);
    bar.setAttribute("role", "search");
    bar.addEventListener("submit", (event) => event.preventDefault());
    function refresh(rows) {
      chips.replaceChildren(...[...chosen.state.ranges].map(([one, ranges]) => {
        const axes = [one.x, one.y];
        const text = ranges.map((r, k) => `${r.column.replaceAll("_", " ")} ${rangeWords(r, axes[k])}`).join(", ");
        const chip = make("button", { type: "button", className: "chip", textContent: `${text} ×` });
        chip.setAttribute("aria-label", `Remove the selection ${text}`);
        chip.addEventListener("click", () => { chosen.state.ranges.delete(one); changed(); });
        return chip;
      }));
      const all = chosen.count === rows;
      count.textContent = all ? counted(rows) : `${grouped(chosen.count)} of ${grouped(rows)}`;
      far.textContent = `${count.textContent} selected`;
      clear.hidden = all;
      shade();
    }
    // What a figure selects is said at the foot of the screen until the table is in view.
    let near = false;
    const shade = () => { float.hidden = near || chosen.state.ranges.size === 0; };
    new IntersectionObserver(([entry]) => { near = entry.isIntersecting; shade(); }).observe(bar);
    return { bar, words, float, refresh };
  }

  function details(data) {
    const panel = make("div", { className: "details", hidden: true });
    panel.setAttribute("aria-live", "polite");
    function show(i, shown) {
      const entries = shown.flatMap(({ name, show: text }) => {
        const known = name.replaceAll("_", " ").replace(" deg", ", °").replace(" C", ", °C");
        return text(i) && text(i) !== "–" ? [make("dt", { textContent: known }), make("dd", { textContent: text(i) })] : [];
      });
      const links = [["report", "Report"], ["calibration", "Calibration file"]]
        .filter(([name]) => data[name][i])
        .map(([name, textContent]) => make("a", { href: data[name][i], textContent }));
      panel.replaceChildren(make("h3", { textContent: data.sensor[i] }),
        make("dl", {}, ...entries), make("p", { className: "links" }, ...links));
      panel.hidden = false;
    }
    return { panel, show };
  }

  // The reasons of the page find their rows.
  function reasons(chosen, words, changed) {
    for (const head of document.querySelectorAll(".reasons th[scope=row]")) {
      const button = make("button", { type: "button", textContent: head.textContent });
      button.addEventListener("click", () => {
        words.value = chosen.state.words = head.textContent;
        changed();
        words.scrollIntoView({ block: "start" });
      });
      head.replaceChildren(button);
    }
  }

  async function start() {
    const { rows, data } = columns(await unpacked(document.getElementById("fleet-rows").textContent));
    const chosen = selection(rows, data);
    const seen = new Map();  // figures: whether they are on the screen
    let [pending, rowsChanged] = [false, true];

    function paint(one) {
      const ranges = chosen.state.ranges.get(one);
      if (one.kind === "histogram") drawBars(one, data, chosen, rows, ranges?.[0]);
      else drawPoints(one, data, chosen, rows, ranges);
      one.fresh = true;
    }
    function draw() {
      pending = false;
      if (rowsChanged) {
        const begun = performance.now();
        chosen.apply();
        bar.refresh(rows);
        list.refresh();
        browse.dataset.filterMs = (performance.now() - begun).toFixed(1);
      }
      rowsChanged = false;
      for (const [one, visible] of seen) if (visible && !one.fresh) paint(one);
    }
    function later() {
      if (!pending) requestAnimationFrame(draw);
      pending = true;
    }
    function changed() {
      rowsChanged = true;
      for (const one of seen.keys()) one.fresh = false;
      later();
    }
    function select(one, ranges) {
      if (ranges === null) chosen.state.ranges.delete(one);
      else if (ranges) chosen.state.ranges.set(one, ranges);
      if (ranges === undefined) { one.fresh = false; later(); } else changed();
    }

    const browse = document.getElementById("browse");
    const more = details(data);
    const bar = controls(chosen, data, changed);
    const list = fleetTable.table(chosen, data, rows, changed, more.show);
    browse.replaceChildren(list.scroller, more.panel);
    browse.before(bar.bar);
    reasons(chosen, bar.words, changed);
    document.body.append(bar.float);

    const watcher = new IntersectionObserver((entries) => {
      for (const { target, isIntersecting } of entries) seen.set(target.figure, isIntersecting);
      later();
    }, { rootMargin: "200px" });
    for (const box of document.querySelectorAll(".live")) {
      const one = figure(box);
      box.figure = one;
      box.classList.add("drawn");
      seen.set(one, false);
      selectable(one, select);
      watcher.observe(box);
    }
    const repaint = () => { for (const one of seen.keys()) one.fresh = false; later(); };
    window.addEventListener("resize", repaint);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);
    draw();
    document.documentElement.dataset.ready = performance.now().toFixed(0);
    paintRest();

    function paintRest() {  // one at a time, so that print and pictures of the page have them all
      const one = [...seen.keys()].find((figure) => !figure.fresh);
      if (one) { paint(one); setTimeout(paintRest, 20); }
    }
  }

  start();
})();

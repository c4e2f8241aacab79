// Dragging along a strip of time picks an interval: the command that calibrates it, to copy.
"use strict";
for (const plot of document.querySelectorAll("[data-command] [data-clock]")) {
  const [from, to] = plot.dataset.clock.split(",").map(Number);
  const area = plot.querySelector(".area");
  const mark = Object.assign(document.createElement("div"), { className: "interval-mark", hidden: true });
  const said = Object.assign(document.createElement("code"), { className: "interval-command", hidden: true });
  plot.append(mark, said);
  let begun = 0;

  const share = (event) => {
    const box = area.getBoundingClientRect();
    return Math.max(0, Math.min(1, (event.clientX - box.left) / box.width));
  };
  function pick(event) {
    const [low, high] = [begun, share(event)].sort((a, b) => a - b);
    mark.hidden = said.hidden = high - low < 0.005;
    mark.style.marginLeft = `${100 * low}%`;
    mark.style.width = `${100 * (high - low)}%`;
    const [start, stop] = [low, high].map((at) => (from + at * (to - from)).toFixed(1));
    said.textContent = `${plot.closest("[data-command]").dataset.command} --between ${start},${stop}`;
  }
  area.addEventListener("pointerdown", (event) => {
    area.setPointerCapture(event.pointerId);
    begun = share(event);
    pick(event);
  });
  area.addEventListener("pointermove", (event) => {
    if (area.hasPointerCapture(event.pointerId)) pick(event);
  });
}

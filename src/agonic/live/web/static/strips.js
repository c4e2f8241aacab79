// Strips: numbers over time, drawn by uPlot in the colours of the page.
"use strict";
const strips = (() => {
  const HEIGHT = 110;
  const FONT = "11px system-ui, sans-serif";
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const minus = (told) => told.replace("-", "\u2212");

  function axis(told, size, splits) {
    return {
      ...(splits && { splits: (_, index, low, high) => splits.filter((v) => v >= low && v <= high) }),
      stroke: css("--soft"), font: FONT, size, gap: 3, ticks: { show: false },
      grid: { stroke: css("--line"), width: 1 },
      values: (_, splits) => splits.map((v) => v === null ? null : told(v)),
    };
  }

  // A strip in `box`. `time` and `value` tell numbers in words; `scale` is uPlot's of the values;
  // `splits` are the values with a line, if not uPlot's own;
  // `pointed(time, value)` hears where the pointer is, and `pointed(null)` that it has left.
  function strip(box, { time, value, scale, splits, pointed }) {
    let [plot, data] = [null, [[], [], []]];

    function make() {
      if (plot) plot.destroy();
      plot = new uPlot({
        width: Math.max(box.clientWidth, 40), height: HEIGHT, padding: [6, 8, 0, 0],
        legend: { show: false }, scales: { x: { time: false }, y: scale },
        axes: [axis(time, 20), axis(value, 46, splits)],
        cursor: { y: false, drag: { x: false, y: false }, points: { size: 7 } },
        series: [
          {},
          { stroke: css("--ink"), width: 1.25, points: { show: false } },
          { stroke: css("--accent"), width: 1.5, dash: [6, 4], points: { show: false } },
        ],
        hooks: { setCursor: [({ cursor: { idx } }) => {
          if (idx === null || idx === undefined) pointed(null);
          else pointed(time(data[0][idx]), value(data[1][idx]));
        }] },
      }, data, box);
    }

    new ResizeObserver(() => {
      const width = box.clientWidth;
      if (plot && width && width !== plot.width) plot.setSize({ width, height: HEIGHT });
    }).observe(box);
    make();
    return {
      // Times, values, and what they should reach.
      show(times, values, goal) {
        data = [times, values, times.map(() => goal)];
        plot.setData(data);
      },
      restyle() { make(); },
    };
  }

  return { minus, strip };
})();

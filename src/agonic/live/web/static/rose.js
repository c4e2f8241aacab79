// The compass rose of a vehicle that stays level: headings seen, tilts there, and what to drive next.
"use strict";
const rose = (() => {
  const SECTORS = 12;
  const SEEN = 3;               // rows of a sector that is seen
  const RING = [0.66, 0.8];     // of half the picture
  const INNER = 0.6;            // where the largest tilt of the scale ends
  const SCALES = [5, 10, 20, 40];
  const LETTERS = ["N", "E", "S", "W"];
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const radians = (degrees) => (degrees - 90) * Math.PI / 180;   // north is up, east is right

  const count = (told) => told.counts.filter((n) => n >= SEEN).length;
  const tilt = (told) => Math.max(...told.tilts_deg);

  function wedge(context, [x, y], from, to, inner, outer) {
    context.beginPath();
    context.arc(x, y, outer, from, to);
    context.arc(x, y, inner, to, from, true);
    context.closePath();
  }

  function drawRing(context, centre, unit, told, colours, ratio) {
    const most = Math.max(...told.counts, 1);
    const gap = 0.012;
    told.counts.forEach((n, k) => {
      const [from, to] = [radians(30 * k) + gap, radians(30 * (k + 1)) - gap];
      const empty = n < SEEN;
      wedge(context, centre, from, to, RING[0] * unit, RING[1] * unit);
      context.fillStyle = empty ? colours.empty : colours.ink;
      context.globalAlpha = empty ? 0.14 : 0.25 + 0.5 * n / most;
      context.fill();
      context.globalAlpha = 1;
      context.strokeStyle = empty ? colours.empty : colours.line;
      context.lineWidth = (empty ? 1.5 : 0.75) * ratio;
      context.stroke();
    });
  }

  // The tilts as bars from the middle, on circles of so many degrees.
  function drawTilts(context, centre, unit, told, colours, ratio) {
    const largest = Math.max(tilt(told), told.slope_deg);
    const scale = SCALES.find((s) => s >= largest) || 90;
    const reach = (degrees) => INNER * unit * Math.min(degrees / scale, 1);
    context.font = `${11 * ratio}px system-ui, sans-serif`;
    context.textAlign = "left";
    context.textBaseline = "bottom";
    for (const at of [scale / 2, scale]) {
      context.beginPath();
      context.arc(...centre, reach(at), 0, 2 * Math.PI);
      context.strokeStyle = colours.line;
      context.lineWidth = ratio;
      context.stroke();
    }
    told.tilts_deg.forEach((degrees, k) => {
      if (told.counts[k] < SEEN) return;
      wedge(context, centre, radians(30 * k + 6), radians(30 * k + 24), 0, Math.max(reach(degrees), 2 * ratio));
      context.fillStyle = colours.ink;
      context.globalAlpha = 0.55;
      context.fill();
      context.globalAlpha = 1;
    });
    if (told.slope_deg) {
      context.beginPath();
      context.arc(...centre, reach(told.slope_deg), 0, 2 * Math.PI);
      context.setLineDash([6 * ratio, 4 * ratio]);
      context.strokeStyle = css("--accent");
      context.lineWidth = 2 * ratio;
      context.stroke();
      context.setLineDash([]);
    }
    context.fillStyle = css("--soft");
    for (const at of [scale / 2, scale]) {
      context.fillText(`${at}°`, centre[0] + 3 * ratio, centre[1] - reach(at) - ratio);
    }
  }

  // The headings to be driven next, as an arc around the ring.
  function drawWanted(context, centre, unit, told, ratio) {
    if (!told.wanted.length || told.wanted.length === SECTORS) return;
    context.strokeStyle = css("--accent");
    context.lineWidth = 5 * ratio;
    for (const k of told.wanted) {
      context.beginPath();
      context.arc(...centre, (RING[1] + 0.04) * unit, radians(30 * k), radians(30 * (k + 1)));
      context.stroke();
    }
  }

  function drawNeedle(context, [x, y], unit, heading, ratio) {
    const along = radians(heading);
    const at = (r, turn = 0) => [x + r * unit * Math.cos(along + turn), y + r * unit * Math.sin(along + turn)];
    context.fillStyle = context.strokeStyle = css("--accent");
    context.lineWidth = 2.5 * ratio;
    context.beginPath();
    context.moveTo(x, y);
    context.lineTo(...at(RING[0] - 0.05));
    context.stroke();
    context.beginPath();
    context.moveTo(...at(RING[0]));
    context.lineTo(...at(RING[0] - 0.1, 0.06));
    context.lineTo(...at(RING[0] - 0.1, -0.06));
    context.fill();
  }

  function draw(canvas, told, colours, ratio) {
    const context = canvas.getContext("2d");
    const { width, height } = canvas;
    const [centre, unit] = [[width / 2, height / 2], width / 2];
    context.clearRect(0, 0, width, height);
    drawTilts(context, centre, unit, told, colours, ratio);
    drawRing(context, centre, unit, told, colours, ratio);
    drawWanted(context, centre, unit, told, ratio);
    drawNeedle(context, centre, unit, told.heading_deg, ratio);
    context.font = `600 ${14 * ratio}px system-ui, sans-serif`;
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.fillStyle = colours.ink;
    LETTERS.forEach((letter, k) => {
      const along = radians(90 * k);
      context.fillText(letter, centre[0] + 0.92 * unit * Math.cos(along), centre[1] + 0.92 * unit * Math.sin(along));
    });
  }

  return { count, draw, tilt, SECTORS };
})();

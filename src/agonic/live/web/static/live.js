// The live page: what the server says of each sensor, its readings on the sphere, and what to do.
"use strict";
(() => {
  const MOST = 50000;         // points of a sensor
  const LIMIT = 0.05;         // relative deviation of the magnitude at which colour is full
  const TRACE = 600;          // readings of the strip
  const STRIP_MS = 100;       // between two drawings of it
  const WORST_DEG = 90;       // heading error that is still drawn
  const SPOKEN_MS = 4000;     // between two sentences for a screen reader
  const AXES = ["+x nose", "+y right", "+z down"];
  const OPEN_DEG = 90;        // beyond, the standard error of a heading says nothing
  const BESIDE = {            // what told the attitude
    inertial: " (with accelerometer and gyro)", levelled: " (with roll and pitch)",
  };
  const EASE = 0.12;          // share of the way that the view follows in a frame

  const {
    FILL, START, drawAxes, drawCoverage, drawPoints, fitted, product, rotation, theme, turnable,
    turned,
  } = sphere;
  const find = (id) => document.getElementById(id);
  const calm = matchMedia("(prefers-reduced-motion: reduce)").matches;
  const stat = { fps: 0, points: 0, latency: 0, frames: 0 };
  window.__stat = stat;

  let hello = null;
  let status = null;
  let colours = theme();
  let sensors = [];
  let socket = null;

  function text(element, value) {
    if (element.textContent !== value) element.textContent = value;
  }

  // ---- readings -----------------------------------------------------------------------------

  // The last points of a sensor in a ring: as they came, and with centre and colour of the fit.
  function cloud() {
    const raw = new Float32Array(3 * MOST);
    const centred = new Float32Array(3 * MOST);
    const shade = new Uint8Array(MOST);
    const trace = new Float32Array(TRACE);
    let [count, next] = [0, 0];
    let centre = [0, 0, 0];
    let shape = [1, 0, 0, 0, 1, 0, 0, 0, 1];

    function place(i) {
      const k = 3 * i;
      const x = raw[k] - centre[0], y = raw[k + 1] - centre[1], z = raw[k + 2] - centre[2];
      centred[k] = x;
      centred[k + 1] = y;
      centred[k + 2] = z;
      const a = shape[0] * x + shape[1] * y + shape[2] * z;
      const b = shape[3] * x + shape[4] * y + shape[5] * z;
      const c = shape[6] * x + shape[7] * y + shape[8] * z;
      const size = Math.sqrt(a * a + b * b + c * c);
      const t = Math.max(-1, Math.min(1, (size - 1) / LIMIT));
      shade[i] = Math.round(127.5 + 127.5 * t);
      return size;
    }

    return {
      get count() { return count; },
      get centred() { return centred; },
      get shade() { return shade.subarray(0, count); },
      get shape() { return shape; },
      clear() { count = next = 0; },
      add(rows) {
        for (let i = 0; i < rows.length; i += 3) {
          raw.set(rows.subarray(i, i + 3), 3 * next);
          place(next);
          next = (next + 1) % MOST;
          count = Math.min(count + 1, MOST);
        }
      },
      refit(newCentre, newShape) {
        [centre, shape] = [newCentre, newShape];
        for (let i = 0; i < count; i++) place(i);
      },
      // Sizes of the latest readings, oldest first, in radii.
      trace() {
        const n = Math.min(count, TRACE);
        for (let i = 0; i < n; i++) trace[i] = place((next - n + i + MOST) % MOST);
        return trace.subarray(0, n);
      },
    };
  }

  // ---- drawing ------------------------------------------------------------------------------

  const unit = (v) => v.map((c) => c / (Math.hypot(...v) || 1));

  // The way from a to b over the sphere, as points.
  function arc(a, b) {
    const cosine = Math.max(-1, Math.min(1, a[0] * b[0] + a[1] * b[1] + a[2] * b[2]));
    const angle = Math.acos(cosine);
    if (angle < 0.02) return [];
    let side = unit(b.map((c, i) => c - cosine * a[i]));
    if (angle > 3.1) side = unit(Math.abs(a[0]) < 0.8 ? [0, a[2], -a[1]] : [-a[2], 0, a[0]]);
    return Array.from({ length: 33 }, (_, k) => {
      const t = angle * k / 32;
      return a.map((c, i) => Math.cos(t) * c + Math.sin(t) * side[i]);
    });
  }

  function drawArrow(context, view, from, to, ratio) {
    const { width, height } = context.canvas;
    const onto = (v) => {
      const [right, up, towards] = turned(view, ...v);
      return [width / 2 + 1.02 * FILL * width * right, height / 2 - 1.02 * FILL * width * up, towards];
    };
    const style = getComputedStyle(document.documentElement);
    context.strokeStyle = context.fillStyle = style.getPropertyValue("--accent").trim();
    context.lineCap = "round";
    const way = arc(from, to).map(onto);
    for (let k = 1; k < way.length; k++) {
      const [x, y, towards] = way[k];
      context.globalAlpha = towards < 0 ? 0.4 : 1;
      context.lineWidth = 5 * ratio;
      context.beginPath();
      context.moveTo(way[k - 1][0], way[k - 1][1]);
      context.lineTo(x, y);
      context.stroke();
    }
    if (way.length) {
      const [x, y] = way[way.length - 1];
      const [px, py] = way[way.length - 4];
      const along = Math.atan2(y - py, x - px);
      context.globalAlpha = 1;
      context.beginPath();
      for (const turn of [0, 2.5, -2.5]) {
        const reach = (turn ? 14 : 8) * ratio;
        context.lineTo(x + reach * Math.cos(along + turn), y + reach * Math.sin(along + turn));
      }
      context.fill();
    }
    const [x, y, towards] = onto(from);
    context.globalAlpha = towards < 0 ? 0.5 : 1;
    context.beginPath();
    context.arc(x, y, 6 * ratio, 0, 2 * Math.PI);
    context.fill();
    context.globalAlpha = 1;
  }

  const seconds = (v) => `${strips.minus(+v.toFixed(1) + "")} s`;
  const minutes = (v) => v < 90 ? `${+v.toFixed(1)} s` : `${+(v / 60).toFixed(1)} min`;
  const percent = (v) => `${v > 0 ? "+" : ""}${strips.minus(+v.toFixed(1) + "")} %`;

  // ---- one sensor ---------------------------------------------------------------------------

  const grouped = (value, places = 0) => {
    const shown = { minimumFractionDigits: places, maximumFractionDigits: places };
    return strips.minus(value.toLocaleString("en", shown).replaceAll(",", "\u202f"));
  };
  // To the second digit of the standard error, where there is one, as reports have it.
  const digits = (value, sd) => {
    if (value === null || value === undefined) return "";
    const size = Math.abs(sd || value);
    const places = sd ? 1 - Math.floor(Math.log10(size)) : size >= 100 ? 0 : size >= 10 ? 1 : 3;
    return grouped(value, Math.max(0, Math.min(6, places)));
  };

  function sensor(name) {
    const article = find("sensor").content.cloneNode(true).firstElementChild;
    const part = (selector) => article.querySelector(selector);
    const canvas = part("figure canvas");
    const strength = strips.strip(part(".strength"), {
      time: seconds, value: percent,
      scale: { range: (_, low, high) => {
        const reach = Math.max(2, Math.min(100, 1.1 * Math.max(Math.abs(low), Math.abs(high))));
        return [-reach, reach];
      } },
      pointed: (at, value) => text(part(".strength-at"), at === null ? "" : `${at}: ${value}`),
    });
    const course = strips.strip(part(".course"), {
      time: minutes, value: (v) => `${+v.toPrecision(2)}°`,
      scale: { distr: 3, range: (_, low, high) => [
        Math.min(0.1, (low || 1) / 1.5), Math.max(10, high || 1),
      ] },
      splits: [0.001, 0.01, 0.1, 1, 10, 100],
      pointed: (at, value) => text(part(".course-at"), at === null ? "" : `${at}: ${value}`),
    });
    let drawnAt = 0;
    const points = cloud();
    const angles = { ...START };
    const rows = [];
    let told = null;
    let dirty = true;
    text(part("h2"), name);
    article.dataset.name = name;
    part(".device").addEventListener("click", () => ask({ type: "offer", sensor: name }));
    turnable(canvas, angles, () => { part(".follow").checked = false; dirty = true; });
    part(".follow").checked = !calm;
    new ResizeObserver(() => { dirty = true; }).observe(canvas);
    find("sensors").append(article);

    function numbers(list) {
      const body = part("tbody");
      while (rows.length < list.length) {
        const row = body.insertRow();
        const head = document.createElement("th");
        head.scope = "row";
        row.append(head, ...["", "", "before"].map((kind) => {
          const cell = document.createElement("td");
          cell.className = kind;
          return cell;
        }));
        rows.push(row);
      }
      list.forEach((number, i) => {
        const unitText = number.unit ? `, ${number.unit}` : "";
        text(rows[i].cells[0], number.name + unitText);
        text(rows[i].cells[1], digits(number.now, number.sd));
        text(rows[i].cells[2], digits(number.sd, number.sd));
        text(rows[i].cells[3], digits(number.before, number.sd));
      });
    }

    function problems(list) {
      const said = list.map((problem) => problem.text);
      const box = part(".problems");
      const shown = [...box.children].map((item) => item.textContent);
      if (said.join("\n") === shown.join("\n")) return;
      box.replaceChildren(...said.map((sentence) => {
        const item = document.createElement("li");
        item.textContent = sentence;
        return item;
      }));
    }

    function update(now) {
      told = now;
      points.refit(now.centre, now.shape);
      article.classList.toggle("done", now.done);
      article.classList.toggle("alone", !now.before);
      const written = status.outcomes.some((one) => one.sensor === now.name && one.files.length);
      text(part(".say"), now.done && written ? "done: the files are written" : now.say);
      const cells = now.cells.filter((n) => n > 0).length;
      const seen = now.rose ? `${rose.count(now.rose)} of ${rose.SECTORS}` : `${cells} of 80`;
      text(part(".seen"), now.rose ? `${seen} headings seen, tilted up to ${rose.tilt(now.rose).toFixed(0)}°` : `${seen} directions seen`);
      part(".of-rose").hidden = !now.rose;
      part(".of-sphere").hidden = Boolean(now.rose);
      part("progress").value = now.progress;
      text(part(".heading"), now.heading_sd_deg === null ? "no calibration yet"
        : now.heading_sd_deg >= OPEN_DEG ? "the heading is not determined yet"
        : `heading standard error ${now.heading_sd_deg.toFixed(2)}°${BESIDE[now.method] || ""}, enough at ${now.target_deg}°`
          + (now.vehicle_sd_deg === null ? "" : `; ${now.vehicle_sd_deg.toFixed(2)}° for the vehicle, its mounting included`));
      text(part(".count"), `${grouped(now.n)} readings, ${now.rate_Hz} a second`);
      problems(now.problems);
      numbers(now.numbers);
      const device = part(".device");
      device.hidden = !status.device;
      canvas.setAttribute("aria-label", `${now.rose ? "Compass rose of headings" : "Sphere of directions"}: ${seen} seen. ${now.say}.`);
      dirty = true;
    }

    function follow() {
      if (!part(".follow").checked || !told || !told.wanted) return;
      const [x, y, z] = unit(told.wanted.map((c, i) => c + 0.8 * told.present[i]));
      const goal = { yaw: Math.atan2(y, x) - 0.35, pitch: Math.asin(Math.max(-1, Math.min(1, 0.8 * z))) };
      const yaw = Math.atan2(Math.sin(goal.yaw - angles.yaw), Math.cos(goal.yaw - angles.yaw));
      const pitch = goal.pitch - angles.pitch;
      if (Math.hypot(yaw, pitch) < 0.01) return;
      angles.yaw += EASE * yaw;
      angles.pitch += EASE * pitch;
      dirty = true;
    }

    function draw() {
      if (!told || !told.rose) follow();
      if (!dirty || !hello) return;
      dirty = false;
      if (told && told.rose) {
        rose.draw(canvas, told.rose, colours, fitted(canvas, 1));
        drawStrips();
        return;
      }
      const view = rotation(angles);
      const ratio = fitted(canvas, 1);
      const context = canvas.getContext("2d");
      const dot = Math.round(ratio * (points.count < 15000 ? 3 : 2));
      drawPoints(context, points.centred, points.shade, product(view, points.shape), colours, dot);
      const cells = told && told.cells.length ? told.cells : new Array(80).fill(0);
      drawCoverage(context, hello.corners, view, cells, colours, ratio);
      drawAxes(context, view, colours, ratio, AXES);
      if (told && told.present && told.wanted && !told.done) {
        drawArrow(context, view, unit(told.present), unit(told.wanted), ratio);
      }
      drawStrips();
    }

    // The strength of the last readings over the seconds before now, and the error so far.
    function drawStrips() {
      if (!told || told.heading_sd_deg === null || performance.now() - drawnAt < STRIP_MS) return;
      drawnAt = performance.now();
      const sizes = Array.from(points.trace(), (size) => 100 * (size - 1));
      const rate = told.rate_Hz || 50;
      strength.show(sizes.map((_, i) => (i + 1 - sizes.length) / rate), sizes, 0);
      const errors = told.course.map(([, error]) => Math.min(error, WORST_DEG));
      course.show(told.course.map(([at]) => at), errors, told.target_deg);
    }

    return {
      name, points, update, draw,
      add(bytes) { points.add(bytes); dirty = true; },
      allow(busy) { part(".device").disabled = busy || !told || told.heading_sd_deg === null; },
      remove() { article.remove(); },
      stale() { dirty = true; strength.restyle(); course.restyle(); },
    };
  }

  // ---- the session --------------------------------------------------------------------------

  function ask(message) {
    if (socket && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
  }

  // What can be asked for: nothing while the server is away, and no second thing while one is done.
  function allow() {
    const away = !socket || socket.readyState !== WebSocket.OPEN;
    const known = status && status.sensors.some((one) => one.heading_sd_deg !== null);
    const busy = Boolean(status && status.busy);
    find("accept").disabled = away || !known;
    find("accept").setAttribute("aria-disabled", String(away || !known || busy)); // keeps the focus
    find("restart").disabled = away || busy;
    sensors.forEach((one) => one.allow(away || busy));
    find("write").disabled = away || busy || !status || !status.offer.length
      || status.offer.some((setting) => setting.read_back !== null);
  }

  function heard(words, state) {
    text(find("heard"), words);
    find("source").className = `source ${state}`;
  }

  let spokenAt = 0;
  function speak(now) {
    const words = now.sensors.map((one) =>
      [now.sensors.length > 1 ? `${one.name}: ` : "", one.say, ...one.problems.map((p) => `. ${p.text}`)].join(""));
    if (performance.now() - spokenAt < SPOKEN_MS) return;
    const said = words.join("; ");
    if (find("spoken").textContent === said) return;
    spokenAt = performance.now();
    text(find("spoken"), said);
  }

  const basename = (path) => path.split(/[\\/]/).pop();

  function outcomes(list) {
    const key = JSON.stringify(list);
    const box = find("outcomes");
    if (box.dataset.key === key) return;
    box.dataset.key = key;
    const blocks = list.map((one) => {
      const block = document.createElement("div");
      block.className = `verdict ${one.verdict}`;
      const lines = [
        `${one.sensor}: ${one.verdict}`, one.status,
        one.files.length ? `Written to ${hello.folder}: ${one.files.map(basename).join(", ")}` : "",
        ...one.warnings,
      ];
      block.append(...lines.filter(Boolean).map((line, i) => {
        const paragraph = document.createElement("p");
        if (i === 0) paragraph.className = "word";
        paragraph.textContent = line;
        return paragraph;
      }));
      return block;
    });
    if (list.some((one) => one.files.length)) {
      const link = document.createElement("a");
      link.href = `/report${location.search}`;
      link.target = "_blank";
      link.textContent = "Open the report";
      blocks.push(link);
    }
    box.replaceChildren(...blocks);
    if (blocks.length) box.scrollIntoView({ block: "nearest", behavior: calm ? "auto" : "smooth" });
  }

  function offer(now) {
    const dialog = find("confirm");
    if (!now.offered) {
      if (dialog.open) dialog.close();
      return;
    }
    text(find("confirm-says"), now.device_says);
    find("settings").replaceChildren(...now.offer.map((setting) => {
      const row = document.createElement("tr");
      const values = [setting.old, setting.new, setting.read_back];
      row.innerHTML = "<th scope=row></th><td></td><td></td><td></td>";
      row.cells[0].textContent = setting.name;
      values.forEach((v, i) => {
        row.cells[i + 1].textContent = v === null ? (i ? "" : "not reported") : strips.minus(String(+v.toPrecision(7)));
      });
      return row;
    }));
    text(find("leave"), now.offer.some((s) => s.read_back !== null) ? "Close" : "Leave it");
    if (!dialog.open) dialog.showModal();
  }

  // What is to be done now, in a few words.
  function headline(now, good) {
    if (now.sensors.length === 0) return now.ended ? "The source has ended" : "Waiting for readings";
    if (now.outcomes.some((one) => one.files.length)) return "Calibrated: the files are written";
    if (good) return "Enough: accept the calibration";
    if (now.ended) return "The source has ended: accept, or start again";
    return now.sensors.some((one) => one.rose) ? "Drive on" : "Turn the sensor about all axes";
  }

  // Beside the button: whether the target is reached, and what stands against the result.
  function tellWhetherEnough(now, good) {
    if (good) return "Enough: the target is reached.";
    if (now.sensors.some((one) => one.problems.length)) return "Look at the notes beside the sphere first.";
    return now.ended ? "The target is not reached." : "Continue turning: the target is not reached yet.";
  }

  function take(now) {
    status = now;
    heard(now.heard, now.ended ? "ended" : now.connected ? "on" : "");
    while (sensors.length > now.sensors.length) sensors.pop().remove();
    now.sensors.forEach((one, i) => {
      if (!sensors[i]) sensors[i] = sensor(one.name);
      sensors[i].update(one);
    });
    text(find("notes"), now.notes.join(". "));
    find("notes").hidden = !now.notes.length;
    find("waiting").hidden = sensors.length > 0;
    find("finish").hidden = sensors.length === 0;
    const good = now.sensors.length > 0 && now.sensors.every((one) => one.done);
    text(find("state"), headline(now, good));
    const written = now.outcomes.some((one) => one.files.length);
    const again = written ? "Write the files again" : "Accept and write the files";
    text(find("accept"), now.busy ? "Working …" : again);
    find("accept").classList.toggle("main", good && !written);
    text(find("enough"), tellWhetherEnough(now, good));
    find("trouble").hidden = !now.trouble;
    text(find("trouble"), now.trouble);
    outcomes(now.outcomes);
    offer(now);
    allow();
    speak(now);
    document.body.dataset.version = now.version;
  }

  function pointsIn(buffer) {
    const view = new DataView(buffer);
    const one = sensors[view.getUint32(0, true)];
    if (!one) return waiting.push(buffer);
    const rows = new Float32Array(buffer, 16);
    if (!rows.length) one.points.clear();
    one.add(rows);
    stat.latency = Date.now() - 1000 * view.getFloat64(8, true);
  }

  // Points of a sensor that the page has not been told of yet.
  let waiting = [];

  function message(event) {
    if (event.data instanceof ArrayBuffer) return void pointsIn(event.data);
    const said = JSON.parse(event.data);
    if (said.type === "hello") {
      hello = said;
      sensors.forEach((one) => one.points.clear());
      text(find("reference"), hello.reference);
      document.title = `Live calibration – ${hello.source}`;
    } else {
      take(said);
      const early = waiting;
      waiting = [];
      early.forEach(pointsIn);
    }
  }

  function connect() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    socket = new WebSocket(`${scheme}://${location.host}/socket${location.search}`);
    socket.binaryType = "arraybuffer";
    socket.addEventListener("message", message);
    socket.addEventListener("close", () => {
      heard("the program that serves this page has stopped, or is out of reach; trying again", "");
      allow();
      find("confirm").close(); // nobody would hear the answer
      setTimeout(connect, 1000);
    });
  }

  find("accept").addEventListener("click", () => { if (!status.busy) ask({ type: "accept" }); });
  find("restart").addEventListener("click", () => {
    const total = status.sensors.reduce((sum, one) => sum + one.n, 0);
    text(find("forget-says"), `${grouped(total)} readings would be thrown away. Files that were written stay.`);
    find("forget").showModal();
  });
  find("keep").addEventListener("click", () => find("forget").close());
  find("throw").addEventListener("click", () => {
    find("forget").close();
    ask({ type: "restart" });
  });
  find("write").addEventListener("click", () => ask({ type: "write", sensor: status.offered }));
  const leave = () => ask({ type: "offer", sensor: "" });
  find("leave").addEventListener("click", leave);
  find("confirm").addEventListener("cancel", leave);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    colours = theme();
    sensors.forEach((one) => one.stale());
  });

  let [since, frames] = [performance.now(), 0];
  function frame(now) {
    sensors.forEach((one) => one.draw());
    frames++;
    stat.frames++;
    if (now - since >= 1000) {
      stat.fps = 1000 * frames / (now - since);
      [since, frames] = [now, 0];
    }
    stat.points = sensors.reduce((sum, one) => sum + one.points.count, 0);
    requestAnimationFrame(frame);
  }

  connect();
  requestAnimationFrame(frame);
})();

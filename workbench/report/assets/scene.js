"use strict";
(function () {
  const root = document.currentScript.previousElementSibling;
  const find = (name) => root.querySelector("." + name);
  const scene = JSON.parse(find("frames").textContent);
  const view = find("view"), strip = find("strip"), scrubber = find("scrubber");
  const frames = scene.frames;
  let index = 0, zoom = 1, playing = false, clock = 0, waited = 0;

  function summed(flat, width, units) {
    const rows = [];
    for (let k = 0; k < flat.length; k += width) {
      const before = k ? rows[rows.length - 1].raw : new Array(width).fill(0);
      const raw = before.map((value, j) => value + flat[k + j]);
      rows.push({ raw: raw, value: raw.map((value, j) => value * units[j]) });
    }
    return rows.map((row) => row.value);
  }
  const CM = 0.01, MRAD = 0.001;
  const paths = scene.paths.map((flat) => summed(flat, 2, [CM, CM]));
  const boxes = (flat) => summed(flat, 5, [CM, CM, MRAD, CM, CM]);
  const rectangles = (frame) => boxes(frame.o);
  const shows = (policy) => [0, policy].includes(Number(find("shown").value));
  // Tubes have the colours of the policy they decide; pages of one policy have one verdict.
  const said = (frame, policy) => (frame.q.length ? frame.q[policy - 1][1] : frame.v);
  const undecided = (frame) => "no decision, " + (scene.texts[frame.e] || "nothing") + " sent";
  const goal = (wanted) => scene.texts[wanted[0]] + " " + wanted[1] + " %";
  const discs = (person) => summed(person.slice(1), 3, [CM, CM, CM]);
  const car = (frame) => [frame.c[0] * CM, frame.c[1] * CM, frame.c[2] * MRAD];

  function reach() {
    const far = [];
    frames.forEach(function (frame) {
      const at = car(frame);
      let most = 8;
      rectangles(frame).forEach(function (box) {
        most = Math.max(most, Math.hypot(box[0] - at[0], box[1] - at[1]) + box[3]);
      });
      frame.p.forEach(function (person) {
        const here = Math.hypot(person[1] * CM - at[0], person[2] * CM - at[1]);
        if (here < 20) most = Math.max(most, here + 1);
      });
      far.push(most);
    });
    far.sort((a, b) => a - b);
    return Math.min(30, far[Math.floor(0.9 * (far.length - 1))]);
  }
  const reachM = reach();
  const all = frames.map(car);
  const low = [0, 1].map((axis) => all.reduce((least, at) => Math.min(least, at[axis]), Infinity));
  const high = [0, 1].map((axis) => all.reduce((most, at) => Math.max(most, at[axis]), -Infinity));

  function fitted(canvas) {
    const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
    const wide = Math.round(width * ratio), tall = Math.round(height * ratio);
    if (canvas.width !== wide || canvas.height !== tall) { canvas.width = wide; canvas.height = tall; }
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    return { pen: pen, width: width, height: height };
  }

  function camera(frame, width, height) {
    const at = car(frame), follow = find("follow").checked;
    const short = Math.min(width, height * 1.6);
    let scale, middle;
    if (follow) {
      scale = (zoom * short) / (1.5 * reachM);
      const ahead = 0.35 * Math.min(width, height) / scale;
      middle = [at[0] + ahead * Math.cos(at[2]), at[1] + ahead * Math.sin(at[2])];
    } else {
      scale = zoom * Math.min(width / (high[0] - low[0] + reachM), height / (high[1] - low[1] + reachM));
      middle = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2];
    }
    return {
      scale: scale, middle: middle,
      x: (x) => width / 2 + (x - middle[0]) * scale,
      y: (y) => height / 2 - (y - middle[1]) * scale,
    };
  }

  function grid(pen, eye, width, height, ink) {
    const steps = [0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500];
    const step = steps.find((s) => s * eye.scale >= 55) || 1000;
    pen.font = "12px system-ui, sans-serif";
    pen.fillStyle = pen.strokeStyle = ink;
    pen.lineWidth = 1;
    const left = eye.middle[0] - width / 2 / eye.scale, bottom = eye.middle[1] - height / 2 / eye.scale;
    for (let k = Math.ceil(left / step); eye.x(k * step) < width; k++) {
      pen.globalAlpha = 0.15;
      pen.beginPath(); pen.moveTo(eye.x(k * step), 0); pen.lineTo(eye.x(k * step), height); pen.stroke();
      pen.globalAlpha = 0.75;
      if (eye.x(k * step) > 46 && eye.x(k * step) < width - 62) pen.fillText(String(k * step), eye.x(k * step) + 3, height - 6);
    }
    for (let k = Math.ceil(bottom / step); eye.y(k * step) > 0; k++) {
      pen.globalAlpha = 0.15;
      pen.beginPath(); pen.moveTo(0, eye.y(k * step)); pen.lineTo(width, eye.y(k * step)); pen.stroke();
      pen.globalAlpha = 0.75;
      if (eye.y(k * step) > 50 && eye.y(k * step) < height - 22) pen.fillText(String(k * step), 5, eye.y(k * step) - 3);
    }
    pen.globalAlpha = 1;
    pen.textAlign = "right"; pen.fillText("x (m)", width - 6, height - 6);
    pen.textAlign = "left"; pen.fillText("y (m)", 5, 44);
  }

  function box(pen, eye, shape) {
    const cos = Math.cos(shape[2]), sin = Math.sin(shape[2]);
    pen.beginPath();
    [[1, 1], [-1, 1], [-1, -1], [1, -1]].forEach(function (sign) {
      const a = sign[0] * shape[3], b = sign[1] * shape[4];
      pen.lineTo(eye.x(shape[0] + a * cos - b * sin), eye.y(shape[1] + a * sin + b * cos));
    });
    pen.closePath();
  }

  function disc(pen, eye, at) {
    pen.beginPath();
    pen.arc(eye.x(at[0]), eye.y(at[1]), Math.max(1, at[2] * eye.scale), 0, 2 * Math.PI);
  }

  // An arrow at the edge towards somebody who is outside of the picture, and how far off they are.
  function drawOutside(canvas, eye, frame, person, ink, blue) {
    const pen = canvas.pen, at = car(frame), here = [person[1] * CM, person[2] * CM];
    const x = eye.x(here[0]), y = eye.y(here[1]);
    if (x >= 0 && x <= canvas.width && y >= 0 && y <= canvas.height) return;
    const edgeX = Math.max(12, Math.min(canvas.width - 12, x));
    const edgeY = Math.max(46, Math.min(canvas.height - 28, y));
    pen.save();
    pen.translate(edgeX, edgeY);
    pen.rotate(Math.atan2(y - edgeY, x - edgeX));
    pen.fillStyle = blue;
    pen.beginPath(); pen.moveTo(10, 0); pen.lineTo(-5, -6); pen.lineTo(-5, 6); pen.closePath(); pen.fill();
    pen.restore();
    if (frame.p.length > 6) return;
    const right = edgeX > canvas.width / 2, far = Math.hypot(here[0] - at[0], here[1] - at[1]);
    pen.fillStyle = ink;
    pen.textAlign = right ? "right" : "left";
    pen.fillText(scene.texts[person[0]] + ", " + far.toFixed(0) + " m off", edgeX + (right ? -14 : 14), edgeY + 4);
    pen.textAlign = "left";
  }

  function drawPeople(canvas, eye, frame, ink, blue) {
    const at = car(frame), pen = canvas.pen;
    pen.font = "12px system-ui, sans-serif";
    frame.p.forEach(function (person, rank) {
      const rounds = discs(person);
      drawOutside(canvas, eye, frame, person, ink, blue);
      pen.fillStyle = pen.strokeStyle = blue;
      if (shows(1)) rounds.slice(1).forEach(function (round) {
        disc(pen, eye, round);
        pen.globalAlpha = 0.1; pen.fill();
        pen.globalAlpha = 0.5; pen.lineWidth = 0.8; pen.stroke();
      });
      pen.setLineDash([2, 4]); pen.globalAlpha = 0.9; pen.lineWidth = 1.2;
      if (shows(2)) summed(frame.g[rank], 3, [CM, CM, CM]).slice(1).forEach(function (round) {
        disc(pen, eye, round); pen.stroke();
      });
      pen.setLineDash([]);
      pen.globalAlpha = 1;
      disc(pen, eye, rounds[0]); pen.fill();
      pen.fillStyle = ink;
      if (frame.p.length > 6 && Math.hypot(rounds[0][0] - at[0], rounds[0][1] - at[1]) > 12) return;
      pen.fillText(scene.texts[person[0]], eye.x(rounds[0][0]) + 8, eye.y(rounds[0][1]) - 8);
      const wanted = frame.i[rank][0];
      if (shows(1) && wanted) pen.fillText("→ " + goal(wanted), eye.x(rounds[0][0]) + 8, eye.y(rounds[0][1]) + 6);
    });
  }

  function drawCar(pen, eye, frame, ink) {
    const at = car(frame), front = frame.b[0] * CM, rear = frame.b[1] * CM, half = frame.b[2] * CM;
    const ahead = (front - rear) / 2, cos = Math.cos(at[2]), sin = Math.sin(at[2]);
    pen.strokeStyle = ink; pen.fillStyle = ink; pen.lineWidth = 2; pen.setLineDash([]);
    box(pen, eye, [at[0] + ahead * cos, at[1] + ahead * sin, at[2], (front + rear) / 2, half]);
    pen.globalAlpha = 0.15; pen.fill(); pen.globalAlpha = 1; pen.stroke();
    pen.beginPath();
    [[front, 0], [front - 0.7, half * 0.8], [front - 0.7, -half * 0.8]].forEach(function (p) {
      pen.lineTo(eye.x(at[0] + p[0] * cos - p[1] * sin), eye.y(at[1] + p[0] * sin + p[1] * cos));
    });
    pen.closePath(); pen.fill();
  }

  function drawTube(pen, eye, shapes, verdict, fill, width) {
    pen.setLineDash(verdict === 0 ? [] : [4, 3]);
    pen.fillStyle = pen.strokeStyle = scene.verdicts[verdict][1];
    shapes.forEach(function (shape) {
      box(pen, eye, shape);
      pen.globalAlpha = fill; pen.fill();
      pen.globalAlpha = 0.8; pen.lineWidth = width; pen.stroke();
    });
  }

  function drawView() {
    const frame = frames[index], page = getComputedStyle(root);
    const ink = page.color, blue = page.getPropertyValue("--blue").trim();
    const canvas = fitted(view), pen = canvas.pen, eye = camera(frame, canvas.width, canvas.height);
    grid(pen, eye, canvas.width, canvas.height, ink);
    pen.strokeStyle = ink; pen.lineWidth = 1.5; pen.setLineDash([7, 5]);
    pen.beginPath();
    paths[frame.l].forEach((at) => pen.lineTo(eye.x(at[0]), eye.y(at[1])));
    pen.stroke();
    const verdict = scene.verdicts[frame.v];
    if (shows(1)) drawTube(pen, eye, rectangles(frame), said(frame, 1), 0.16, 1);
    if (shows(2)) drawTube(pen, eye, boxes(frame.h), said(frame, 2), 0, 2.2);
    pen.setLineDash([]); pen.globalAlpha = 1;
    drawPeople(canvas, eye, frame, ink, blue);
    drawCar(pen, eye, frame, ink);
    pen.font = "bold 15px system-ui, sans-serif";
    const label = frame.u ? undecided(frame) : verdict[0] + " · " + scene.texts[frame.a];
    pen.fillStyle = frame.u ? "#ccc" : verdict[1]; pen.fillRect(6, 6, pen.measureText(label).width + 16, 24);
    pen.fillStyle = "#111"; pen.fillText(label, 14, 23);
  }

  function drawStrip() {
    const canvas = fitted(strip), each = canvas.width / frames.length;
    frames.forEach(function (frame, k) {
      canvas.pen.fillStyle = frame.u ? "#888" : scene.verdicts[frame.v][1];
      const tall = (frame.u ? 0.15 : [1, 0.7, 0.4][frame.v]) * canvas.height;
      canvas.pen.fillRect(Math.floor(k * each), canvas.height - tall, Math.ceil(each) + 1, tall);
    });
    canvas.pen.fillStyle = getComputedStyle(root).color;
    canvas.pen.fillRect(Math.min((index + 0.5) * each, canvas.width - 2), 0, 2, canvas.height);
  }

  function show(to) {
    index = Math.max(0, Math.min(frames.length - 1, to));
    const frame = frames[index], verdict = frame.u ? "none" : scene.verdicts[frame.v][0];
    const action = frame.u ? undecided(frame) : scene.texts[frame.a], time = frame.t.toFixed(2) + " s";
    scrubber.value = String(index);
    scrubber.setAttribute("aria-valuetext", time + ", " + verdict + ", " + action);
    find("time").textContent = time;
    const badge = root.querySelector(".badge.verdict");
    badge.textContent = verdict;
    badge.className = "badge verdict " + verdict.toLowerCase();
    find("action").textContent = action;
    find("speed").textContent = frame.s.toFixed(2) + " m/s";
    find("clearance").textContent = frame.d === null ? "none" : frame.d.toFixed(2) + " m";
    find("people").textContent = String(frame.n);
    find("why").textContent = scene.texts[frame.r];
    // What the policies said is all of it.
    find("why").parentElement.hidden = frame.q.length > 0;
    find("sent").textContent = scene.texts[frame.e] || "–";
    find("policies").textContent = frame.q.map((each) => scene.texts[each[0]] + ": " +
      scene.verdicts[each[1]][0] + ", " + scene.texts[each[2]] + ". " + scene.texts[each[3]]).join("\n") || "–";
    find("levels").textContent = frame.m.map((each) => scene.texts[each[0]] + ": " +
      each.slice(1).map((level) => scene.verdicts[level][0]).join(", ")).join("\n") || "–";
    const wanted = frame.p.map((person, rank) => [scene.texts[person[0]], frame.i[rank].map(goal).join(", ")]);
    find("wanted").textContent = wanted.filter((each) => each[1]).map((each) => each.join(": ")).join("\n");
    find("wanted").parentElement.hidden = !find("wanted").textContent;
    const named = frame.w.map((text) => scene.texts[text]);
    if (frame.z !== null) named.push("alert to " + scene.texts[frame.z]);
    find("named").textContent = named.join("\n") || "none";
    drawView();
    drawStrip();
  }

  function tick() {
    if (!playing) return;
    const now = performance.now();
    waited += ((now - clock) / 1000) * Number(find("pace").value);
    clock = now;
    let to = index;
    while (to < frames.length - 1) {
      const gap = Math.min(1, Math.max(0.001, frames[to + 1].t - frames[to].t));
      if (waited < gap) break;
      waited -= gap;
      to += 1;
    }
    if (to !== index) show(to);
    if (index === frames.length - 1) play(false);
    else setTimeout(tick, 30);
  }

  function play(on) {
    playing = on;
    find("play").textContent = on ? "Stop" : "Play";
    find("play").setAttribute("aria-pressed", String(on));
    if (!on) return;
    if (index === frames.length - 1) show(0);
    waited = 0;
    clock = performance.now();
    setTimeout(tick, 30);
  }

  function zoomBy(factor) { zoom = Math.max(0.2, Math.min(12, zoom * factor)); drawView(); }
  function step(by) { play(false); show(index + by); }

  function key(event) {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const control = event.target.tagName === "BUTTON" || event.target.tagName === "SELECT" || event.target.type === "checkbox";
    const actions = {
      " ": control ? null : () => play(!playing),
      ArrowLeft: event.target.tagName === "SELECT" ? null : () => step(-1),
      ArrowRight: event.target.tagName === "SELECT" ? null : () => step(1),
      Home: () => step(-frames.length), End: () => step(frames.length),
      "+": () => zoomBy(1.25), "=": () => zoomBy(1.25), "-": () => zoomBy(0.8),
    };
    if (!actions[event.key]) return;
    event.preventDefault();
    actions[event.key]();
  }

  view.tabIndex = 0;
  root.addEventListener("keydown", key);
  scrubber.addEventListener("input", () => { play(false); show(Number(scrubber.value)); });
  strip.addEventListener("pointerdown", function (event) {
    play(false);
    show(Math.floor((event.offsetX / strip.clientWidth) * frames.length));
  });
  find("play").addEventListener("click", () => play(!playing));
  find("back").addEventListener("click", () => step(-1));
  find("ahead").addEventListener("click", () => step(1));
  find("closer").addEventListener("click", () => zoomBy(1.25));
  find("wider").addEventListener("click", () => zoomBy(0.8));
  find("shown").addEventListener("change", drawView);
  find("follow").addEventListener("change", function () { zoom = 1; drawView(); });
  window.addEventListener("resize", () => show(index));
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => show(index));
  if (frames.length < scene.total) {
    find("left-out").textContent = frames.length + " of " + scene.total + " decisions are drawn.";
  }
  show(0);
})();

"use strict";
(function () {
  const root = document.currentScript.previousElementSibling;
  const find = (name) => root.querySelector("." + name);
  const data = JSON.parse(find("frames").textContent);
  const frames = data.frames, scrubber = find("scrubber"), CM = 0.01;
  const images = frames.map(function (frame) {
    const image = new Image();
    image.onload = () => { if (frames[index] === frame) drawSeen(); };
    image.src = frame.i;
    return image;
  });
  let index = 0, zoom = 1, playing = false, clock = 0, waited = 0;

  function fitted(canvas) {
    const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
    const wide = Math.round(width * ratio), tall = Math.round(height * ratio);
    if (canvas.width !== wide || canvas.height !== tall) { canvas.width = wide; canvas.height = tall; }
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    return { pen: pen, width: width, height: height };
  }

  function readable(colour) {
    const part = (k) => parseInt(colour.slice(k, k + 2), 16);
    return 0.3 * part(1) + 0.59 * part(3) + 0.11 * part(5) < 120 ? "#fff" : "#111";
  }

  function label(pen, text, x, y, colour) {
    pen.font = "bold 12px system-ui, sans-serif";
    const wide = pen.measureText(text).width + 8;
    pen.globalAlpha = 0.9; pen.fillStyle = colour; pen.fillRect(x, y - 16, wide, 16);
    pen.globalAlpha = 1; pen.fillStyle = readable(colour); pen.fillText(text, x + 4, y - 4);
  }

  function drawSeen() {
    const frame = frames[index], image = images[index], canvas = fitted(find("seen")), pen = canvas.pen;
    if (!image.naturalWidth) return;
    const scale = Math.min(canvas.width / image.naturalWidth, canvas.height / image.naturalHeight);
    const wide = image.naturalWidth * scale, tall = image.naturalHeight * scale;
    const left = (canvas.width - wide) / 2, top = (canvas.height - tall) / 2;
    pen.drawImage(image, left, top, wide, tall);
    frame.b.forEach(function (box) {
      const x = [left + wide * box.c[0] * 1e-4, left + wide * box.c[2] * 1e-4];
      const y = [top + tall * box.c[1] * 1e-4, top + tall * box.c[3] * 1e-4];
      const colour = box.k || "#D0D0D0";
      const sides = { left: [x[0], y[0], x[0], y[1]], right: [x[1], y[0], x[1], y[1]],
        top: [x[0], y[0], x[1], y[0]], bottom: [x[0], y[1], x[1], y[1]] };
      Object.entries(sides).forEach(function (side) {
        const at = side[1];
        [[4.5, "#111"], [2.5, colour]].forEach(function (stroke) {
          pen.lineWidth = stroke[0]; pen.strokeStyle = stroke[1];
          pen.setLineDash(box.h.includes(side[0]) ? [4, 5] : []);
          pen.beginPath(); pen.moveTo(at[0], at[1]); pen.lineTo(at[2], at[3]); pen.stroke();
        });
      });
      pen.setLineDash([]);
      label(pen, box.s, x[0], Math.max(y[0], top + 16), colour);
    });
  }

  function reach() {
    const far = data.view.reduce((most, at) => Math.max(most, at[0] * CM), 1);
    return { far: far * 1.04, back: 0.06 * far };
  }
  const span = reach();

  function eyeOf(canvas) {
    const scale = (zoom * canvas.height) / (span.far + span.back);
    return {
      scale: scale,
      // Ahead is up and left is left: x to the top, y to the left.
      at: (point) => [canvas.width / 2 - point[1] * CM * scale,
        canvas.height - (point[0] * CM + span.back) * scale],
    };
  }

  function polygon(pen, eye, points) {
    pen.beginPath();
    points.forEach(function (point) { const at = eye.at(point); pen.lineTo(at[0], at[1]); });
    pen.closePath();
  }

  function disc(pen, eye, round) {
    const at = eye.at(round);
    pen.beginPath();
    pen.arc(at[0], at[1], Math.max(1, round[2] * CM * eye.scale), 0, 2 * Math.PI);
  }

  function grid(pen, eye, canvas, ink) {
    const step = [1, 2, 5, 10, 20, 50].find((s) => s * eye.scale >= 45) || 100;
    pen.font = "12px system-ui, sans-serif";
    pen.strokeStyle = pen.fillStyle = ink; pen.lineWidth = 1; pen.setLineDash([]);
    for (let k = -200; k <= 200; k++) {
      const across = eye.at([k * step * 100, 0])[1], along = eye.at([0, k * step * 100])[0];
      pen.globalAlpha = 0.13;
      if (across > 0 && across < canvas.height) {
        pen.beginPath(); pen.moveTo(0, across); pen.lineTo(canvas.width, across); pen.stroke();
        pen.globalAlpha = 0.8; pen.fillText(String(k * step), 4, across - 3);
      }
      pen.globalAlpha = 0.13;
      if (along > 0 && along < canvas.width) {
        pen.beginPath(); pen.moveTo(along, 0); pen.lineTo(along, canvas.height); pen.stroke();
        pen.globalAlpha = 0.8;
        if (along > 24 && along < canvas.width - 20) pen.fillText(String(k * step), along + 3, canvas.height - 5);
      }
    }
    pen.globalAlpha = 1;
    pen.fillText("ahead (m)", 4, 14);
    pen.textAlign = "right"; pen.fillText("left (m)", canvas.width - 4, canvas.height - 20); pen.textAlign = "left";
  }

  function drawPerson(pen, eye, person, ink) {
    pen.strokeStyle = pen.fillStyle = person.k;
    pen.setLineDash([]); pen.lineWidth = 1.6; pen.globalAlpha = 0.9;
    pen.beginPath();
    person.w.forEach(function (point) { const at = eye.at(point); pen.lineTo(at[0], at[1]); });
    pen.stroke();
    disc(pen, eye, person.d);
    pen.globalAlpha = 0.25; pen.fill();
    pen.globalAlpha = 1; pen.lineWidth = 2; pen.setLineDash(person.o ? [] : [5, 4]); pen.stroke();
    pen.setLineDash([]);
    const at = eye.at(person.d);
    const to = eye.at([person.d[0] + person.v[0], person.d[1] + person.v[1]]);
    pen.beginPath(); pen.moveTo(at[0], at[1]); pen.lineTo(to[0], to[1]); pen.stroke();
    pen.beginPath(); pen.arc(at[0], at[1], 3.5, 0, 2 * Math.PI); pen.fill();
    pen.fillStyle = ink; pen.font = "bold 13px system-ui, sans-serif";
    pen.fillText(person.s, at[0] + 7, at[1] - 7);
  }

  function drawPlan() {
    const frame = frames[index], canvas = fitted(find("plan")), pen = canvas.pen, eye = eyeOf(canvas);
    const page = getComputedStyle(root), ink = page.color;
    if (find("unseen").checked) {
      pen.fillStyle = ink; pen.globalAlpha = 0.1;
      pen.beginPath(); pen.rect(0, 0, canvas.width, canvas.height);
      data.view.forEach(function (point, k) { const at = eye.at(point); pen[k ? "lineTo" : "moveTo"](at[0], at[1]); });
      pen.closePath(); pen.fill("evenodd");
      pen.globalAlpha = 0.22;
      frame.u.forEach(function (shape) { polygon(pen, eye, shape); pen.fill(); });
      pen.strokeStyle = ink; pen.lineWidth = 1.1; pen.setLineDash([2, 4]); pen.globalAlpha = 0.75;
      frame.a.forEach(function (round) { disc(pen, eye, round); pen.stroke(); });
    }
    pen.setLineDash([]); pen.globalAlpha = 1;
    grid(pen, eye, canvas, ink);
    pen.strokeStyle = ink; pen.lineWidth = 1.5;
    polygon(pen, eye, data.view); pen.stroke();
    frame.p.forEach((person) => drawPerson(pen, eye, person, ink));
    const eyeAt = eye.at(data.eye);
    pen.globalAlpha = 1; pen.fillStyle = ink;
    pen.beginPath(); pen.moveTo(eyeAt[0], eyeAt[1]); pen.lineTo(eyeAt[0] - 6, eyeAt[1] + 12);
    pen.lineTo(eyeAt[0] + 6, eyeAt[1] + 12); pen.closePath(); pen.fill();
  }

  function show(to) {
    index = Math.max(0, Math.min(frames.length - 1, to));
    const frame = frames[index], time = frame.t.toFixed(2) + " s";
    scrubber.value = String(index);
    scrubber.setAttribute("aria-valuetext", time);
    find("time").textContent = time;
    find("image").textContent = frame.n;
    find("boxes").textContent = String(frame.b.length);
    find("tracks").textContent = String(frame.p.length);
    root.querySelector("dd.assumed").textContent = String(frame.a.length);
    find("why").textContent = frame.y.join("\n") || "nobody";
    drawSeen();
    drawPlan();
  }

  function tick() {
    if (!playing) return;
    const now = performance.now();
    waited += (now - clock) / 1000;
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

  function zoomBy(factor) { zoom = Math.max(0.4, Math.min(8, zoom * factor)); drawPlan(); }
  function step(by) { play(false); show(index + by); }

  function key(event) {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const control = event.target.tagName === "BUTTON" || event.target.type === "checkbox";
    const actions = {
      " ": control ? null : () => play(!playing),
      ArrowLeft: () => step(-1), ArrowRight: () => step(1),
      Home: () => step(-frames.length), End: () => step(frames.length),
      "+": () => zoomBy(1.25), "=": () => zoomBy(1.25), "-": () => zoomBy(0.8),
    };
    if (!actions[event.key]) return;
    event.preventDefault();
    actions[event.key]();
  }

  root.querySelectorAll("canvas").forEach((canvas) => { canvas.tabIndex = 0; });
  root.addEventListener("keydown", key);
  scrubber.addEventListener("input", () => { play(false); show(Number(scrubber.value)); });
  find("play").addEventListener("click", () => play(!playing));
  find("back").addEventListener("click", () => step(-1));
  find("ahead").addEventListener("click", () => step(1));
  find("closer").addEventListener("click", () => zoomBy(1.25));
  find("wider").addEventListener("click", () => zoomBy(0.8));
  find("unseen").addEventListener("change", drawPlan);
  window.addEventListener("resize", () => show(index));
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => show(index));
  if (frames.length < data.total) {
    find("left-out").textContent = frames.length + " of " + data.total + " images are drawn.";
  }
  show(0);
})();

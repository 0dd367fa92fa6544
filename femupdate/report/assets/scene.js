"use strict";
// The model on a plain canvas: faces from back to front, no graphics card needed.
(function () {
  const BALL = 0.011, LIFT = 0.16;

  function element(name, attributes, parent) {
    const made = document.createElement(name);
    Object.keys(attributes || {}).forEach(function (key) { made[key] = attributes[key]; });
    if (parent) parent.appendChild(made);
    return made;
  }

  function labelled(text, control, parent) {
    const label = element("label", { textContent: text + " " }, parent);
    label.appendChild(control);
    return control;
  }

  function start(figure) {
    const scene = JSON.parse(figure.querySelector("script").textContent);
    const canvas = figure.querySelector("canvas"), pen = canvas.getContext("2d");
    const rest = scene.nodes, count = rest.length / 3, moved = new Float64Array(rest);
    const flat = new Float64Array(2 * count), depth = new Float64Array(count);
    const size = scene.size, centre = scene.centre;
    const view = { turn: -0.9, tilt: 0.42, zoom: 1 };
    const state = { mode: -1, field: 0, playing: false, phase: Math.PI / 2, enlarge: 1, signs: true, names: true };
    const calm = window.matchMedia("(prefers-reduced-motion: reduce)").matches;

    // Controls.
    const bar = figure.querySelector(".controls");
    const modes = element("select", { className: "modes" });
    element("option", { value: -1, textContent: "at rest" }, modes);
    scene.modes.forEach(function (mode, k) { element("option", { value: k, textContent: mode.name }, modes); });
    labelled("Shape", modes, bar);
    const fields = element("select", { className: "fields" });
    labelled("Colour", fields, bar);
    const play = element("button", { type: "button", className: "play", textContent: "Play" }, bar);
    const enlarge = element("input", { type: "range", min: 0.2, max: 3, step: 0.1, value: 1 });
    labelled("Size", enlarge, bar);
    [["−", 1 / 1.2], ["+", 1.2]].forEach(function (pair) {
      const button = element("button", { type: "button", textContent: pair[0] }, bar);
      button.setAttribute("aria-label", pair[1] > 1 ? "Zoom in" : "Zoom out");
      button.addEventListener("click", function () { view.zoom *= pair[1]; request(); });
    });
    const names = element("input", { type: "checkbox", checked: true });
    labelled("floors", names, bar);
    const signs = element("input", { type: "checkbox", checked: true, className: "signs" });
    if (scene.signs.length) labelled("sensors and effects", signs, bar);

    // What can colour the model: fields of its own, then those of the mode shown.
    function choices() {
      const own = scene.fields.slice();
      const mode = scene.modes[state.mode];
      if (mode) {
        own.unshift({ name: "displacement, over its largest", unit: "", nodes: lengths(mode.shape), low: 0, high: 1, map: "magnitude" });
        if (mode.spread) own.splice(1, 0, { name: "spread of the displacement", unit: "% of the largest", nodes: mode.spread, low: 0, high: top(mode.spread), map: "spread" });
      }
      return own;
    }

    function lengths(shape) {
      const out = new Array(count);
      for (let i = 0; i < count; i++) out[i] = Math.hypot(shape[3 * i], shape[3 * i + 1], shape[3 * i + 2]);
      return out;
    }

    function top(values) { return values.reduce(function (a, b) { return Math.max(a, b); }, 1e-12); }

    let known = [];
    function fill(keep) {
      const before = keep && known[state.field] ? known[state.field].name : "";
      known = choices();
      fields.textContent = "";
      known.forEach(function (field, k) { element("option", { value: k, textContent: field.name }, fields); });
      const place = known.findIndex(function (field) { return field.name === before; });
      state.field = Math.max(0, place);
      fields.value = state.field;
      legend();
    }

    function color(field, value) {
      const ramp = scene.maps[field.map], last = ramp.length - 1;
      const share = field.high > field.low ? (value - field.low) / (field.high - field.low) : 0.5;
      const place = Math.max(0, Math.min(1, share)) * last, k = Math.min(last - 1, Math.floor(place)), t = place - k;
      return ramp[k].map(function (c, j) { return c + t * (ramp[k + 1][j] - c); });
    }

    function css(rgb, light) {
      return "rgb(" + rgb.map(function (c) { return Math.round(c * light); }).join(",") + ")";
    }

    function legend() {
      const box = figure.querySelector(".scale"), field = known[state.field];
      box.textContent = "";
      if (!field) return;
      const unit = field.unit ? " " + field.unit : "";
      element("span", { textContent: Number(field.low.toPrecision(3)) + unit }, box);
      const ramp = element("span", { className: "ramp" }, box);
      ramp.style.background = "linear-gradient(to right," + scene.maps[field.map].map(function (c) { return css(c, 1); }).join(",") + ")";
      element("span", { textContent: Number(field.high.toPrecision(3)) + unit }, box);
      element("span", { textContent: field.name }, box);
    }

    function place() {
      const mode = scene.modes[state.mode];
      const swing = mode ? Math.sin(state.phase) * state.enlarge * LIFT * size : 0;
      for (let i = 0; i < 3 * count; i++) moved[i] = rest[i] + (mode ? swing * mode.shape[i] : 0);
    }

    function projector(width, height) {
      const ct = Math.cos(view.turn), st = Math.sin(view.turn), cl = Math.cos(view.tilt), sl = Math.sin(view.tilt);
      const scale = view.zoom * 0.82 * Math.min(width / scene.span, height / (scene.height * Math.abs(cl) + scene.span * Math.abs(sl)));
      return function (x, y, z) {
        const dx = x - centre[0], dy = y - centre[1], dz = z - centre[2];
        const right = ct * dx - st * dy, away = st * dx + ct * dy;
        return [width / 2 + scale * right, height / 2 - scale * (cl * dz + sl * away), cl * away - sl * dz, scale];
      };
    }

    function draw() {
      const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
      if (!width) return;
      if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
        canvas.width = Math.round(width * ratio);
        canvas.height = Math.round(height * ratio);
      }
      pen.setTransform(ratio, 0, 0, ratio, 0, 0);
      pen.clearRect(0, 0, width, height);
      place();
      const project = projector(width, height), field = known[state.field];
      for (let i = 0; i < count; i++) {
        const p = project(moved[3 * i], moved[3 * i + 1], moved[3 * i + 2]);
        flat[2 * i] = p[0]; flat[2 * i + 1] = p[1]; depth[i] = p[2];
      }
      const queue = [];
      for (let k = 0; k < scene.faces.length / 4; k++) {
        const q = scene.faces.slice(4 * k, 4 * k + 4);
        queue.push([(depth[q[0]] + depth[q[1]] + depth[q[2]] + depth[q[3]]) / 4, 0, k, q]);
      }
      for (let k = 0; k < scene.lines.length / 2; k++) {
        const q = scene.lines.slice(2 * k, 2 * k + 2);
        queue.push([(depth[q[0]] + depth[q[1]]) / 2, 1, k, q]);
      }
      queue.sort(function (a, b) { return b[0] - a[0]; });
      queue.forEach(function (item) {
        const q = item[3], isLine = item[1] === 1;
        let value = null;
        if (field && field.nodes) value = q.reduce(function (a, i) { return a + field.nodes[i]; }, 0) / q.length;
        else if (field) value = isLine ? field.lines[item[2]] : field.faces[item[2]];
        const rgb = value === null || value === undefined ? [200, 205, 212] : color(field, value);
        pen.beginPath();
        pen.moveTo(flat[2 * q[0]], flat[2 * q[0] + 1]);
        for (let j = 1; j < q.length; j++) pen.lineTo(flat[2 * q[j]], flat[2 * q[j] + 1]);
        if (isLine) {
          pen.lineWidth = 3; pen.strokeStyle = css(rgb, 0.85); pen.stroke();
        } else {
          pen.closePath();
          pen.globalAlpha = scene.signs.length && state.signs ? 0.72 : 0.93;
          pen.fillStyle = css(rgb, 1); pen.fill();
          pen.globalAlpha = 0.35; pen.lineWidth = 0.5; pen.strokeStyle = css(rgb, 0.55); pen.stroke();
          pen.globalAlpha = 1;
        }
      });
      if (state.mode >= 0) outline(project);
      if (state.signs) drawSigns(project);
      if (state.names) drawNames(project);
    }

    // The building at rest, behind its shape.
    function outline(project) {
      pen.strokeStyle = "rgba(60,66,75,.35)"; pen.lineWidth = 0.8;
      pen.beginPath();
      for (let k = 0; k < scene.edges.length; k += 2) {
        const a = 3 * scene.edges[k], b = 3 * scene.edges[k + 1];
        const p = project(rest[a], rest[a + 1], rest[a + 2]), q = project(rest[b], rest[b + 1], rest[b + 2]);
        pen.moveTo(p[0], p[1]); pen.lineTo(q[0], q[1]);
      }
      pen.stroke();
    }

    function drawSigns(project) {
      scene.signs.forEach(function (sign) {
        pen.strokeStyle = pen.fillStyle = sign.effect ? "#b3470a" : "#22262b";
        pen.lineWidth = sign.effect ? 2.6 : 1.6;
        sign.faces.forEach(function (face) {
          pen.globalAlpha = 0.45; path(face, project); pen.closePath(); pen.fill(); pen.globalAlpha = 1;
        });
        sign.lines.forEach(function (line) { path(line, project); pen.stroke(); });
        sign.balls.forEach(function (ball) {
          const p = project(ball[0], ball[1], ball[2]);
          pen.beginPath(); pen.arc(p[0], p[1], Math.max(2.5, p[3] * (sign.effect ? ball[3] : BALL * size)), 0, 7); pen.fill();
        });
      });
    }

    function path(points, project) {
      pen.beginPath();
      for (let k = 0; k < points.length; k += 3) {
        const p = project(points[k], points[k + 1], points[k + 2]);
        if (k) pen.lineTo(p[0], p[1]); else pen.moveTo(p[0], p[1]);
      }
    }

    function drawNames(project) {
      pen.font = "13px system-ui, sans-serif"; pen.textBaseline = "middle"; pen.textAlign = "right";
      scene.labels.forEach(function (label) {
        const corners = label.places.map(function (at) { return project(at[0], at[1], at[2]); });
        const left = corners.reduce(function (a, b) { return a[0] < b[0] ? a : b; });
        pen.lineWidth = 3; pen.strokeStyle = "#fbfcfd"; pen.strokeText(label.text, left[0] - 6, left[1]);
        pen.fillStyle = "#22262b"; pen.fillText(label.text, left[0] - 6, left[1]);
      });
    }

    let asked = false;
    function request() {
      if (!asked) { asked = true; requestAnimationFrame(function (now) { asked = false; frame(now); }); }
    }
    let last = 0;
    function frame(now) {
      if (state.playing) {
        if (last) state.phase += Math.min(0.1, (now - last) / 1000) * 2.6;
        last = now;
        request();
      } else { last = 0; }
      draw();
    }

    function setPlaying(on) {
      state.playing = on && state.mode >= 0;
      play.textContent = state.playing ? "Pause" : "Play";
      if (!state.playing) state.phase = Math.PI / 2;
      request();
    }

    modes.addEventListener("change", function () {
      state.mode = Number(modes.value);
      fill(true);
      if (state.mode >= 0) { state.field = 0; fields.value = 0; legend(); }
      setPlaying(state.mode >= 0 && !calm);
    });
    fields.addEventListener("change", function () { state.field = Number(fields.value); legend(); request(); });
    play.addEventListener("click", function () {
      if (state.mode < 0 && scene.modes.length) { modes.value = 0; modes.dispatchEvent(new Event("change")); setPlaying(true); return; }
      setPlaying(!state.playing);
    });
    enlarge.addEventListener("input", function () { state.enlarge = Number(enlarge.value); request(); });
    names.addEventListener("change", function () { state.names = names.checked; request(); });
    signs.addEventListener("change", function () { state.signs = signs.checked; request(); });

    // Turning: drag, or the arrow keys. On a touch screen sideways only, so that the page scrolls.
    let held = null;
    canvas.addEventListener("pointerdown", function (event) {
      held = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", function (event) {
      if (!held) return;
      view.turn -= (event.clientX - held[0]) * 0.008;
      if (event.pointerType !== "touch") tilt((event.clientY - held[1]) * 0.006);
      held = [event.clientX, event.clientY];
      request();
    });
    ["pointerup", "pointercancel"].forEach(function (name) {
      canvas.addEventListener(name, function () { held = null; });
    });
    function tilt(step) { view.tilt = Math.max(-0.2, Math.min(1.5, view.tilt + step)); }
    canvas.addEventListener("keydown", function (event) {
      const keys = { ArrowLeft: [0.1, 0], ArrowRight: [-0.1, 0], ArrowUp: [0, 0.08], ArrowDown: [0, -0.08] };
      const step = keys[event.key];
      if (!step) return;
      event.preventDefault();
      view.turn += step[0]; tilt(step[1]); request();
    });
    new ResizeObserver(request).observe(canvas);
    window.addEventListener("beforeprint", draw);
    fill(false);
    request();
    figure.femupdateScene = { state: state, view: view, draw: draw };
  }

  document.querySelectorAll("figure.scene").forEach(start);
})();

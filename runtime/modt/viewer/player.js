"use strict";
// Data: #run is JSON; #tracks and #points-K are deflated columns in base64, as modt/viewer/packed.py writes them.

const element = (id) => document.getElementById(id);
const run = JSON.parse(element("run").textContent);
const canvas = element("view"), context = canvas.getContext("2d", { alpha: false });
const slider = element("slider"), speed = element("speed");
const KEPT = 32; // sweeps decoded that are kept
const TRAIL = 30; // frames
const last = run.frames.length - 1;

const state = {
  at: 0, playing: false, hovered: null, kept: null,
  points: true, trails: true, background: true, labels: true,
  up: true, metre: 10, x: 0, y: 0, // pixels a metre, and where the sensor is on the canvas
};
let table, rowsAt = [], rangeOf = new Map(), sweep = null, pixels = null, palette = null, colours = {};

// ---- data

async function unpack(id) {
  const text = atob(element(id).textContent), bytes = new Uint8Array(text.length);
  for (let k = 0; k < text.length; k++) bytes[k] = text.charCodeAt(k);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// Numbers whose differences lie in planes of bytes, the lowest first.
function sums(bytes, begin, n, width) {
  const out = new Int32Array(n);
  for (let byte = 0; byte < width; byte++)
    for (let k = 0, at = begin + byte * n; k < n; k++) out[k] |= bytes[at + k] << (8 * byte);
  for (let k = 1; k < n; k++) out[k] += out[k - 1];
  return out;
}

async function readTracks() {
  const bytes = await unpack("tracks"), n = bytes.length / (4 * run.columns.length);
  table = {};
  run.columns.forEach((name, k) => (table[name] = sums(bytes, 4 * n * k, n, 4)));
  rowsAt = run.frames.map(() => []);
  for (let row = 0; row < n; row++) {
    rowsAt[table.at[row]].push(row);
    const range = rangeOf.get(table.id[row]);
    if (range) range[1] = row + 1;
    else rangeOf.set(table.id[row], [row, row + 1]);
  }
}

const sweeps = new Map();

function readSweep(at) {
  if (!run.points || at > last) return Promise.resolve(null);
  if (!sweeps.has(at)) {
    sweeps.set(at, decodeSweep(at));
    if (sweeps.size > KEPT) sweeps.delete(sweeps.keys().next().value);
  }
  return sweeps.get(at);
}

async function decodeSweep(at) {
  const bytes = await unpack(`points-${at}`), n = bytes.length / 4, cell = sums(bytes, 0, n, 3);
  const x = new Float32Array(n), y = new Float32Array(n), { side, step_cm } = run.points;
  for (let k = 0; k < n; k++) {
    x[k] = ((cell[k] % side) + 0.5 - side / 2) * step_cm / 100;
    y[k] = (Math.floor(cell[k] / side) + 0.5 - side / 2) * step_cm / 100;
  }
  return { x, y, level: bytes.subarray(3 * n) };
}

// ---- drawing

function theme() {
  const style = getComputedStyle(document.documentElement);
  for (const name of ["ink", "soft", "line", "paper"]) colours[name] = style.getPropertyValue(`--${name}`).trim();
  const rgb = (hex) => {
    const long = hex.length === 4 ? [...hex.slice(1)].map((c) => c + c).join("") : hex.slice(1);
    return [0, 2, 4].map((k) => parseInt(long.slice(k, k + 2), 16));
  };
  const paper = rgb(colours.paper), ink = rgb(colours.ink);
  const mixed = (part) => {
    const [r, g, b] = paper.map((value, k) => Math.round(value + part * (ink[k] - value)));
    return (255 << 24) | (b << 16) | (g << 8) | r;
  };
  palette = Int32Array.from({ length: 64 }, (_, level) => mixed(level ? 0.45 + 0.5 * Math.min(level / 25, 1) : 0.16));
  colours.paperPixel = mixed(0);
}

function screen(x, y) {
  const { metre, up } = state;
  return up ? [state.x - metre * y, state.y - metre * x] : [state.x + metre * x, state.y - metre * y];
}

function place(px, py) {
  const u = (px - state.x) / state.metre, v = (state.y - py) / state.metre;
  return state.up ? [v, -u] : [u, v];
}

function drawPoints() {
  const { width, height } = canvas;
  if (!pixels || pixels.width !== width || pixels.height !== height) pixels = context.createImageData(width, height);
  const out = new Int32Array(pixels.data.buffer);
  out.fill(colours.paperPixel);
  if (sweep && state.points) {
    const { x, y, level } = sweep, { metre, up } = state;
    const size = Math.max(1, Math.min(4, Math.round((metre * run.points.step_cm) / 100)));
    const [xx, xy] = up ? [0, -metre] : [metre, 0], [yx, yy] = up ? [-metre, 0] : [0, -metre];
    for (const ground of [true, false]) // what stands lies above the ground
      for (let k = 0; k < x.length; k++) {
        if ((level[k] === 0) !== ground) continue;
        const px = (state.x + xx * x[k] + xy * y[k]) | 0, py = (state.y + yx * x[k] + yy * y[k]) | 0;
        if (px < 0 || py < 0 || px + size > width || py + size > height) continue;
        for (let dy = 0; dy < size; dy++)
          for (let dx = 0; dx < size; dx++) out[(py + dy) * width + px + dx] = palette[level[k]];
      }
  }
  context.putImageData(pixels, 0, 0);
}

function path(points, closed) {
  context.beginPath();
  points.forEach(([x, y], k) => (k ? context.lineTo(x, y) : context.moveTo(x, y)));
  if (closed) context.closePath();
}

function corners(row) {
  const x = table.x[row] / 100, y = table.y[row] / 100, yaw = table.yaw[row] / 1000;
  const c = Math.cos(yaw), s = Math.sin(yaw), l = table.l[row] / 200, w = table.w[row] / 200;
  return [[l, w], [-l, w], [-l, -w], [l, -w]].map(([u, v]) => screen(x + c * u - s * v, y + s * u + c * v));
}

function trail(row) {
  const [begin] = rangeOf.get(table.id[row]), [x0, y0, yaw] = run.poses[state.at];
  const c = Math.cos(yaw), s = Math.sin(yaw), points = [];
  for (let k = Math.max(begin, row - TRAIL); k <= row; k++) {
    const dx = table.world_x[k] / 100 - x0, dy = table.world_y[k] / 100 - y0;
    points.push(screen(c * dx + s * dy, c * dy - s * dx));
  }
  return points;
}

const label = (row) => {
  const k = table.class[row];
  return `#${table.id[row]} ${run.classes[k].name} ${(table["p_" + run.classes[k].name][row] / 10).toFixed(0)} %`;
};

function drawTrack(row) {
  const chosen = table.id[row] === (state.kept ?? state.hovered), object = table.class[row] > 0;
  const dot = devicePixelRatio || 1, box = corners(row), middle = screen(table.x[row] / 100, table.y[row] / 100);
  const filled = run.classes[table.class[row]].colour;
  context.lineWidth = (chosen ? 3 : object ? 2 : 1) * dot;
  if (state.trails && (object || chosen)) {
    path(trail(row), false);
    context.strokeStyle = filled;
    context.stroke();
  }
  path(box, true);
  context.globalAlpha = object ? 0.35 : 0.1;
  context.fillStyle = filled;
  context.fill();
  context.globalAlpha = object || chosen ? 1 : 0.55;
  context.strokeStyle = chosen ? colours.ink : run.states[table.state[row]].colour;
  context.setLineDash(table.seen[row] ? [] : [4 * dot, 3 * dot]);
  context.stroke();
  context.setLineDash([]);
  if (object && table.world_speed_mps[row] > 50) {
    const heading = table.world_heading[row] / 1000 - run.poses[state.at][2], reach = table.world_speed_mps[row] / 100;
    const x = table.x[row] / 100, y = table.y[row] / 100;
    path([middle, screen(x + reach * Math.cos(heading), y + reach * Math.sin(heading))], false);
    context.stroke();
  }
  if (table.classified[row]) {
    context.beginPath();
    context.arc(...middle, Math.max(9 * dot, 0.7 * state.metre * Math.hypot(table.l[row], table.w[row]) / 100), 0, 7);
    context.strokeStyle = colours.ink;
    context.lineWidth = 1.5 * dot;
    context.stroke();
  }
  context.globalAlpha = 1;
  if ((state.labels && object) || chosen) {
    context.font = `${12 * dot}px system-ui,sans-serif`;
    context.lineWidth = 3 * dot;
    context.strokeStyle = colours.paper;
    context.fillStyle = colours.ink;
    const top = Math.min(...box.map((corner) => corner[1])) - 5 * dot;
    context.strokeText(label(row), middle[0], top);
    context.fillText(label(row), middle[0], top);
  }
}

function draw() {
  drawPoints();
  const dot = devicePixelRatio || 1;
  context.strokeStyle = colours.line;
  context.fillStyle = colours.soft;
  context.font = `${11 * dot}px system-ui,sans-serif`;
  context.lineWidth = dot;
  for (let range = 20; range <= 100; range += 20) {
    context.beginPath();
    context.arc(state.x, state.y, range * state.metre, 0, 7);
    context.stroke();
    context.fillText(`${range} m`, state.x + 4 * dot, state.y - range * state.metre - 3 * dot);
  }
  path([[1, 0], [-0.7, 0.6], [-0.7, -0.6]].map(([x, y]) => screen(x, y)), true);
  context.fillStyle = colours.ink;
  context.fill();
  const shown = rowsAt[state.at].filter((row) => state.background || table.class[row]);
  shown.sort((a, b) => table.class[a] - table.class[b]).forEach(drawTrack);
  canvas.dataset.frame = run.frames[state.at].frame;
}

let drawing = false;
function redraw() {
  if (drawing || !table) return;
  drawing = true;
  requestAnimationFrame(() => { drawing = false; draw(); });
}

// ---- text

const add = (parent, tag, text = "", more = {}) => {
  const made = Object.assign(document.createElement(tag), { textContent: text }, more);
  parent.append(made);
  return made;
};

function showFrame() {
  const frame = run.frames[state.at], rows = rowsAt[state.at], list = element("frame");
  const cpu = Object.values(frame.cpu_ms || {}).reduce((a, b) => a + b, 0);
  const facts = [
    ["number", `${frame.frame}`],
    ["proposals", frame.proposals],
    ["tracks, lost among them", `${rows.length}, ${rows.filter((row) => !table.seen[row]).length}`],
    ["said to be objects", rows.filter((row) => table.class[row] && table.seen[row]).length],
    ["classified, deferred", `${frame.classifications}, ${frame.deferred}`],
    ["budget", run.budget],
    ["CPU time", cpu ? `${cpu.toFixed(1)} ms` : "not recorded"],
    ["energy", frame.energy_mJ === undefined ? "not recorded" : `${frame.energy_mJ.toFixed(0)} mJ, ${frame.kind}`],
  ];
  list.replaceChildren();
  for (const [name, value] of facts) add(list, "dt", name), add(list, "dd", value);
  element("stages").replaceChildren();
  for (const { name, colour } of run.stages) {
    const part = (frame.cpu_ms || {})[name] || 0;
    add(element("stages"), "i", "", { title: `${name} ${part.toFixed(1)} ms` })
      .style.cssText = `width:${100 * part / (cpu || 1)}%;background:${colour}`;
  }
  element("time").textContent = `${frame.stamp_s.toFixed(2)} s, ${state.at + 1} / ${last + 1}`;
  slider.value = state.at;
}

// Every change of state and every classification of a track.
function events(id) {
  const [begin, end] = rangeOf.get(id), found = [];
  for (let row = begin; row < end; row++) {
    const at = table.at[row], name = run.states[table.state[row]].name;
    if (table.classified[row]) {
      const said = run.classes.map((c) => `${c.name} ${(table["p_" + c.name][row] / 10).toFixed(1)} %`).join(", ");
      const view = ["l", "w", "h"].map((side) => (table[side][row] / 100).toFixed(1)).join(" × ");
      const range = Math.hypot(table.x[row], table.y[row]) / 100;
      found.push([at, `classified: ${table.points[row]} points, ${view} m at ${range.toFixed(0)} m: ${said}`]);
    }
    if (row === begin || table.state[row] !== table.state[row - 1]) found.push([at, name]);
  }
  return found;
}

function showStory() {
  const id = state.kept ?? state.hovered, box = element("story");
  if (id === null || box.dataset.shown === `${id} ${state.at}`) return;
  box.dataset.shown = `${id} ${state.at}`;
  const [begin, end] = rangeOf.get(id), row = rowsAt[state.at].find((k) => table.id[k] === id);
  box.replaceChildren();
  const first = run.frames[table.at[begin]].frame, final = run.frames[table.at[end - 1]].frame;
  add(box, "b", row === undefined ? `#${id}, not in this frame` : label(row));
  let spent = 0;
  for (let k = begin; k < end; k++) if (table.classified[k]) spent += run.frames[table.at[k]].call_mJ || 0;
  const now = row === undefined ? "" : `${run.states[table.state[row]].name}, ${table.points[row]} points, ` +
    `${(table.world_speed_mps[row] / 100).toFixed(1)} m/s; `;
  add(box, "div", `${now}frames ${first} to ${final}; ${spent.toFixed(1)} mJ of classification (estimated)`);
  const list = add(box, "ol");
  for (const [at, text] of events(id))
    add(add(list, "li"), "button", `${run.frames[at].frame}: ${text}`, { onclick: () => go(at) });
}

function legend(id, entries, outline) {
  for (const { name, colour } of entries) {
    const line = add(element(id), "span"), mark = add(line, "i");
    mark.style[outline ? "borderColor" : "background"] = colour;
    if (outline) mark.className = "outline";
    line.append(name.replaceAll("_", " "));
  }
}

// ---- time

async function go(at) {
  state.at = Math.max(0, Math.min(last, at));
  const wanted = state.at, found = await readSweep(wanted);
  if (wanted !== state.at) return; // overtaken
  sweep = found;
  showFrame();
  showStory();
  redraw();
  for (let ahead = 1; state.playing && ahead < 5; ahead++) readSweep(wanted + ahead);
}

async function play() {
  state.playing = !state.playing;
  element("play").textContent = state.playing ? "Pause" : "Play";
  if (state.playing && state.at === last) await go(0);
  let then = performance.now(), stamp = run.frames[state.at].stamp_s, reached = state.at;
  const tick = async (now) => {
    if (!state.playing) return;
    if (state.at !== reached) stamp = run.frames[state.at].stamp_s; // somebody moved the slider
    stamp += Math.min((now - then) / 1000, 0.5) * Number(speed.value);
    then = now;
    let at = state.at;
    while (at < last && run.frames[at + 1].stamp_s <= stamp) at++;
    reached = at;
    if (at !== state.at) await go(at);
    if (at === last) play();
    else requestAnimationFrame(tick);
  };
  if (state.playing) requestAnimationFrame(tick);
}

// ---- pointer and keys

function fit() {
  const dot = devicePixelRatio || 1;
  canvas.width = Math.max(1, Math.round(canvas.clientWidth * dot));
  canvas.height = Math.max(1, Math.round(canvas.clientHeight * dot));
}

function reset() {
  fit();
  state.up = canvas.height > canvas.width;
  state.metre = Math.min(canvas.width, canvas.height) / 70;
  state.x = canvas.width * (state.up ? 0.5 : 0.35);
  state.y = canvas.height * (state.up ? 0.65 : 0.5);
}

function zoom(factor, px = canvas.width / 2, py = canvas.height / 2) {
  const metre = Math.max(1, Math.min(400, state.metre * factor));
  state.x = px + (state.x - px) * metre / state.metre;
  state.y = py + (state.y - py) * metre / state.metre;
  state.metre = metre;
}

function trackAt(px, py) {
  const [x, y] = place(px, py), near = 12 / state.metre;
  let best = null, least = Infinity;
  for (const row of rowsAt[state.at]) {
    if (!state.background && !table.class[row]) continue;
    const dx = x - table.x[row] / 100, dy = y - table.y[row] / 100, yaw = table.yaw[row] / 1000;
    const u = Math.abs(Math.cos(yaw) * dx + Math.sin(yaw) * dy), v = Math.abs(Math.cos(yaw) * dy - Math.sin(yaw) * dx);
    const off = Math.hypot(Math.max(u - table.l[row] / 200, 0), Math.max(v - table.w[row] / 200, 0));
    if (off < near && off < least) [best, least] = [table.id[row], off];
  }
  return best;
}

const pointers = new Map();
let moved = false;
const spot = (event) => [event.offsetX * (devicePixelRatio || 1), event.offsetY * (devicePixelRatio || 1)];

canvas.onpointerdown = (event) => {
  pointers.set(event.pointerId, spot(event));
  canvas.setPointerCapture(event.pointerId);
  moved = false;
};
canvas.onpointermove = (event) => {
  const now = spot(event), before = pointers.get(event.pointerId);
  if (!table) return;
  if (!before) state.hovered = trackAt(...now);
  else {
    const other = [...pointers].find(([id]) => id !== event.pointerId)?.[1];
    const away = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]);
    if (other) zoom(away(now) / Math.max(away(before), 1), ...other);
    else [state.x, state.y] = [state.x + now[0] - before[0], state.y + now[1] - before[1]];
    moved ||= Math.hypot(now[0] - before[0], now[1] - before[1]) > 2;
    pointers.set(event.pointerId, now);
  }
  showStory();
  redraw();
};
canvas.onpointerup = canvas.onpointercancel = (event) => {
  pointers.delete(event.pointerId);
  if (!moved && table) state.kept = trackAt(...spot(event));
  showStory();
  redraw();
};
canvas.onwheel = (event) => {
  event.preventDefault();
  zoom(Math.exp(-event.deltaY / 500), ...spot(event));
  redraw();
};

const toggle = (name) => () => (state[name] = !state[name]);
const KEYS = {
  " ": play,
  ArrowLeft: (event) => go(state.at - (event.shiftKey ? 10 : 1)),
  ArrowRight: (event) => go(state.at + (event.shiftKey ? 10 : 1)),
  Home: () => go(0),
  End: () => go(last),
  "+": () => zoom(1.25),
  "-": () => zoom(0.8),
  0: reset,
  r: toggle("up"), p: toggle("points"), t: toggle("trails"), b: toggle("background"), l: toggle("labels"),
  Escape: () => (state.kept = state.hovered = null),
};
document.onkeydown = (event) => {
  const act = KEYS[event.key] || KEYS[event.key.toLowerCase()];
  if (!act || event.ctrlKey || event.metaKey || event.altKey || event.target.tagName === "SELECT") return;
  event.preventDefault();
  act(event);
  redraw();
};

slider.max = last;
slider.oninput = () => go(Number(slider.value));
element("play").onclick = (event) => { event.currentTarget.blur(); play(); }; // or Space would press it, too
onresize = () => { fit(); redraw(); };
matchMedia("(prefers-color-scheme: dark)").onchange = () => { theme(); redraw(); };

async function begin() {
  theme();
  reset();
  legend("classes", run.classes, false);
  legend("states", run.states, true);
  legend("stage-legend", run.stages, false);
  await readTracks();
  await go(run.start);
}
begin();

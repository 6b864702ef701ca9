// ---- drawing

const canvas = element("view"), context = canvas.getContext("2d", { alpha: false });
const TRAIL = 30; // frames
let sweep = null, pixels = null, palettes = {}, colours = {}, dot = 1;
let taken = [], boxes = []; // rectangles of texts, and of objects
// A page may replace these: { text, colour } that marks a track, and drawing between the boxes and their labels.
let markOf = (row) => null, drawMore = (frame) => {};

function theme() {
  const style = getComputedStyle(document.documentElement);
  for (const name of ["ink", "soft", "line", "paper"]) colours[name] = style.getPropertyValue(`--${name}`).trim();
  const rgb = (hex) => [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16));
  const paper = rgb(colours.paper), ink = rgb(colours.ink);
  const mixed = (part, colour = ink) => {
    const [r, g, b] = paper.map((value, k) => Math.round(value + part * (colour[k] - value)));
    return (255 << 24) | (b << 16) | (g << 8) | r;
  };
  const byHeight = (look) => mixed(look & 63 ? 0.35 + 0.5 * Math.min((look & 63) / 25, 1) : 0.15);
  const quiet = (look) => mixed(look & 63 ? 0.3 + 0.2 * Math.min((look & 63) / 25, 1) : 0.12); // boxes stand out in it
  const byKind = (look) => (look & 63 && run.kinds[look >> 6] ? mixed(1, rgb(run.kinds[look >> 6].colour)) : byHeight(look));
  const shades = (shade) => Int32Array.from({ length: 256 }, (_, look) => shade(look));
  palettes = { false: shades(byHeight), true: shades(byKind), quiet: shades(quiet) };
  colours.paperPixel = mixed(0);
}

// Place on the canvas of a point [m, sensor frame, height above ground]. Behind the eye it is NaN.
function screen(x, y, z = 0) {
  const { metre, up } = state;
  if (state.deep) return projected(x, y, z, eye());
  return up ? [state.x - metre * y, state.y - metre * x] : [state.x + metre * x, state.y - metre * y];
}

const NEAREST_M = 0.5; // depth from which points are drawn
const LOOKS_AT_M = 6; // point ahead of the sensor about which the view turns

// The camera of the perspective: sines and cosines of its angles, distance, and size of a unit of tangent [pixel].
const eye = () => ({
  c: Math.cos(state.turn), s: Math.sin(state.turn), down: Math.sin(state.tilt), along: Math.cos(state.tilt),
  away: state.away, focal: Math.max(canvas.height, 0.6 * canvas.width), x: canvas.width / 2, y: 0.6 * canvas.height,
});

function projected(x, y, z, { c, s, down, along, away, focal, x: px, y: py }) {
  const ahead = c * (x - LOOKS_AT_M) + s * y, left = c * y - s * (x - LOOKS_AT_M);
  const depth = away + ahead * along - z * down;
  if (depth < NEAREST_M) return [NaN, NaN, depth];
  return [px - focal * left / depth, py - focal * (ahead * down + z * along) / depth, depth];
}

function drawPoints() {
  const { width, height } = canvas;
  if (!pixels || pixels.width !== width || pixels.height !== height) pixels = context.createImageData(width, height);
  const out = new Int32Array(pixels.data.buffer);
  out.fill(colours.paperPixel);
  if (sweep && state.points) drawCells(out);
  context.putImageData(pixels, 0, 0);
}

// The cells of the sweep as squares, those of the ground first: what stands lies above it.
function drawCells(out) {
  const { width, height } = canvas, { x, y, look } = sweep, { level_m, step_cm } = run.points, camera = eye();
  const palette = palettes[state.kinds || (state.deep && "quiet")];
  for (const ground of [true, false])
    for (let k = 0; k < x.length; k++) {
      const level = look[k] & 63;
      if ((level === 0) !== ground) continue;
      const [u, v, depth] = state.deep ? projected(x[k], y[k], level * level_m, camera) : screen(x[k], y[k]);
      if (depth < NEAREST_M) continue;
      const metre = state.deep ? camera.focal / depth : state.metre; // pixels
      const size = Math.max(1, Math.min(4, Math.round(metre * step_cm / 100)));
      const px = u | 0, py = v | 0;
      if (px < 0 || py < 0 || px + size > width || py + size > height) continue;
      for (let dy = 0; dy < size; dy++) out.fill(palette[look[k]], (py + dy) * width + px, (py + dy) * width + px + size);
    }
}

// Lines through points; those behind the eye are left out.
function path(points, closed) {
  let drawn = false;
  context.beginPath();
  for (const [x, y] of points) {
    if (drawn) context.lineTo(x, y);
    else context.moveTo(x, y);
    drawn = !isNaN(x);
  }
  if (closed) context.closePath();
}

// The corners of a box at a height above ground.
function outline({ x, y, l, w, yaw }, z = 0) {
  const c = Math.cos(yaw), s = Math.sin(yaw);
  const sides = [[l, w], [-l, w], [-l, -w], [l, -w]];
  return sides.map(([u, v]) => screen(x + (c * u - s * v) / 2, y + (s * u + c * v) / 2, z));
}

// All corners of a box that are drawn: in perspective also those of its top.
const shape = (row) => (state.deep && row.h ? [...outline(row), ...outline(row, row.h)] : outline(row));

// Sides and top of a box in perspective; its bottom is drawn as from above.
function walls(row) {
  const low = outline(row), high = outline(row, row.h);
  return [high, ...low.map((_, k) => [low[k], low[(k + 1) % 4], high[(k + 1) % 4], high[k]])];
}

function stroke(colour, width, dash = []) {
  context.strokeStyle = colour;
  context.lineWidth = width * dot;
  context.setLineDash(dash.map((part) => part * dot));
  context.stroke();
  context.setLineDash([]);
}

function trail(row) {
  const rows = rowsOf.get(row.id), end = rows.indexOf(row) + 1, [x0, y0, yaw] = frames[state.at].pose;
  const c = Math.cos(yaw), s = Math.sin(yaw);
  return rows.slice(Math.max(0, end - TRAIL), end).map(({ world_x, world_y }) => {
    const dx = world_x - x0, dy = world_y - y0;
    return screen(c * dx + s * dy, c * dy - s * dx);
  });
}

// The reported class with its posterior; with a question mark below one half, as in `uncertain` of tracks.jsonl.
const reported = (row, digits) => {
  const { name } = run.classes[row.class], p = row[`p_${name}`];
  if (p === undefined) return words(name);
  return `${name}${row.class && p < 0.5 ? "?" : ""} ${(100 * p).toFixed(digits)} %`;
};
const label = (row) => `#${row.id} ${reported(row, 0)}`;

// Rectangle around the corners of a box: left, top, right, bottom.
function bounds(corners) {
  const x = corners.map((corner) => corner[0]), y = corners.map((corner) => corner[1]);
  return [Math.min(...x), Math.min(...y), Math.max(...x), Math.max(...y)];
}

const overlap = (a, b) => a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3];

// Places of a text about a box, the preferred one first: above, below, at its sides, and further above.
function places(width, [left, top, right, bottom]) {
  const height = 14 * dot, gap = 2 * dot, centre = (left + right) / 2, middle = (top + bottom + height) / 2;
  const x = Math.max(gap, Math.min(canvas.width - width - gap, centre - width / 2));
  const feet = [[x, top - gap], [x, bottom + gap + height], [right + 2 * gap, middle], [left - 2 * gap - width, middle]];
  for (let k = 1; k < 6; k++) feet.push([x, top - gap - k * height]);
  return feet.map(([begin, foot]) => [begin, foot - height, begin + width, foot]);
}

// A text beside a box, at the first place that covers neither a text nor another box, else no text.
// It is left out where there is no room, unless it is needed.
function write(text, corners, colour, needed) {
  const own = bounds(corners), x = (own[0] + own[2]) / 2;
  if (!(x >= 0 && x <= canvas.width && own[3] >= 0 && own[1] <= canvas.height)) return;
  const all = places(context.measureText(text).width, own);
  const free = all.filter((place) => !taken.some((other) => overlap(place, other)));
  const place = free.find((place) => !boxes.some((box) => overlap(place, box))) ?? free[0] ?? (needed && all[0]);
  if (!place) return;
  taken.push(place);
  if (place[3] < own[1] - 4 * dot) {
    path([[x, own[1]], [x, place[3]]], false);
    stroke(colours.soft, 1);
  }
  context.lineWidth = 3 * dot;
  context.strokeStyle = colours.paper;
  context.fillStyle = colour;
  context.strokeText(text, place[0], place[3] - 3 * dot);
  context.fillText(text, place[0], place[3] - 3 * dot);
}

// Value of a motion that is known to be one.
const MOVING = 2;
// Direction of motion over ground, in the frame of the sensor [rad].
const headingOf = (row) => row.world_heading - frames[state.at].pose[2];
// Whether a track is drawn and can be pointed at: background on request.
const isShown = (row) => state.background || row.class > 0;

function arrow(from, to) {
  const length = Math.hypot(to[0] - from[0], to[1] - from[1]), head = Math.min(7 * dot, length);
  if (length < 2 * dot) return;
  const u = (to[0] - from[0]) / length, v = (to[1] - from[1]) / length;
  const barb = (side) => [to[0] - head * (u - side * v), to[1] - head * (v + side * u)];
  path([from, to, barb(0.5), to, barb(-0.5)], false);
  stroke(colours.ink, 1.5);
}

function drawTrack(row) {
  const chosen = row.id === (state.kept ?? state.hovered), object = row.class > 0;
  const box = outline(row), middle = screen(row.x, row.y), filled = run.classes[row.class].colour;
  const edge = state.details ? run.states[row.state].colour : filled, mark = markOf(row);
  if (state.trails && (object || chosen)) {
    context.globalAlpha = chosen ? 1 : 0.4;
    path(trail(row), false);
    stroke(filled, chosen ? 2 : 1.5);
  }
  path(box, true);
  context.globalAlpha = object ? 0.35 : row.seen ? 0.1 : 0.04;
  context.fillStyle = filled;
  context.fill();
  context.globalAlpha = object || chosen ? 1 : row.seen ? 0.5 : 0.3;
  const shown = chosen ? colours.ink : mark?.colour ?? edge;
  stroke(shown, chosen || mark ? 3 : object ? 2 : 1, row.seen ? [] : [4, 3]);
  if (state.deep && object) {
    for (const wall of walls(row)) {
      path(wall, true);
      context.globalAlpha = 0.1;
      context.fill();
      context.globalAlpha = 0.8;
      stroke(shown, chosen || mark ? 2 : 1, row.seen ? [] : [4, 3]);
    }
  }
  if (mark) {
    for (const corner of [0, 1]) {
      path([box[corner], box[corner + 2]], false);
      stroke(shown, 1.5);
    }
  }
  if (object && row.motion === MOVING) {
    const heading = headingOf(row), reach = row.world_speed_mps;
    arrow(middle, screen(row.x + reach * Math.cos(heading), row.y + reach * Math.sin(heading)));
  }
  if (row.classified && state.details) {
    context.beginPath();
    context.arc(...middle, Math.max(9 * dot, 0.7 * state.metre * Math.hypot(row.l, row.w)), 0, 7);
    stroke(colours.ink, 1.5);
  }
  context.globalAlpha = 1;
}

const CIRCLE = Array.from({ length: 121 }, (_, k) => [Math.cos(k * Math.PI / 60), Math.sin(k * Math.PI / 60)]);

function drawRings() {
  context.font = `${11 * dot}px system-ui,sans-serif`;
  context.fillStyle = colours.soft;
  const step = state.deep ? 10 : [1, 2, 5, 10, 20].find((metres) => metres * state.metre > 110 * dot) || 50;
  for (let range = step; range <= 10 * step; range += step) {
    path(CIRCLE.map(([c, s]) => screen(range * c, range * s)), false);
    stroke(colours.line, 1);
    const text = `${range} m`, [x, foot] = state.deep || state.up ? screen(range, 0) : screen(0, range), left = x + 4 * dot;
    const room = [left, foot - 14 * dot, left + context.measureText(text).width, foot];
    if (taken.some((other) => overlap(room, other))) continue;
    context.fillText(text, left, foot - 3 * dot);
    taken.push(room);
  }
  const size = state.deep ? 0.6 : (10 * dot) / state.metre;
  path([[1, 0], [-0.7, 0.6], [-0.7, -0.6]].map(([x, y]) => screen(size * x, size * y)), true);
  context.fillStyle = colours.ink;
  context.fill();
}

const depthOf = (row) => projected(row.x, row.y, 0, eye())[2];

function draw() {
  dot = devicePixelRatio || 1;
  const [x, y] = screen(0, 0);
  taken = [[x - 10 * dot, y - 8 * dot, x + 10 * dot, y + 8 * dot]]; // the sensor
  drawPoints();
  drawRings();
  if (!state.ready) return;
  const frame = frames[state.at], chosen = state.kept ?? state.hovered;
  const shown = (rowsAt[state.at] || []).filter((row) => isShown(row) || row.id === chosen);
  boxes = shown.filter((row) => row.class).map((row) => bounds(shape(row)));
  shown.sort((a, b) => a.class - b.class || a.seen - b.seen);
  if (state.deep) shown.sort((a, b) => depthOf(b) - depthOf(a));
  shown.forEach(drawTrack);
  context.font = `${12 * dot}px system-ui,sans-serif`;
  drawMore(frame);
  for (const row of shown.reverse())
    if ((state.labels && row.class) || row.id === chosen) {
      const { text, colour } = markOf(row) || { text: "", colour: colours.ink };
      write(text + label(row), shape(row), colour, row.id === chosen);
    }
  canvas.dataset.frame = frame.frame;
}

let drawing = false;
function redraw() {
  if (drawing) return;
  drawing = true;
  requestAnimationFrame(() => { drawing = false; draw(); });
}

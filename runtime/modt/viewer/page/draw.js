// ---- drawing

const canvas = element("view"), context = canvas.getContext("2d", { alpha: false });
const TRAIL = 30; // frames
let sweep = null, pixels = null, palettes = {}, colours = {}, dot = 1, taken = [];
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
  const byKind = (look) => (look & 63 && run.kinds[look >> 6] ? mixed(1, rgb(run.kinds[look >> 6].colour)) : byHeight(look));
  const shades = (shade) => Int32Array.from({ length: 256 }, (_, look) => shade(look));
  palettes = { false: shades(byHeight), true: shades(byKind) };
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
    const { x, y, look } = sweep, { metre, up } = state, palette = palettes[state.kinds];
    const size = Math.max(1, Math.min(4, Math.round((metre * run.points.step_cm) / 100)));
    const [xx, xy] = up ? [0, -metre] : [metre, 0], [yx, yy] = up ? [-metre, 0] : [0, -metre];
    for (const ground of [true, false]) // what stands lies above the ground
      for (let k = 0; k < x.length; k++) {
        if (((look[k] & 63) === 0) !== ground) continue;
        const px = (state.x + xx * x[k] + xy * y[k]) | 0, py = (state.y + yx * x[k] + yy * y[k]) | 0;
        if (px < 0 || py < 0 || px + size > width || py + size > height) continue;
        for (let dy = 0; dy < size; dy++)
          for (let dx = 0; dx < size; dx++) out[(py + dy) * width + px + dx] = palette[look[k]];
      }
  }
  context.putImageData(pixels, 0, 0);
}

function path(points, closed) {
  context.beginPath();
  points.forEach(([x, y], k) => (k ? context.lineTo(x, y) : context.moveTo(x, y)));
  if (closed) context.closePath();
}

function outline({ x, y, l, w, yaw }) {
  const c = Math.cos(yaw), s = Math.sin(yaw);
  return [[l, w], [-l, w], [-l, -w], [l, -w]].map(([u, v]) => screen(x + (c * u - s * v) / 2, y + (s * u + c * v) / 2));
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
  if (p === undefined) return name.replaceAll("_", " ");
  return `${name}${row.class && p < 0.5 ? "?" : ""} ${(100 * p).toFixed(digits)} %`;
};
const label = (row) => `#${row.id} ${reported(row, 0)}`;

// A line of text centred at x, above y, or further up where another one lies; left out where there is no room.
function write(text, x, y, colour, needed) {
  const width = context.measureText(text).width, height = 14 * dot;
  if (x < 0 || x > canvas.width || y < 0 || y > canvas.height + height) return;
  const left = Math.max(2, Math.min(canvas.width - width - 2, x - width / 2));
  for (let k = 0; k < 4; k++) {
    const box = [left, y - (k + 1) * height, left + width, y - k * height];
    if (!needed && taken.some((t) => box[0] < t[2] && t[0] < box[2] && box[1] < t[3] && t[1] < box[3])) continue;
    taken.push(box);
    if (k) {
      path([[x, y], [x, box[3]]], false);
      stroke(colours.soft, 1);
    }
    context.lineWidth = 3 * dot;
    context.strokeStyle = colours.paper;
    context.fillStyle = colour;
    context.strokeText(text, box[0], box[3] - 3 * dot);
    context.fillText(text, box[0], box[3] - 3 * dot);
    return;
  }
}

// Value of a motion that is known to be one.
const MOVING = 2;

function drawTrack(row) {
  const chosen = row.id === (state.kept ?? state.hovered), object = row.class > 0;
  const box = outline(row), middle = screen(row.x, row.y), filled = run.classes[row.class].colour;
  const edge = run.states[row.state].colour, mark = markOf(row);
  if (state.trails && (object || chosen)) {
    path(trail(row), false);
    stroke(filled, chosen ? 3 : 2);
  }
  path(box, true);
  context.globalAlpha = object ? 0.35 : row.seen ? 0.1 : 0.04;
  context.fillStyle = filled;
  context.fill();
  context.globalAlpha = object || chosen ? 1 : row.seen ? 0.5 : 0.3;
  const shown = chosen ? colours.ink : mark?.colour ?? edge;
  stroke(shown, chosen || mark ? 3 : object ? 2 : 1, row.seen ? [] : [4, 3]);
  if (object && row.motion === MOVING) {
    const heading = row.world_heading - frames[state.at].pose[2], reach = row.world_speed_mps;
    path([middle, screen(row.x + reach * Math.cos(heading), row.y + reach * Math.sin(heading))], false);
    stroke(edge, 2);
  }
  if (row.classified) {
    context.beginPath();
    context.arc(...middle, Math.max(9 * dot, 0.7 * state.metre * Math.hypot(row.l, row.w)), 0, 7);
    stroke(colours.ink, 1.5);
  }
  context.globalAlpha = 1;
}

const topOf = (box) => Math.min(...box.map((corner) => corner[1])) - 2 * dot;
const middleOf = (box) => box.reduce((sum, corner) => sum + corner[0] / box.length, 0);

function drawRings() {
  context.font = `${11 * dot}px system-ui,sans-serif`;
  context.fillStyle = colours.soft;
  const step = [1, 2, 5, 10, 20].find((metres) => metres * state.metre > 110 * dot) || 50;
  for (let range = step; range <= 10 * step; range += step) {
    context.beginPath();
    context.arc(state.x, state.y, range * state.metre, 0, 7);
    stroke(colours.line, 1);
    const text = `${range} m`, left = state.x + 4 * dot, foot = state.y - range * state.metre;
    context.fillText(text, left, foot - 3 * dot);
    taken.push([left, foot - 14 * dot, left + context.measureText(text).width, foot]);
  }
  const size = (10 * dot) / state.metre;
  path([[1, 0], [-0.7, 0.6], [-0.7, -0.6]].map(([x, y]) => screen(size * x, size * y)), true);
  context.fillStyle = colours.ink;
  context.fill();
}

function draw() {
  dot = devicePixelRatio || 1;
  taken = [[state.x - 10 * dot, state.y - 8 * dot, state.x + 10 * dot, state.y + 8 * dot]]; // the sensor
  drawPoints();
  drawRings();
  const frame = frames[state.at], chosen = state.kept ?? state.hovered;
  const shown = (rowsAt[state.at] || []).filter((row) => state.background || row.class || row.id === chosen);
  shown.sort((a, b) => a.class - b.class || a.seen - b.seen);
  shown.forEach(drawTrack);
  context.font = `${12 * dot}px system-ui,sans-serif`;
  drawMore(frame);
  for (const row of shown.reverse())
    if ((state.labels && row.class) || row.id === chosen) {
      const box = outline(row), { text, colour } = markOf(row) || { text: "", colour: colours.ink };
      write(text + label(row), middleOf(box), topOf(box), colour, row.id === chosen);
    }
  canvas.dataset.frame = frame.frame;
}

let drawing = false;
function redraw() {
  if (drawing || !frames[state.at]) return;
  drawing = true;
  requestAnimationFrame(() => { drawing = false; if (frames[state.at]) draw(); });
}

// ---- time, pointer and keys

const slider = element("slider");

async function go(at) {
  state.at = Math.max(first, Math.min(last, at));
  const wanted = state.at, found = await readSweep(wanted);
  if (wanted !== state.at) return; // overtaken
  sweep = found;
  state.ready = true;
  showFrame();
  showStory();
  redraw();
  for (let ahead = 1; state.playing && ahead < 5; ahead++) readSweep(wanted + ahead);
}

function fit() {
  dot = devicePixelRatio || 1;
  canvas.width = Math.max(1, Math.round(canvas.clientWidth * dot));
  canvas.height = Math.max(1, Math.round(canvas.clientHeight * dot));
}

function reset() {
  fit();
  state.up = canvas.height > canvas.width;
  state.metre = Math.min(canvas.width, canvas.height) / (1.55 * run.reach_m);
  state.x = canvas.width * (state.up ? 0.5 : 0.35);
  state.y = canvas.height * (state.up ? 0.65 : 0.5);
  Object.assign(state, { turn: 0, tilt: 0.45, away: 22 });
}

function zoom(factor, px = canvas.width / 2, py = canvas.height / 2) {
  if (state.deep) {
    state.away = Math.max(4, Math.min(150, state.away / factor));
    return;
  }
  const metre = Math.max(1, Math.min(400, state.metre * factor));
  state.x = px + (state.x - px) * metre / state.metre;
  state.y = py + (state.y - py) * metre / state.metre;
  state.metre = metre;
}

// Turn the view in perspective, or move it from above, by a way on the canvas.
function drag(dx, dy) {
  if (state.deep) {
    state.turn += 3 * dx / canvas.width;
    state.tilt = Math.max(0.08, Math.min(1.5, state.tilt + 2 * dy / canvas.height));
  } else {
    state.x += dx;
    state.y += dy;
  }
}

// The nearest box at a place of the canvas; where several lie there, an object before background, a seen one before a lost one.
function trackAt(px, py) {
  let best = null, least = 12 * dot; // a box farther away is not meant
  const rows = [...(rowsAt[state.at] || [])].sort((a, b) => Boolean(b.class) - Boolean(a.class) || b.seen - a.seen);
  for (const row of rows) {
    if (!isShown(row)) continue;
    const [left, top, right, bottom] = bounds(shape(row));
    const off = Math.hypot(Math.max(left - px, px - right, 0), Math.max(top - py, py - bottom, 0));
    if (off < least) {
      best = row.id;
      least = off;
    }
  }
  return best;
}

const pointers = new Map();
let moved = false;
const spot = (event) => [event.offsetX * dot, event.offsetY * dot];

canvas.onpointerdown = (event) => {
  pointers.set(event.pointerId, spot(event));
  canvas.setPointerCapture(event.pointerId);
  moved = false;
};
canvas.onpointermove = (event) => {
  const now = spot(event), before = pointers.get(event.pointerId);
  if (!before) state.hovered = trackAt(...now);
  else {
    const other = [...pointers].find(([id]) => id !== event.pointerId)?.[1];
    const away = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]);
    if (other) zoom(away(now) / Math.max(away(before), 1), ...other);
    else drag(now[0] - before[0], now[1] - before[1]);
    moved ||= Math.hypot(now[0] - before[0], now[1] - before[1]) > 2;
    pointers.set(event.pointerId, now);
  }
  showStory();
  redraw();
};
canvas.onpointerup = canvas.onpointercancel = (event) => {
  pointers.delete(event.pointerId);
  if (!moved) state.kept = trackAt(...spot(event));
  showStory();
  redraw();
};
canvas.onwheel = (event) => {
  event.preventDefault();
  zoom(Math.exp(-event.deltaY / 500), ...spot(event));
  redraw();
};

const toggle = (name) => () => (state[name] = !state[name]);
const deepen = () => {
  state.deep = !state.deep;
  element("deep").textContent = state.deep ? "2D" : "3D";
};
const KEYS = {
  " ": () => play(),
  ArrowLeft: (event) => go(state.at - (event.shiftKey ? 10 : 1)),
  ArrowRight: (event) => go(state.at + (event.shiftKey ? 10 : 1)),
  Home: () => go(first),
  End: () => go(last),
  "+": () => zoom(1.25),
  "-": () => zoom(0.8),
  0: reset,
  v: deepen, r: toggle("up"), p: toggle("points"), k: toggle("kinds"), t: toggle("trails"), b: toggle("background"), l: toggle("labels"),
  d: () => (element("details").open = !element("details").open),
  Escape: () => (state.kept = state.hovered = null),
};
document.onkeydown = (event) => {
  const act = KEYS[event.key] || KEYS[event.key.toLowerCase()];
  if (!act || event.ctrlKey || event.metaKey || event.altKey || event.target.tagName === "SELECT") return;
  event.preventDefault();
  act(event);
  redraw();
};

slider.oninput = () => go(Number(slider.value));
element("play").onclick = (event) => { event.currentTarget.blur(); play(); }; // or Space would press it, too
element("deep").onclick = (event) => { event.currentTarget.blur(); deepen(); redraw(); };
element("details").ontoggle = (event) => { state.details = event.target.open; redraw(); };
new ResizeObserver(() => { fit(); redraw(); }).observe(canvas);
matchMedia("(prefers-color-scheme: dark)").onchange = () => { theme(); redraw(); };
theme();
reset();
legends();

// ---- text

const add = (parent, tag, text = "", more = {}) => {
  const made = Object.assign(document.createElement(tag), { textContent: text }, more);
  parent.append(made);
  return made;
};

const words = (name) => name.replaceAll("_", " ");

// Seconds from the begin of a recording, or the time of day of a stamp that counts from 1970.
const time = (stamp) => stamp < 1e8 ? `${stamp.toFixed(2)} s` : new Date(1000 * stamp).toISOString().slice(11, 22);

// A page may replace these: further names and values of a frame, and what the classification of a track cost.
let factsOf = (frame) => [], costOf = (rows) => "";

const NEAREST = 6; // movers that are listed
const LONG = 30; // letters of a value that has a line of its own
const SIDES = ["ahead", "ahead left", "left", "behind left", "behind", "behind right", "right", "ahead right"];
const energy = (mJ, { kind }) => `${mJ.toFixed(mJ < 100 ? 1 : 0)} mJ, ${kind}`;
const rangeOf = (row) => Math.hypot(row.x, row.y);

// A mover in words: what, where from the sensor, how fast, and whether it comes nearer.
function describe(row) {
  const side = SIDES[(Math.round(Math.atan2(row.y, row.x) / (Math.PI / 4)) + 8) % 8], heading = headingOf(row);
  const nearer = -(row.x * Math.cos(heading) + row.y * Math.sin(heading)) / rangeOf(row);
  const whither = nearer > 0.7 ? "comes nearer" : nearer < -0.7 ? "goes away" : "crosses";
  const name = words(run.classes[row.class].name);
  const range = `${rangeOf(row).toFixed(0)}\u00a0m`, speed = `${row.world_speed_mps.toFixed(1)}\u00a0m/s`; // no line ends before a unit
  return `${name} #${row.id}, ${range} ${side}, ${speed}, ${whither}`;
}

// How many of each kind are around.
function showAround(rows) {
  element("classes").replaceChildren();
  run.classes.forEach(({ name, colour }, k) => {
    if (!k) return; // background
    const n = rows.filter((row) => row.class === k).length;
    const line = add(element("classes"), "span", "", { className: n ? "" : "none" });
    add(line, "i").style.background = colour;
    line.append(`${n} ${words(name)}`);
  });
}

function showMovers(rows) {
  const movers = rows.filter((row) => row.class && row.motion === MOVING).sort((a, b) => rangeOf(a) - rangeOf(b));
  const list = element("moving"), more = movers.length - NEAREST;
  list.replaceChildren();
  for (const row of movers.slice(0, NEAREST)) {
    const keep = () => { state.kept = row.id; showStory(); redraw(); };
    add(add(list, "li"), "button", describe(row), { onclick: keep });
  }
  if (!movers.length) add(list, "li", "nothing", { className: "soft" });
  if (more > 0) add(list, "li", `and ${more} more`, { className: "soft" });
}

function showFacts(list, facts) {
  list.replaceChildren();
  for (const [name, value] of facts.filter(([, value]) => value !== null)) {
    add(list, "dt", name);
    add(list, "dd", value, { className: `${value}`.length > LONG ? "long" : "" });
  }
}

function showFrame() {
  const frame = frames[state.at], rows = rowsAt[state.at] || [], seen = rows.filter((row) => row.seen);
  const spent = frame.cpu_ms || {}, sum = (names) => names.reduce((total, name) => total + (spent[name] || 0), 0);
  const cpu = sum(Object.keys(spent));
  showAround(seen);
  showMovers(seen);
  showFacts(element("answers"), [
    ["trust", frame.trust],
    ["CPU time of the pipeline", cpu ? `${sum(run.pipeline).toFixed(1)} ms` : "not recorded"],
    ["energy of the pipeline", frame.pipeline_mJ === undefined ? null : energy(frame.pipeline_mJ, frame)],
    ["energy of the process", frame.energy_mJ === undefined ? "not recorded" : energy(frame.energy_mJ, frame)],
    ...factsOf(frame),
  ]);
  showFacts(element("frame"), [
    ["number", `${frame.frame}`],
    ["proposals", frame.proposals],
    ["tracks, lost among them", `${rows.length}, ${rows.length - seen.length}`],
    ["reported as objects", seen.filter((row) => row.class).length],
    ["classified, deferred", `${frame.classifications}, ${frame.deferred}`],
    ["budget", run.budget],
    ["CPU time with reading and writing", cpu ? `${cpu.toFixed(1)} ms` : null],
  ]);
  element("stages").replaceChildren();
  for (const { name, colour } of run.stages) {
    const part = (frame.cpu_ms || {})[name] || 0;
    add(element("stages"), "i", "", { title: `${name} ${part.toFixed(1)} ms` })
      .style.cssText = `width:${100 * part / (cpu || 1)}%;background:${colour}`;
  }
  element("time").textContent = `${time(frame.stamp_s)}, ${state.at + 1}\u00a0/\u00a0${last + 1}`;
  slider.value = state.at;
}

const percent = (row, { name }) => `${name} ${(100 * row[`p_${name}`]).toFixed(1)} %`;
const trained = (row) => run.classes.filter(({ name }) => row[`p_${name}`] !== undefined);
const motion = (row) => trained(row).slice(1).map(({ name }) => `${name} ${row[`motion_${name}`].toFixed(1)}`).join(", ");
const stateOf = (row) => words(run.states[row.state].name);

// Every classification of a track, and every change of its state and of the class that is reported.
function events(rows) {
  const found = [];
  rows.forEach((row, k) => {
    if (row.classified) {
      const posterior = trained(row).map((c) => percent(row, c)).join(", ");
      const view = [row.l, row.w, row.h].map((side) => side.toFixed(1)).join(" × ");
      const range = rangeOf(row).toFixed(0);
      found.push([row.at, `classified: ${row.points} points, ${view} m at ${range} m: ${posterior}`]);
    }
    const before = rows[k - 1] || {};
    if (row.state !== before.state) found.push([row.at, stateOf(row)]);
    if (row.class !== before.class) found.push([row.at, `reported as ${reported(row, 1)}`]);
  });
  return found;
}

function showStory() {
  const id = state.kept ?? state.hovered, box = element("story"), rows = rowsOf.get(id);
  if (!rows || box.dataset.shown === `${id} ${state.at}`) return;
  box.dataset.shown = `${id} ${state.at}`;
  box.replaceChildren();
  const row = rows.find((row) => row.at === state.at);
  add(box, "b", row ? label(row) : `#${id}, not in this frame`);
  const pace = row && `${["motion unknown", "still", "moving"][row.motion]}, ${row.world_speed_mps.toFixed(1)} m/s, motion says ${motion(row)}`;
  const now = row ? `${stateOf(row)}, ${row.points} points, ${pace}; ` : "";
  const [begin, end] = [rows[0], rows[rows.length - 1]].map((row) => frames[row.at].frame);
  add(box, "div", `${now}frames ${begin} to ${end}${costOf(rows)}`);
  const list = add(box, "ol");
  for (const [at, text] of events(rows))
    add(add(list, "li"), "button", `${frames[at].frame}: ${text}`, { onclick: () => go(at) });
}

function legend(id, entries, outline) {
  element(id).replaceChildren();
  for (const { name, colour } of entries) {
    const line = add(element(id), "span"), mark = add(line, "i");
    mark.style[outline ? "borderColor" : "background"] = colour;
    if (outline) mark.className = "outline";
    line.append(words(name));
  }
}

function legends() {
  legend("states", run.states, true);
  legend("stage-legend", run.stages, false);
  legend("kinds", run.points ? run.kinds : [], false);
}

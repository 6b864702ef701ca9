// ---- a recorded run, played at its own pace, and the truth beside it

const speed = add(document.querySelector("footer"), "select", "", { ariaLabel: "speed" });
for (const times of [0.25, 0.5, 1, 2, 4]) add(speed, "option", `${times} ×`, { value: times, selected: times === 1 });

costOf = (rows) => {
  const spent = rows.reduce((sum, row) => sum + (row.classified ? frames[row.at].call_mJ || 0 : 0), 0);
  return `; ${spent.toFixed(1)} mJ of classification (estimated)`;
};

state.kinds = run.left_out;
state.truth = Boolean(run.truth);
if (run.truth) {
  element("answers").insertAdjacentHTML("afterend", '<h2>Truth (dotted, key G)</h2><div class="legend" id="truth"></div>');
  legend("truth", Object.values(run.truth), true);
  KEYS.g = toggle("truth");
  factsOf = (frame) => {
    const count = (outcome) => frame.truth.filter((object) => object.outcome === outcome).length;
    const counts = () => `${count("found")}, ${count("missed")}, ${frame.false.length}`;
    return frame.truth ? [["found, missed, false", counts()]] : [];
  };
  markOf = (row) => {
    const wrong = state.truth && frames[row.at].false?.includes(row.id);
    return wrong ? { text: "false: ", colour: run.truth.false.colour } : null;
  };
  drawMore = (frame) => state.truth && frame.truth?.forEach(drawTruth);
}

function drawTruth({ outcome, class: class_, ...box }) {
  const corners = outline(box), { colour } = run.truth[outcome];
  path(corners, true);
  stroke(colour, outcome === "missed" ? 3 : 1.5, [2, 2]);
  if (outcome === "missed" && state.labels)
    write(`missed ${run.classes[class_].name}`, corners, colour, false);
}

const packedSweep = (at) => element(`points-${at}`).textContent;

const play = async () => {
  state.playing = !state.playing;
  element("play").textContent = state.playing ? "Pause" : "Play";
  if (state.playing && state.at === last) await go(0);
  let then = performance.now(), stamp = frames[state.at].stamp_s, reached = state.at;
  const tick = async (now) => {
    if (!state.playing) return;
    if (state.at !== reached) stamp = frames[state.at].stamp_s; // somebody moved the slider
    stamp += Math.min((now - then) / 1000, 0.5) * Number(speed.value);
    then = now;
    let at = state.at;
    while (at < last && frames[at + 1].stamp_s <= stamp) at++;
    reached = at;
    if (at !== state.at) await go(at);
    if (at === last) play();
    else requestAnimationFrame(tick);
  };
  if (state.playing) requestAnimationFrame(tick);
};

async function begin() {
  slider.max = last;
  await addTracks(element("tracks").textContent, 0);
  await go(run.start);
}
begin();

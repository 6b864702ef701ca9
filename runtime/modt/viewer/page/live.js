// ---- a live run: frames arrive as events, the last ones are kept; the view follows while it shows the newest

const HISTORY = 600; // frames
const packedSweeps = [], notice = document.querySelector("header span");
let waiting = 0, done = Promise.resolve(), lost = false;

const stage = element("stage");
stage.dataset.notice = "No sweep so far. modt check SOURCE names the cause.";

const packedSweep = (at) => packedSweeps[at];
const play = () => go(last);
state.at = last = -1;
element("play").textContent = "Newest";

async function take({ status, frame, states, tracks, points }) {
  if (status) notice.textContent = status;
  if (!frame) {
    stage.dataset.notice = "The sensor sends no sweep. modt check SOURCE names the cause.";
    return;
  }
  delete stage.dataset.notice;
  const at = last + 1;
  await addTracks(tracks, at);
  const follows = state.at === last; // not earlier: while tracks are added, another frame may be chosen
  frames[at] = frame;
  packedSweeps[at] = points;
  notice.textContent = status || "live";
  last = slider.max = at;
  forget(at - HISTORY);
  if (run.states.length !== states.length) legend("states", (run.states = states), true);
  if (follows || state.at < first) await go(at);
}

function forget(old) {
  if (old < 0) return;
  first = slider.min = old + 1;
  delete frames[old], delete rowsAt[old], delete packedSweeps[old];
  for (const [id, rows] of rowsOf) {
    if (rows[0].at <= old) rows.shift();
    if (!rows.length) rowsOf.delete(id);
  }
}

const source = new EventSource("events");
source.onopen = () => (lost ? location.reload() : (notice.textContent = "live"));
source.onerror = () => {
  lost = true;
  notice.textContent = "does not answer: the run has ended, or too many look at it";
};
source.onmessage = (event) => {
  if (waiting > 2) return; // a page that cannot keep up misses frames
  waiting++;
  done = done.then(() => take(JSON.parse(event.data))).finally(() => waiting--);
};

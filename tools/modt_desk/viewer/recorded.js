// ---- a recorded run, played at its own pace

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

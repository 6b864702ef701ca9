// ---- a run that is recorded

async function begin() {
  slider.max = last;
  await addTracks(element("tracks").textContent, 0);
  await go(run.start);
}
begin();

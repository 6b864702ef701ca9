"use strict";
// Data: #run is JSON; #tracks and #points-K are deflated columns in base64, as modt/viewer/packed.py writes them.

const element = (id) => document.getElementById(id);
const run = JSON.parse(element("run").textContent);
const KEPT = 32; // sweeps decoded that are kept
const frames = run.frames, rowsAt = [], rowsOf = new Map(); // rows of the tracks by index of the frame and by track
let first = 0, last = frames.length - 1;

const state = {
  ready: false, // whether a frame has been read
  at: 0, playing: false, hovered: null, kept: null,
  points: true, kinds: false, trails: true, background: false, labels: true, details: false,
  up: true, metre: 10, x: 0, y: 0, // from above: pixels a metre, and where the sensor is on the canvas
  deep: false, turn: 0, tilt: 0, away: 0, // in perspective: direction of the view [rad], its angle downward, distance [m]
};

async function inflated(packed) {
  const text = atob(packed), bytes = new Uint8Array(text.length);
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

// Takes over a table of tracks, in m, rad and m/s, whose frames count from an index.
async function addTracks(packed, from) {
  const bytes = await inflated(packed), n = bytes.length / (4 * run.columns.length);
  const columns = run.columns.map(([name, scale], k) => [name, scale, sums(bytes, 4 * n * k, n, 4)]);
  for (let k = 0; k < n; k++) {
    const row = {};
    for (const [name, scale, column] of columns) row[name] = scale === 1 ? column[k] : column[k] / scale;
    row.at += from;
    (rowsAt[row.at] ||= []).push(row);
    if (rowsOf.has(row.id)) rowsOf.get(row.id).push(row);
    else rowsOf.set(row.id, [row]);
  }
}

const sweeps = new Map();

function readSweep(at) {
  if (!run.points || at > last) return Promise.resolve(null);
  if (!sweeps.has(at)) {
    sweeps.set(at, decodeSweep(packedSweep(at)));
    if (sweeps.size > KEPT) sweeps.delete(sweeps.keys().next().value);
  }
  return sweeps.get(at);
}

async function decodeSweep(packed) {
  const bytes = await inflated(packed), n = bytes.length / 4, cell = sums(bytes, 0, n, 3);
  const x = new Float32Array(n), y = new Float32Array(n), { side, step_cm } = run.points;
  for (let k = 0; k < n; k++) {
    x[k] = ((cell[k] % side) + 0.5 - side / 2) * step_cm / 100;
    y[k] = (Math.floor(cell[k] / side) + 0.5 - side / 2) * step_cm / 100;
  }
  return { x, y, look: bytes.subarray(3 * n) };
}

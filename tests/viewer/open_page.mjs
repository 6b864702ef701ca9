// Opens a page of `modt view` in a stand-in for a browser, acts on it, and prints as JSON what it then shows.
//   node open_page.mjs PAGE ACTION...      ACTION: slide:K, key:NAME, hover:X,Y or click:X,Y [m, sensor frame], theme:NAME

import { readFileSync } from "node:fs";
import vm from "node:vm";

const [, , path, ...actions] = process.argv;
const html = readFileSync(path, "utf8");
const elements = new Map(), drawn = [], failures = [];

class Element {
  constructor(tag) { Object.assign(this, { tag, own: "", children: [], style: {}, dataset: {} }); }
  get textContent() { return this.own + this.children.map((c) => c.textContent ?? c).join(" "); }
  set textContent(text) { this.own = String(text); this.children = []; }
  append(...made) { this.children.push(...made); }
  replaceChildren(...made) { this.own = ""; this.children = made; }
  setPointerCapture() {}
  blur() {}
}

const image = { pixels: null };
const context = new Proxy({}, {
  get: (target, name) => {
    if (name in target) return target[name];
    if (name === "createImageData") return (width, height) => ({ width, height, data: new Uint8ClampedArray(4 * width * height) });
    if (name === "putImageData") return (data) => { image.pixels = new Int32Array(data.data.buffer); drawn.length = 0; };
    return (...given) => drawn.push([name, ...given]);
  },
});

for (const [, tag, attributes] of html.matchAll(/<(\w+)([^>]*\bid="[^"]+"[^>]*)>/g)) {
  const id = /\bid="([^"]+)"/.exec(attributes)[1];
  elements.set(id, Object.assign(new Element(tag), { value: tag === "select" ? "1" : "0" }));
}
for (const [, id, text] of html.matchAll(/<script type="[^"]+" id="([^"]+)">([^<]*)<\/script>/g)) elements.get(id).own = text;
const canvas = Object.assign(elements.get("view"), { clientWidth: 800, clientHeight: 600, getContext: () => context });

let dark = false;
const COLOURS = { light: { "--ink": "#1c2430", "--paper": "#fff" }, dark: { "--ink": "#e4e8ee", "--paper": "#151a21" } };
const media = {};
const document = {
  getElementById: (id) => elements.get(id),
  createElement: (tag) => new Element(tag),
  documentElement: {},
};
const world = vm.createContext({
  document, console, atob, Blob, Response, DecompressionStream, performance, devicePixelRatio: 1,
  requestAnimationFrame: (f) => setTimeout(() => f(performance.now()), 1),
  matchMedia: () => media,
  getComputedStyle: () => ({ getPropertyValue: (name) => COLOURS[dark ? "dark" : "light"][name] ?? "#888888" }),
});
process.on("unhandledRejection", (error) => failures.push(String(error.stack)));
const [, script] = /<script>\n([\s\S]*)<\/script><\/body>/.exec(html);
vm.runInContext(script, world);

const settle = () => new Promise((done) => setTimeout(done, 200));
const until = async (holds) => { for (let k = 0; k < 200 && !holds(); k++) await settle(); };
await until(() => canvas.dataset.frame !== undefined);

const pixel = (x, y) => vm.runInContext(`screen(${x}, ${y})`, world);
const ACTIONS = {
  slide: async (k) => {
    elements.get("slider").value = k;
    await elements.get("slider").oninput();
  },
  key: (key) => document.onkeydown({ key, target: {}, preventDefault() {} }),
  hover: (where) => canvas.onpointermove({ pointerId: 1, ...at(where) }),
  click: (where) => { canvas.onpointerdown({ pointerId: 1, ...at(where) }); canvas.onpointerup({ pointerId: 1, ...at(where) }); },
  theme: (name) => { dark = name === "dark"; media.onchange(); },
};
function at(where) {
  const [offsetX, offsetY] = pixel(...where.split(","));
  return { offsetX, offsetY };
}
for (const action of actions) {
  const [kind, ...rest] = action.split(":");
  await ACTIONS[kind](rest.join(":"));
  await settle();
}
const paper = vm.runInContext("colours.paperPixel", world);
console.log(JSON.stringify({
  failures,
  frame: Number(canvas.dataset.frame),
  at: vm.runInContext("state.at", world),
  pixels: image.pixels.reduce((n, value) => n + (value !== paper), 0),
  labels: drawn.filter(([name]) => name === "fillText").map(([, text]) => text),
  rings: drawn.filter(([name, , , , , end]) => name === "arc" && end === 7).length,
  boxes: drawn.filter(([name]) => name === "fill").length,
  facts: elements.get("frame").textContent,
  story: elements.get("story").textContent,
  legends: ["classes", "states", "stage-legend"].map((id) => elements.get(id).textContent),
}));
process.exit(0);

// Images side by side: a divided pair, the same spot in all methods, error maps, exposure, zoom.
const REFERENCE = "reference";
const view = { scene: 0, frame: 0, left: REFERENCE, right: "", exposure: 0, errors: false, range: 1, zoom: 1, x: 0.5, y: 0.5, split: 50 };
const section = $("images"), split = $("split"), divider = $("divider");
const MOST_ZOOM = 64;
const fileOf = (kind, of, frame) => `${kind}/${of}/${String(frame).padStart(4, "0")}-${state.part.split(":")[0]}.js`;

// Settings that have images of this room and part.
function shown() {
  return data.entries.map((entry, at) => ({ entry, at, result: doneIn(at, view.scene).find((result) => hasPart(result)) }))
    .filter(({ entry, result }) => result && entry.track === state.track && (state.machine === "" || entry.machine === state.machine));
}
const hasPart = (result) => Object.keys(result.series).some((name) => name.startsWith(`${state.part}/`));
const nameOf = (of) => of === REFERENCE ? "Reference" : entryName(data.entries[of]);
const entryName = (entry) => severalMachines ? `${entry.label} (${entry.machine})` : entry.label;

function fileFor(of) {
  const scene = data.scenes[view.scene], frame = scene?.frames[view.frame];
  if (frame === undefined) return null;
  if (of === REFERENCE) return fileOf("images", scene.id, frame);
  const result = doneIn(Number(of), view.scene).find((found) => hasPart(found));
  return result ? fileOf(view.errors ? "errors" : "images", result.id, frame) : null;
}

// A canvas that shows one image once it is in sight.
class Slot {
  constructor(canvas, lost, of) {
    Object.assign(this, { canvas, lost, of, inSight: false, file: null });
    this.element = canvas.closest(".pane");
    this.element.slots = [...(this.element.slots ?? []), this];
    watcher.observe(this.element);
  }

  refresh() {
    const file = this.inSight ? fileFor(this.of()) : this.file;
    this.file = file;
    if (!this.inSight) return;
    if (!file) { this.say("There is no such image"); return; }
    image(file).then((found) => { if (this.file === file && this.inSight) this.paint(found); },
      (problem) => { if (this.file === file) this.say(problem.message); });
  }

  paint(found) {
    this.lost.hidden = true;
    this.canvas.hidden = false;
    if (found.channels === 1) paintError(this.canvas, found, view.range); else paint(this.canvas, found, view.exposure);
    this.canvas.dataset.shows = this.file;
  }

  say(text) {
    this.canvas.hidden = true;
    delete this.canvas.dataset.shows;
    this.lost.textContent = text;
    this.lost.hidden = false;
  }
}

const watcher = new IntersectionObserver((changes) => {
  for (const { target, isIntersecting } of changes) {
    for (const slot of target.slots ?? []) { slot.inSight = isIntersecting; slot.refresh(); }
  }
});

const pair = [...split.querySelectorAll("canvas")].map((canvas, at) => new Slot(canvas, split.querySelector(".lost"), () => at ? view.right : view.left));
let tiles = [];
const refresh = () => [...pair, ...tiles].forEach((slot) => slot.refresh());

function showTiles() {
  const scene = data.scenes[view.scene];
  tiles.forEach((slot) => watcher.unobserve(slot.element));
  tiles = [];
  if (!scene) return $("tiles").replaceChildren(make("p", { class: "note" }, "There are no images."));
  split.style.setProperty("--shape", `${scene.width} / ${scene.height}`);
  const made = [REFERENCE, ...shown().map(({ at }) => at)].map((of) => {
    const canvas = make("canvas", { role: "img", "aria-label": nameOf(of) }), lost = make("p", { class: "lost", hidden: true });
    const pane = make("div", { class: "pane", style: `aspect-ratio:${scene.width}/${scene.height}` }, canvas, lost);
    const value = make("span", { class: "small", "data-of": of });
    const compare = make("button", { type: "button", "aria-label": `Put ${nameOf(of)} on the right`, click: () => { setRight(of); } }, "to the right");
    const figure = make("figure", { "data-of": of }, pane, make("figcaption", {}, make("span", {}, nameOf(of)), value, of === REFERENCE ? "" : compare));
    tiles.push(new Slot(canvas, lost, () => of));
    pointers(pane);
    return figure;
  });
  $("tiles").replaceChildren(...made);
}

function valueOf(of) {
  const result = of === REFERENCE ? null : doneIn(Number(of), view.scene).find((found) => hasPart(found));
  return result?.series[key()]?.[view.frame] ?? null;
}

function tell() {
  const chosen = metricOf(state.metric), scene = data.scenes[view.scene];
  const said = (of) => finite(valueOf(of)) ? `${nameOf(of)} · ${chosen.title} ${number(valueOf(of))}` : nameOf(of);
  split.querySelector(".tag.left").textContent = said(view.left);
  split.querySelector(".tag.right").textContent = view.right === "" ? "" : said(view.right);
  $("tiles").querySelectorAll("[data-of] span[data-of]").forEach((node) => {
    node.textContent = finite(valueOf(node.dataset.of)) ? `${chosen.title} ${number(valueOf(node.dataset.of))}` : "";
  });
  $("frame-shown").textContent = scene ? `${scene.frames[view.frame]} of ${scene.frames.at(-1)}` : MISSING;
  $("exposure-shown").textContent = `${view.exposure > 0 ? "+" : view.exposure < 0 ? "−" : ""}${Math.abs(view.exposure)} EV`;
  pair.forEach((slot, at) => slot.canvas.setAttribute("aria-label", nameOf(at ? view.right || REFERENCE : view.left)));
  showNumbers();
  $("along").querySelector("svg")?.markFrame?.();
}

function showNumbers() {
  const scene = data.scenes[view.scene], table = $("numbers");
  const measured = data.metrics.filter((metric) => !metric.inTime && shown().some(({ result }) => result.series[`${state.part}/${metric.name}`]));
  table.tHead.replaceChildren(make("tr", {}, make("th", { scope: "col" }, "Method"),
    ...measured.map((metric) => make("th", { scope: "col" }, metric.title)), make("th", { scope: "col" }, "ms")));
  const values = measured.map((metric) => shown().map(({ result }) => result.series[`${state.part}/${metric.name}`]?.[view.frame] ?? null));
  const best = values.map((column, at) => (measured[at].higher ? Math.max : Math.min)(...column.filter(finite)));
  const list = shown().map(({ entry, result }, row) => make("tr", {}, make("th", { scope: "row" }, mark(entry), entryName(entry)),
    ...values.map((column, at) => make("td", { class: column[row] === best[at] ? "best" : null }, number(column[row]))),
    make("td", {}, number(result.ms[view.frame]))));
  const floor = measured.map((metric) => scene.floor[`${state.part}/${metric.name}`]?.[view.frame] ?? null);
  if (floor.some(finite)) list.push(make("tr", { class: "failed" }, make("th", { scope: "row" }, "noise floor"), ...floor.map((value) => make("td", {}, number(value))), make("td", {}, MISSING)));
  table.tBodies[0].replaceChildren(...list);
}

function setFrame(at) {
  const last = (data.scenes[view.scene]?.frames.length ?? 1) - 1;
  view.frame = Math.min(Math.max(0, at), last);
  Object.assign($("frame"), { max: last, value: view.frame });
  $("frame").setAttribute("aria-valuetext", `frame ${data.scenes[view.scene]?.frames[view.frame] ?? ""}`);
  refresh();
  tell();
}

function setRight(of) {
  view.right = of;
  $("right").value = of;
  pair[1].refresh();
  tell();
}

function setErrors(on) {
  view.errors = on;
  for (const input of document.querySelectorAll('[name="show"]')) input.checked = (input.value === "errors") === on;
  $("error-legend").hidden = !on;
  refresh();
}

// The point (x, y), in shares of the image, is in the middle of every pane.
function setZoom(zoom, x = view.x, y = view.y) {
  view.zoom = Math.min(Math.max(1, zoom), MOST_ZOOM);
  const margin = 0.5 / view.zoom;
  view.x = Math.min(Math.max(margin, x), 1 - margin);
  view.y = Math.min(Math.max(margin, y), 1 - margin);
  section.style.setProperty("--zoom", view.zoom);
  section.style.setProperty("--shift-x", `${(0.5 - view.zoom * view.x) * 100}%`);
  section.style.setProperty("--shift-y", `${(0.5 - view.zoom * view.y) * 100}%`);
  section.classList.toggle("zoomed", view.zoom > 1);
  $("zoom-shown").textContent = `${short(Number(view.zoom.toPrecision(2)))}×`;
}

// Zoom so that what lies under a place of a pane, in shares of it, stays there.
function zoomAt(zoom, across, down) {
  const bounded = Math.min(Math.max(1, zoom), MOST_ZOOM);
  const x = view.x + (across - 0.5) / view.zoom, y = view.y + (down - 0.5) / view.zoom;
  setZoom(bounded, x - (across - 0.5) / bounded, y - (down - 0.5) / bounded);
}

function setSplit(share) {
  view.split = Math.min(Math.max(0, share), 100);
  split.style.setProperty("--split", `${view.split}%`);
  divider.setAttribute("aria-valuenow", Math.round(view.split));
  divider.setAttribute("aria-valuetext", `${Math.round(view.split)} % left image`);
}

const placeIn = (pane, event) => {
  const bounds = pane.getBoundingClientRect();
  return [(event.clientX - bounds.left) / bounds.width, (event.clientY - bounds.top) / bounds.height];
};

// Dragging, pinching and the wheel, on any pane, move all of them.
function pointers(pane) {
  const down = new Map();
  pane.addEventListener("pointerdown", (event) => {
    if (event.target === divider) return;
    split.focus({ preventScroll: true });
    down.set(event.pointerId, placeIn(pane, event));
    if (view.zoom > 1 || down.size > 1) pane.setPointerCapture(event.pointerId);
  });
  pane.addEventListener("pointermove", (event) => {
    if (!down.has(event.pointerId)) return;
    const before = [...down.values()];
    down.set(event.pointerId, placeIn(pane, event));
    const after = [...down.values()];
    const middle = (list) => [0, 1].map((axis) => mean(list.map((place) => place[axis])));
    const [from, to] = [middle(before), middle(after)];
    if (down.size === 2) {
      const apart = ([a, b]) => Math.hypot(a[0] - b[0], (a[1] - b[1]) * pane.clientHeight / pane.clientWidth);
      zoomAt(view.zoom * apart(after) / Math.max(apart(before), 1e-3), ...from);
    }
    if (view.zoom > 1) setZoom(view.zoom, view.x - (to[0] - from[0]) / view.zoom, view.y - (to[1] - from[1]) / view.zoom);
  });
  for (const end of ["pointerup", "pointercancel"]) pane.addEventListener(end, (event) => down.delete(event.pointerId));
  pane.addEventListener("dblclick", (event) => { if (event.target !== divider) zoomAt(view.zoom * 2, ...placeIn(pane, event)); });
  pane.addEventListener("wheel", (event) => {
    // The page scrolls on until an image was clicked; a pinch on a touchpad comes as a wheel with ctrl.
    if (!event.ctrlKey && document.activeElement !== split) return;
    event.preventDefault();
    const lines = event.deltaMode === 1 ? 16 : 1;
    zoomAt(view.zoom * Math.exp(-event.deltaY * lines * (event.ctrlKey ? 0.01 : 0.002)), ...placeIn(pane, event));
  }, { passive: false });
}

function dividerPointers() {
  divider.addEventListener("pointerdown", (event) => { divider.setPointerCapture(event.pointerId); divider.focus({ preventScroll: true }); event.preventDefault(); });
  divider.addEventListener("pointermove", (event) => { if (divider.hasPointerCapture(event.pointerId)) setSplit(placeIn(split, event)[0] * 100); });
  divider.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -2, ArrowDown: -2, ArrowRight: 2, ArrowUp: 2, PageDown: -10, PageUp: 10 }[event.key];
    if (step) setSplit(view.split + step);
    else if (event.key === "Home") setSplit(0);
    else if (event.key === "End") setSplit(100);
    else return;
    event.preventDefault();
    event.stopPropagation();
  });
}

function keys(event) {
  if (event.ctrlKey || event.metaKey || event.altKey || /^(INPUT|SELECT)$/.test(event.target.tagName)) return;
  const step = 0.15 / view.zoom;
  const pan = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, -step], ArrowDown: [0, step] }[event.key];
  if (pan && event.target === split && view.zoom > 1) setZoom(view.zoom, view.x + pan[0], view.y + pan[1]);
  else if (event.key === "+" || event.key === "=") setZoom(view.zoom * 1.5);
  else if (event.key === "-") setZoom(view.zoom / 1.5);
  else if (event.key === "0") setZoom(1);
  else if (event.key === ",") setFrame(view.frame - 1);
  else if (event.key === ".") setFrame(view.frame + 1);
  else if (event.key === "e") setErrors(!view.errors);
  else return;
  event.preventDefault();
}

// Selects and tiles for the chosen room, part and machine; what can stay chosen stays.
function showViewer() {
  const scenes = data.scenes.map((scene, at) => ({ scene, at })).filter(({ scene }) => scene.track === state.track);
  if (state.scene !== "") view.scene = sceneNumber(state.scene);
  view.scene = Number(options($("view-scene"), scenes.map(({ scene, at }) => [String(at), scene.id]), String(view.scene)));
  const choices = [[REFERENCE, "Reference"], ...shown().map(({ entry, at }) => [String(at), entryName(entry)])];
  view.left = options($("left"), choices, String(view.left));
  const known = choices.some(([value]) => value === String(view.right)) && view.right !== "";
  view.right = options($("right"), choices, known ? String(view.right) : bestHere());
  showTiles();
  setFrame(view.frame);
}

function bestHere() {
  const chosen = metricOf(state.metric);
  const ranked = shown().map(({ at, result }) => ({ at, value: valueIn(result) })).filter(({ value }) => finite(value));
  ranked.sort((a, b) => (chosen.higher ? -1 : 1) * (a.value - b.value));
  return String(ranked[0]?.at ?? REFERENCE);
}

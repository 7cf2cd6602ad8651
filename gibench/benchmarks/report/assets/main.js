// The page: what it says at its head, its filters, and what follows from them.
function showHead() {
  const { preset, seed, created, machine } = data.run;
  const facts = [preset && `preset ${preset}`, seed && `seed ${seed}`, created && created.replace("T", " ").replace(/(:\d\d)(\.\d+)?(Z|\+00:00)$/, "$1 UTC")];
  $("run-facts").textContent = facts.filter(Boolean).join(" · ");
  $("machine").querySelector("dl").append(...machine.flatMap(([name, text]) => [make("dt", {}, name), make("dd", {}, text)]));
  $("machine").hidden = !machine.length;
  const failed = data.results.filter((result) => result.reason !== null);
  const warn = (...content) => $("warnings").append(make("p", { class: "warning" }, ...content));
  if (severalMachines) warn(`These results come from ${data.machines.length} machines. Times of different machines must not be compared: each has its own rows, and times are only ranked within one.`);
  if (!failed.length) return;
  warn(`${failed.length} of ${data.results.length} results failed. `, make("a", { href: "#failed" }, "What failed, and why"));
  $("failed").hidden = $("failed-link").hidden = false;
  $("failures").append(...failed.map((result) => {
    const lines = result.reason.trim().split("\n");
    return make("details", {}, make("summary", {}, `${data.entries[result.entry].label}, ${result.room}, seed ${result.seed}: ${lines.at(-1)}`), make("pre", {}, result.reason));
  }));
}

function fillFilters() {
  options($("track"), data.tracks.map((track) => [track, track]), state.track);
  fillParts();
  options($("on-machine"), [["", "all machines"], ...data.machines.map((machine) => [machine, machine])], "");
  $("machine-filter").hidden = !severalMachines;
  fillScenes();
  fillMetrics();
}

function fillScenes() {
  const scenes = data.scenes.filter((scene) => scene.track === state.track).map((scene) => [scene.id, scene.id]);
  state.scene = options($("scene"), [["", "all rooms"], ...scenes], state.scene);
}

const ofTrack = () => data.entries.filter((entry) => entry.track === state.track);

function fillParts() {
  const scored = new Set(ofTrack().flatMap((entry) => Object.keys(entry.scores)).map((name) => name.split("/")[0]));
  const known = Object.entries(data.partTitles).filter(([part]) => scored.has(part) || !scored.size);
  if (!known.some(([part]) => part === state.part)) state.part = known[0][0];
  options($("part"), known, state.part);
}

function fillMetrics() {
  const scored = new Set(ofTrack().flatMap((entry) => Object.keys(entry.scores)).filter((name) => name.startsWith(`${state.part}/`)));
  const known = data.metrics.filter((metric) => scored.has(`${state.part}/${metric.name}`));
  const before = state.metric;
  state.metric = options($("metric"), known.map((metric) => [metric.name, metric.title]), state.metric) || null;
  if (state.metric !== before && state.sort.key === "mean") state.sort.down = Boolean(metricOf(state.metric)?.higher);
}

function showAll() {
  showBoard();
  showViewer();
  showCharts();
}

function showCharts() {
  showScatter();
  showTraining();
  showAlong();
  showStages();
}

function on(id, type, act) { $(id).addEventListener(type, (event) => act(event.target)); }

function listen() {
  on("track", "change", ({ value }) => { state.track = value; fillScenes(); fillParts(); fillMetrics(); showAll(); });
  on("scene", "change", ({ value }) => { state.scene = value; showAll(); });
  on("part", "change", ({ value }) => { state.part = value; fillMetrics(); showAll(); });
  on("metric", "change", ({ value }) => { state.metric = value; state.sort = { key: "mean", down: metricOf(value).higher }; showBoard(); tell(); showCharts(); });
  on("on-machine", "change", ({ value }) => { state.machine = value; showAll(); });
  $("filters").addEventListener("submit", (event) => event.preventDefault());
  for (const input of document.querySelectorAll('[name="cost"]')) input.addEventListener("change", () => { state.cost = input.value; showScatter(); });
  for (const input of document.querySelectorAll('[name="training-against"]')) input.addEventListener("change", () => { state.training = input.value; showTraining(); });

  on("view-scene", "change", ({ value }) => {
    view.scene = Number(value);
    if (state.scene !== "") { state.scene = data.scenes[view.scene].id; $("scene").value = state.scene; showBoard(); showScatter(); showTraining(); }
    showViewer();
    showAlong();
  });
  on("frame", "input", ({ value }) => setFrame(Number(value)));
  on("frame-back", "click", () => setFrame(view.frame - 1));
  on("frame-on", "click", () => setFrame(view.frame + 1));
  const expose = (stops) => { view.exposure = stops; $("exposure").value = stops; refresh(); tell(); };
  on("exposure", "input", ({ value }) => expose(Number(value)));
  on("exposure-reset", "click", () => expose(0));
  for (const input of document.querySelectorAll('[name="show"]')) input.addEventListener("change", () => setErrors(input.value === "errors"));
  on("error-range", "change", ({ value }) => { view.range = Number(value); $("legend-top").textContent = value === "1" ? "1" : `${value} or more`; refresh(); });
  on("left", "change", ({ value }) => { view.left = value; pair[0].refresh(); tell(); });
  on("right", "change", ({ value }) => setRight(value));
  on("zoom-in", "click", () => setZoom(view.zoom * 1.5));
  on("zoom-out", "click", () => setZoom(view.zoom / 1.5));
  on("zoom-reset", "click", () => setZoom(1));
  section.addEventListener("keydown", keys);
  pointers(split);
  dividerPointers();

  let width = 0;
  new ResizeObserver(([{ contentRect }]) => {
    if (Math.abs(contentRect.width - width) < 1) return;
    if (width) { showScatter(); showTraining(); showAlong(); }
    width = contentRect.width;
  }).observe($("plots"));
}

function listenToTheme() {
  const themes = ["system", "light", "dark"];
  on("theme", "click", (button) => {
    const next = themes[(themes.indexOf(document.documentElement.dataset.theme ?? "system") + 1) % 3];
    if (next === "system") delete document.documentElement.dataset.theme; else document.documentElement.dataset.theme = next;
    button.textContent = `Theme: ${next}`;
  });
}

function drawLegend() {
  const context = $("magma").getContext("2d"), strip = context.createImageData(256, 1);
  for (let at = 0; at < 256; at++) strip.data.set([...magma.subarray(3 * at, 3 * at + 3), 255], 4 * at);
  context.putImageData(strip, 0, 0);
}

showHead();
listenToTheme();
if (data.metrics.length) {
  fillFilters();
  drawLegend();
  setSplit(50);
  setZoom(1);
  listen();
  showAll();
} else {
  $("filters").hidden = $("plots").hidden = $("images").hidden = true;
  showBoard();
}

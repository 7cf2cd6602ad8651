// The plots of the page, drawn for its width, theme and choice; plots.py draws those for print.
const COSTS = { ms: "milliseconds per frame (median)", prepare: "seconds of preparation a room", bytes: "baked for a room, MB" };
const LEFT = 52, BOTTOM = 44, TOP = 12;

function logTicks(low, high) {
  for (const digits of [[1], [1, 3], [1, 2, 5], [1, 1.5, 2, 3, 5, 7]]) {
    const ticks = [];
    for (let power = Math.floor(Math.log10(low)); power <= Math.ceil(Math.log10(high)); power++) {
      for (const digit of digits) {
        const tick = digit * 10 ** power;
        if (tick >= low && tick <= high) ticks.push(tick);
      }
    }
    if (ticks.length >= 3) return ticks.filter((_, at) => at % Math.ceil(ticks.length / 8) === 0);
  }
  return linearTicks(low, high);
}

function linearTicks(low, high) {
  const raw = (high - low) / 5, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].find((digit) => digit * power >= raw) * power;
  const ticks = [];
  for (let tick = Math.ceil(low / step) * step; tick <= high; tick += step) ticks.push(Number(tick.toPrecision(12)));
  return ticks;
}

// An axis: from values to pixels, with its ticks.
function axis(low, high, from, to, logarithmic) {
  const f = logarithmic ? Math.log : (value) => value;
  const at = (value) => from + (f(value) - f(low)) / (f(high) - f(low)) * (to - from);
  return { low, high, at, ticks: logarithmic ? logTicks(low, high) : linearTicks(low, high) };
}

function errorAxis(values, floor, higher, from, to) {
  const known = values.filter(finite);
  let low = Math.min(...known), high = Math.max(...known);
  if (!higher && low > 0) {
    if (finite(floor) && floor > low / 30) low = Math.min(low, floor / 1.3);
    const pad = Math.max((high / low) ** 0.07, 1.05);
    return axis(low / pad, high * pad, from, to, true);
  }
  if (finite(floor)) { low = Math.min(low, floor); high = Math.max(high, floor); }
  const pad = 0.07 * (high - low) || 0.05 * Math.abs(high) || 1;
  return axis(low - pad, high + pad, from, to, false);
}

function frameOf(svg, x, y, width, height, right, xTitle, yTitle) {
  const floorY = height - BOTTOM;
  for (const tick of y.ticks) {
    const at = y.at(tick);
    svg.append(draw("line", { x1: LEFT, x2: width - right, y1: at, y2: at, stroke: "var(--line)" }));
    svg.append(draw("text", { x: LEFT - 7, y: at + 4, "text-anchor": "end" }, short(tick)));
  }
  let last = -Infinity;
  for (const tick of x.ticks) {
    const at = x.at(tick), text = x.name ? x.name(tick) : short(tick);
    svg.append(draw("line", { x1: at, x2: at, y1: TOP, y2: floorY, stroke: "var(--line)" }));
    if (at - last < 12 + text.length * 6.5) continue; // no room beside the one before
    last = at;
    const middle = Math.min(at, width - 2 - text.length * 3.8); // the last one stays inside
    svg.append(draw("text", { x: middle, y: floorY + 17, "text-anchor": "middle" }, text));
  }
  svg.append(draw("path", { d: `M${LEFT} ${TOP}V${floorY}H${width - right}`, fill: "none", stroke: "var(--faint)" }));
  svg.append(draw("text", { x: (LEFT + width - right) / 2, y: height - 6, "text-anchor": "middle" }, xTitle));
  svg.append(draw("text", { transform: `translate(11 ${(TOP + floorY) / 2}) rotate(-90)`, "text-anchor": "middle" }, yTitle));
}

// The band in which the reference's own noise hides every difference; gives the label that it wants.
function noiseFloor(svg, y, floor, higher, width, height, right) {
  if (!finite(floor)) return null;
  const inside = floor > y.low && floor < y.high, at = y.at(Math.min(Math.max(floor, y.low), y.high));
  const [from, to] = higher ? [TOP, at] : [at, height - BOTTOM];
  svg.append(draw("rect", { x: LEFT, y: from, width: width - right - LEFT, height: Math.max(0, to - from), fill: "var(--band)" }));
  if (inside) svg.append(draw("line", { x1: LEFT, x2: width - right, y1: at, y2: at, stroke: "var(--faint)", "stroke-dasharray": "5 3" }));
  const text = `noise floor ${short(floor)}${inside ? "" : ", off the axis"}`;
  return { text, from: LEFT, to: width - right, x: width - right - 6, y: at, required: true, style: "faint" };
}

function emptyChart(box, text) {
  box.replaceChildren(make("p", { class: "note" }, text));
  return null;
}

function canvasFor(box, height, label) {
  const width = Math.max(280, box.clientWidth);
  const svg = draw("svg", { viewBox: `0 0 ${width} ${height}`, width, height, role: "img", "aria-label": label });
  box.replaceChildren(svg);
  return [svg, width];
}

function showScatter() {
  const box = $("scatter"), chosen = metricOf(state.metric), scale = state.cost === "bytes" ? 1e-6 : 1;
  const note = (text) => { $("scatter-note").textContent = text; };
  note("");
  if (!chosen) return emptyChart(box, "Nothing was scored.");
  if (severalMachines && state.machine === "" && state.cost !== "bytes") {
    return emptyChart(box, "Choose one machine above: times of different machines are not comparable.");
  }
  const points = rows().filter((row) => finite(row.mean) && finite(row[state.cost])).map((row) => ({ ...row, cost: row[state.cost] * scale }));
  const positive = points.map((point) => point.cost).filter((cost) => cost > 0);
  if (points.length < 2 || !positive.length) return emptyChart(box, "Fewer than two settings have both numbers here.");
  const most = Math.max(...points.map((point) => point.rooms));
  const width = Math.max(280, box.clientWidth);
  const height = Math.max(340, Math.min(520, width * 0.55), 150 + 11 * points.length * (width < 500 ? 1.6 : 1));
  const [svg] = canvasFor(box, height, `${chosen.title} against ${COSTS[state.cost]}, a point a setting; the leaderboard has the numbers`);
  const right = 10, floor = mean(points.map((point) => point.floor));
  const y = errorAxis(points.flatMap((point) => [point.mean, point.low ?? point.mean, point.high ?? point.mean]), floor, chosen.higher, height - BOTTOM, TOP);
  let low = Math.min(...positive), nothing = null;
  const high = Math.max(...positive);
  if (positive.length < points.length) { nothing = low / Math.max(3, (high / low) ** 0.2); low = nothing; }
  const pad = Math.max((high / low) ** 0.07, 1.3);
  const x = axis(low / pad, high * pad, LEFT, width - right, true);
  if (nothing !== null) {
    x.ticks = [nothing, ...x.ticks.filter((tick) => tick > 1.5 * nothing)];
    x.name = (tick) => tick === nothing ? "none" : short(tick);
  }
  for (const point of points) { point.x = x.at(point.cost > 0 ? point.cost : nothing); point.y = y.at(point.mean); }
  const wanted = [noiseFloor(svg, y, floor, chosen.higher, width, height, right)].filter(Boolean), obstacles = [];
  for (const { from, to, y: at } of wanted) along([from, at], [to, at], 1, obstacles);
  frameOf(svg, x, y, width, height, right, COSTS[state.cost], `${chosen.title}, ${chosen.higher ? "higher" : "lower"} is better`);
  front(svg, points.filter((point) => point.rooms === most && point.whole), chosen.higher, width - right, height - BOTTOM, obstacles, wanted);
  joined(svg, points, y, obstacles, wanted, height);
  labelled(svg, wanted, obstacles, { left: LEFT + 2, right: width - right, top: TOP, bottom: height - BOTTOM - 2 });
  note((state.scene === "" ? `${most > 1 ? `Means over ${most} rooms with 95 % intervals` : "One room, with 95 % intervals over its frames"}. ` : `Means over the frames of ${state.scene}. `) +
    "The grey staircase is the Pareto front: no cheaper setting is better." +
    (points.some((point) => !point.whole || point.rooms < most) ? " Settings that failed in a room are no part of it." : ""));
}

function front(svg, points, higher, right, bottom, obstacles, wanted) {
  let best = Infinity, path = "";
  const corners = [];
  for (const point of points.slice().sort((a, b) => a.x - b.x)) {
    const value = higher ? -point.mean : point.mean;
    if (value >= best) continue;
    corners.push([point.x, corners.length ? corners.at(-1)[1] : higher ? bottom : TOP], [point.x, point.y]);
    best = value;
  }
  if (!corners.length) return;
  corners.push([right, corners.at(-1)[1]]);
  path = corners.map(([a, b], at) => `${at ? "L" : "M"}${a.toFixed(1)} ${b.toFixed(1)}`).join("");
  svg.append(draw("path", { d: path, fill: "none", stroke: "var(--front)", "stroke-width": 5 }));
  let longest = 0, where = corners[0];
  for (let at = 1; at < corners.length; at++) {
    const [a, b] = corners[at - 1], [c, d] = corners[at], length = Math.abs(a - c) + Math.abs(b - d);
    if (length > longest) { longest = length; where = [(a + c) / 2, (b + d) / 2]; }
    along(corners[at - 1], corners[at], 3, obstacles);
  }
  wanted.push({ text: "Pareto front", x: where[0], y: where[1], required: true, style: "faint" });
}

function along([a, b], [c, d], half, obstacles) {
  const parts = Math.max(1, Math.round(Math.hypot(c - a, d - b) / 8));
  for (let part = 0; part <= parts; part++) {
    const x = a + (c - a) * part / parts, y = b + (d - b) * part / parts;
    obstacles.push({ left: x - half, right: x + half, top: y - half, bottom: y + half });
  }
}

// Markers with intervals, and lines between the settings of a curve.
function joined(svg, points, y, obstacles, wanted, height) {
  const curves = new Map(), seen = new Map();
  for (const point of points) {
    const name = `${point.entry.curve}\n${point.entry.machine}`;
    curves.set(name, [...(curves.get(name) ?? []), point]);
  }
  for (const own of curves.values()) {
    own.sort((a, b) => a.x - b.x);
    const { method, curve } = own[0].entry, style = look(method), order = seen.get(method) ?? 0;
    seen.set(method, order + 1);
    const line = { fill: "none", stroke: style.colour, "stroke-width": 1.6, "stroke-dasharray": DASHES[order % DASHES.length] };
    if (own.length > 1) svg.append(draw("path", { d: own.map((point, at) => `${at ? "L" : "M"}${point.x.toFixed(1)} ${point.y.toFixed(1)}`).join(""), ...line }));
    for (const [at, point] of own.entries()) {
      if (at) along([own[at - 1].x, own[at - 1].y], [point.x, point.y], 2, obstacles);
      if (finite(point.low) && finite(point.high)) {
        const low = Math.min(y.at(Math.max(point.low, y.low)), height - BOTTOM), high = y.at(Math.min(point.high, y.high));
        svg.append(draw("path", { d: `M${point.x - 3} ${low}h6m-3 0V${high}m-3 0h6`, stroke: style.colour, fill: "none" }));
        along([point.x, low], [point.x, high], 2, obstacles);
      }
      const shape = marker(style.marker, point.x, point.y, 5.5, { fill: order ? "var(--paper)" : style.colour, stroke: style.colour, "stroke-width": 1.5 });
      shape.append(draw("title", {}, `${point.label}: ${number(point.mean)} at ${number(point.cost)}`));
      svg.append(shape);
      obstacles.push({ left: point.x - 6, right: point.x + 6, top: point.y - 6, bottom: point.y + 6 });
    }
    const partial = own.some((point) => !point.whole) ? " (not all rooms)" : "";
    if (own.length === 1) { wanted.push({ text: own[0].label + partial, x: own[0].x, y: own[0].y, required: true, style: "name" }); continue; }
    const others = points.filter((point) => !own.includes(point));
    const free = (point) => Math.min(Infinity, ...others.map((other) => Math.hypot(point.x - other.x, point.y - other.y)));
    const host = own.reduce((a, b) => free(b) > free(a) ? b : a);
    wanted.push({ text: curve + partial, x: host.x, y: host.y, required: true, style: "name" });
    for (const point of own) if (point.entry.step) wanted.push({ text: point.entry.step, x: point.x, y: point.y, required: false, style: "step" });
  }
}

function labelled(svg, wanted, obstacles, bounds) {
  const nodes = wanted.map(({ text, style }) => draw("text", { class: style, x: 0, y: 0 }, text));
  svg.append(...nodes);
  const sizes = nodes.map((node) => node.getBBox());
  const labels = wanted.map((label, at) => ({ ...label, width: sizes[at].width, height: sizes[at].height }));
  place(labels, obstacles, bounds).forEach((box, at) => {
    if (!box) return nodes[at].remove();
    nodes[at].setAttribute("x", box.left - sizes[at].x);
    nodes[at].setAttribute("y", box.top - sizes[at].y);
    if (box.line) {
      const [x1, y1, x2, y2] = box.line;
      svg.insertBefore(draw("line", { x1, y1, x2, y2, stroke: "var(--faint)", "stroke-width": 0.8 }), nodes[0]);
    }
  });
}

// Error of each frame in the room of the images, for the best setting of each method; a click goes to the frame.
function showAlong() {
  const box = $("along"), chosen = metricOf(state.metric), scene = data.scenes[view.scene];
  if (!chosen || chosen.inTime || !scene) {
    $("along-note").textContent = "";
    return emptyChart(box, chosen?.inTime ? `${chosen.title} is one number for a whole path.` : "Nothing was scored.");
  }
  const lines = methods.map((method) => bestOf(method)).filter(Boolean);
  if (!lines.length) return emptyChart(box, "Nothing was scored here.");
  const width = Math.max(280, box.clientWidth), narrow = width < 560;
  const labelSize = 15, height = Math.max(300, (lines.length + 1) * labelSize + TOP + BOTTOM + 30);
  const [svg] = canvasFor(box, height, `${chosen.title} of each frame in ${scene.id}`);
  const longest = Math.max(...lines.map(({ label }) => textWidth(svg, label)));
  const right = Math.min(longest + 26, width * (narrow ? 0.46 : 0.4));
  const floorValues = scene.floor[key()] ?? [], floor = mean(floorValues);
  const y = errorAxis(lines.flatMap(({ values }) => values), floor, chosen.higher, height - BOTTOM, TOP);
  const [first, last] = [scene.frames[0], scene.frames.at(-1)];
  const x = axis(first - 0.5, last + 0.5, LEFT, width - right, false);
  x.ticks = x.ticks.filter((tick) => Number.isInteger(tick));
  const noise = noiseFloor(svg, y, floor, chosen.higher, width, height, right);
  frameOf(svg, x, y, width, height, right, scene.sequences.every(Boolean) ? "frame of the path" : "frame; a still is a point", `${chosen.title}, ${chosen.higher ? "higher" : "lower"} is better`);
  const here = draw("line", { id: "along-here", y1: TOP, y2: height - BOTTOM, stroke: "var(--ink)", "stroke-width": 1.2 });
  svg.append(here);
  const ends = [];
  for (const { method, label, values } of lines) {
    const style = look(method);
    let path = "", end = null;
    values.forEach((value, at) => {
      if (!finite(value)) return;
      const spot = [x.at(scene.frames[at]), y.at(value)];
      const still = scene.sequences[at] === "";
      const follows = !still && at > 0 && finite(values[at - 1]) && scene.sequences[at] === scene.sequences[at - 1];
      path += `${follows ? "L" : "M"}${spot[0].toFixed(1)} ${spot[1].toFixed(1)}`;
      end = spot;
      if (still || at % Math.max(1, Math.ceil(values.length / 8)) === 0) svg.append(marker(style.marker, ...spot, 3.4, { fill: style.colour }));
    });
    svg.append(draw("path", { d: path, fill: "none", stroke: style.colour, "stroke-width": 1.5, "stroke-dasharray": style.dash }));
    if (end) ends.push({ label, y: end[1], colour: style.colour });
  }
  if (noise) ends.push({ label: noise.text, y: noise.y, colour: "var(--faint)" });
  const edge = width - right;
  spread(ends.map((end) => end.y), labelSize, TOP + 4, height - BOTTOM - 4).forEach((at, number) => {
    const { label, y: from, colour } = ends[number];
    svg.append(draw("line", { x1: edge + 2, x2: edge + 14, y1: from, y2: at, stroke: colour }));
    const node = draw("text", { class: "name", x: edge + 17, y: at + 4 }, label);
    svg.append(node);
    fitText(node, right - 19);
  });
  svg.addEventListener("click", (event) => {
    const bounds = svg.getBoundingClientRect(), across = (event.clientX - bounds.left) * width / bounds.width;
    const frame = first - 0.5 + (across - LEFT) / (edge - LEFT) * (last - first + 1);
    const near = scene.frames.reduce((a, b) => Math.abs(b - frame) < Math.abs(a - frame) ? b : a);
    if (across >= LEFT && across <= edge) setFrame(scene.frames.indexOf(near));
  });
  svg.markFrame = () => { const at = x.at(scene.frames[view.frame]); here.setAttribute("x1", at); here.setAttribute("x2", at); };
  svg.markFrame();
  $("along-note").textContent = `${scene.id}; the best setting of each method in this room. The upright line is the frame shown below; click to go to another.`;
}

function bestOf(method) {
  const found = data.entries.map((entry, at) => ({ entry, at })).filter(({ entry }) =>
    entry.method === method && entry.track === state.track && (state.machine === "" || entry.machine === state.machine)
  ).flatMap(({ entry, at }) => {
    const own = doneIn(at, view.scene).map((result) => result.series[key()]).filter(Boolean);
    if (!own.length) return [];
    const values = own[0].map((_, frame) => mean(own.map((series) => series[frame])));
    return finite(mean(values)) ? [{ method, label: entry.label, values, mean: mean(values) }] : [];
  });
  const higher = metricOf(state.metric).higher;
  return found.length ? found.reduce((a, b) => (higher ? b.mean > a.mean : b.mean < a.mean) ? b : a) : null;
}

function textWidth(svg, text) {
  const node = draw("text", { class: "name" }, text);
  svg.append(node);
  const { width } = node.getBBox();
  node.remove();
  return width;
}

function fitText(node, room) {
  const whole = node.textContent;
  for (let length = whole.length; length > 3 && node.getBBox().width > room; length--) node.textContent = `${whole.slice(0, length - 1)}…`;
  if (node.textContent !== whole) node.append(draw("title", {}, whole));
}

function showStages() {
  const list = data.entries.filter((entry) => entry.track === state.track && (state.machine === "" || entry.machine === state.machine) && finite(entry.costs.ms));
  const order = data.stages.filter((stage) => list.some((entry) => stage in entry.stages));
  // Machine by machine, the quickest first.
  list.sort((a, b) => data.machines.indexOf(a.machine) - data.machines.indexOf(b.machine) || a.costs.ms - b.costs.ms);
  const table = $("stages");
  table.tHead.replaceChildren(make("tr", {}, make("th", { scope: "col" }, "Method"), ...(severalMachines ? [make("th", { scope: "col" }, "Machine")] : []),
    ...order.map((stage) => make("th", { scope: "col" }, stage)), make("th", { scope: "col" }, "frame")));
  table.tBodies[0].replaceChildren(...list.map((entry) => {
    const total = Math.max(entry.costs.ms, Object.values(entry.stages).reduce((sum, value) => sum + value, 0));
    return make("tr", {}, make("th", { scope: "row" }, entry.label), ...(severalMachines ? [make("td", { class: "small" }, entry.machine)] : []), ...order.map((stage) => {
      const value = entry.stages[stage];
      if (!finite(value)) return make("td", {});
      return make("td", {}, make("span", { class: "bar", style: `width:${(3.6 * value / total).toFixed(2)}rem` }), number(value));
    }), make("td", { class: "best" }, number(entry.costs.ms)));
  }));
}

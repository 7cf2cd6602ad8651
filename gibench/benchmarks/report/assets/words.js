// Numbers and elements: how values are written, and how nodes are made.
const data = JSON.parse(document.getElementById("data").textContent);
const $ = (id) => document.getElementById(id);
const MISSING = "–";
const finite = (value) => typeof value === "number" && Number.isFinite(value);

// Three significant digits, without an exponent between 1e-4 and 1e6; as wording.py writes them.
function number(value, digits = 3) {
  if (!finite(value)) return MISSING;
  if (value === 0) return "0";
  const size = Math.floor(Math.log10(Math.abs(Number(value.toExponential(digits - 1)))));
  const text = size <= -5 || size >= 6 ? value.toExponential(digits - 1) : value.toFixed(Math.max(0, digits - 1 - size));
  return text.replace("-", "−");
}

function short(value) {
  const text = number(value);
  return text.includes(".") && !text.includes("e") ? text.replace(/\.?0+$/, "") : text;
}

function seconds(value) {
  if (!finite(value)) return MISSING;
  if (value >= 3600) return `${number(value / 3600)} h`;
  return value >= 60 ? `${number(value / 60)} min` : `${number(value)} s`;
}

function bytes(value) {
  if (!finite(value)) return MISSING;
  for (const [size, unit] of [[1e9, "GB"], [1e6, "MB"], [1e3, "kB"]]) if (value >= size) return `${number(value / size)} ${unit}`;
  return `${value.toFixed(0)} B`;
}

// Makes an element: attributes (functions become listeners), then children (texts or nodes).
function make(name, attributes = {}, ...children) {
  const node = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (typeof value === "function") node.addEventListener(key, value);
    else if (value !== null && value !== false) node.setAttribute(key, value === true ? "" : value);
  }
  node.append(...children.filter((child) => child !== null && child !== ""));
  return node;
}

function draw(name, attributes = {}, ...children) {
  const node = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  node.append(...children);
  return node;
}

function options(select, pairs, chosen) {
  select.replaceChildren(...pairs.map(([value, text]) => make("option", { value }, text)));
  select.value = pairs.some(([value]) => value === chosen) ? chosen : pairs[0]?.[0] ?? "";
  return select.value;
}

function mean(values) {
  const known = values.filter(finite);
  return known.length ? known.reduce((sum, value) => sum + value, 0) / known.length : null;
}

const metricOf = (name) => data.metrics.find((metric) => metric.name === name);
const methods = [...new Set(data.entries.map((entry) => entry.method))];
const MARKERS = ["circle", "square", "up", "diamond", "down", "plus", "cross", "pentagon"];
const DASHES = ["", "6 2", "1.5 2", "6 2 1.5 2", "10 3"];
// Colour, marker and dashes of a method, as plot_style.py chooses them.
function look(method) {
  const at = methods.indexOf(method);
  return { colour: `var(--c${at % 7})`, marker: MARKERS[at % MARKERS.length], dash: DASHES[at % DASHES.length] };
}

function marker(shape, x, y, size, attributes) {
  const corner = (turns, radius = size) => turns.map((turn) => {
    const angle = turn * 2 * Math.PI - Math.PI / 2;
    return `${(x + radius * Math.cos(angle)).toFixed(2)},${(y + radius * Math.sin(angle)).toFixed(2)}`;
  }).join(" ");
  const arm = size * 0.38;
  const plus = [[-arm, -size], [arm, -size], [arm, -arm], [size, -arm], [size, arm], [arm, arm], [arm, size], [-arm, size], [-arm, arm], [-size, arm], [-size, -arm], [-arm, -arm]];
  const turned = (points, angle) => points.map(([a, b]) => `${(x + a * Math.cos(angle) - b * Math.sin(angle)).toFixed(2)},${(y + a * Math.sin(angle) + b * Math.cos(angle)).toFixed(2)}`).join(" ");
  const points = {
    square: () => turned([[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([a, b]) => [a * size * 0.85, b * size * 0.85]), 0),
    up: () => corner([0, 1 / 3, 2 / 3], size * 1.15),
    diamond: () => corner([0, 0.25, 0.5, 0.75], size * 1.15),
    down: () => corner([0.5, 5 / 6, 1 / 6], size * 1.15),
    plus: () => turned(plus, 0),
    cross: () => turned(plus, Math.PI / 4),
    pentagon: () => corner([0, 0.2, 0.4, 0.6, 0.8], size * 1.1),
  }[shape];
  return points ? draw("polygon", { points: points(), ...attributes }) : draw("circle", { cx: x, cy: y, r: size * 0.9, ...attributes });
}

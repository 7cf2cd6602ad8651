// The leaderboard: what a row says of a setting under the chosen track, room, part, metric and machine.
const state = { track: data.tracks[0], scene: "", part: data.parts[0], metric: null, machine: "", sort: { key: "mean", down: false }, cost: "ms", training: "seconds" };
const severalMachines = data.machines.length > 1;
const TIMED = ["ms", "p95", "prepare"];
const resultsOf = new Map(data.entries.map((_, at) => [at, []]));
data.results.forEach((result) => resultsOf.get(result.entry).push(result));

const key = () => `${state.part}/${state.metric}`;
const sceneNumber = (id) => data.scenes.findIndex((scene) => scene.id === id && scene.track === state.track);
const doneIn = (entry, scene) => resultsOf.get(entry).filter((result) => result.scene === scene && result.reason === null);

// Each setting of the track and machine with its numbers; in one room they come from that room's frames.
function rows() {
  const scene = state.scene === "" ? null : sceneNumber(state.scene);
  return data.entries.map((entry, at) => ({ entry, at })).filter(({ entry }) =>
    entry.track === state.track && (state.machine === "" || entry.machine === state.machine)
  ).map(({ entry, at }) => {
    const row = { at, entry, label: entry.label, family: entry.family, whole: entry.failed_rooms === 0 };
    if (scene === null) {
      const [value, low, high, floor, difference, differenceLow, differenceHigh, verdict, rooms, left] = entry.scores[key()] ?? [];
      return { ...row, mean: value, low, high, floor, difference, differenceLow, differenceHigh, verdict, rooms: rooms ?? 0, left: left ?? 0, ...entry.costs };
    }
    const done = doneIn(at, scene);
    const cost = (name) => mean(done.map((result) => result.costs[name]));
    const failed = resultsOf.get(at).some((result) => result.reason !== null && result.room === state.scene);
    return {
      ...row, mean: mean(done.map((result) => valueIn(result))), whole: !failed, rooms: done.length ? 1 : 0, left: 0,
      floor: mean(data.scenes[scene].floor[key()] ?? []),
      ms: cost("ms"), p95: cost("p95"), prepare: cost("prepare"), bytes: cost("bytes"), peak: cost("peak"),
    };
  });
}

const valueIn = (result) => metricOf(state.metric)?.inTime ? result.inTime[key()] : mean(result.series[key()] ?? []);

function columns() {
  const chosen = metricOf(state.metric);
  const found = [{ key: "label", title: "Method", text: true }];
  if (severalMachines) found.push({ key: "machine", title: "Machine", text: true });
  found.push({ key: "mean", title: chosen?.title ?? "Error", best: chosen?.higher });
  if (state.scene === "") found.push({ key: "low", title: "95 % interval" });
  if (data.against !== null && state.scene === "") found.push({ key: "difference", title: `Against ${data.against}` });
  found.push(
    { key: "ms", title: "ms / frame" }, { key: "p95", title: "95th pct." }, { key: "prepare", title: "Preparation" },
    { key: "bytes", title: "On disk" }, { key: "peak", title: "Peak memory" }, { key: "rooms", title: "Rooms" },
    { key: "family", title: "Family", text: true },
  );
  return found;
}

function sorted(list) {
  const { key: by, down } = state.sort;
  const text = ["label", "family", "machine"].includes(by);
  const value = (row) => by === "machine" ? row.entry.machine : row[by];
  return list.slice().sort((a, b) => {
    // Times of two machines are never ranked against each other.
    if (TIMED.includes(by) && severalMachines && a.entry.machine !== b.entry.machine) {
      return data.machines.indexOf(a.entry.machine) - data.machines.indexOf(b.entry.machine);
    }
    const [first, second] = [value(a), value(b)];
    if (text) return (down ? -1 : 1) * String(first).localeCompare(String(second), "en", { numeric: true });
    if (!finite(first) || !finite(second)) return finite(second) - finite(first); // what has no number comes last
    return (down ? -1 : 1) * (first - second);
  });
}

function showBoard() {
  const table = $("board"), chosen = metricOf(state.metric), list = sorted(rows());
  const head = columns().map((column) => make("th", {
    scope: "col",
    "aria-sort": state.sort.key === column.key ? (state.sort.down ? "descending" : "ascending") : "none",
  }, make("button", { type: "button", "data-key": column.key, click: () => sortBy(column) }, column.title)));
  const focused = document.activeElement?.dataset?.key;
  table.tHead.replaceChildren(make("tr", {}, ...head));
  if (focused) table.tHead.querySelector(`[data-key="${focused}"]`)?.focus();
  const comparable = list.filter((row) => finite(row.mean) && row.whole);
  const best = (chosen?.higher ? Math.max : Math.min)(...comparable.map((row) => row.mean));
  table.tBodies[0].replaceChildren(...list.map((row) => boardRow(row, row.whole && row.mean === best)));
  table.caption.textContent = `${chosen?.title ?? ""} by method`;
  const where = state.scene === "" ? "means over rooms" : `means over the frames of ${state.scene}`;
  const left = list.filter((row) => row.left).length;
  const floor = mean(list.map((row) => row.floor));
  $("board-note").textContent = chosen
    ? `${chosen.title}, ${chosen.higher ? "higher" : "lower"} is better; ${where}. ` +
      (finite(floor) ? `Noise floor of the reference: ${number(floor)}.` : "The noise floor of the reference is not known here.") +
      (left ? ` ${left} rows leave out frames without a finite value.` : "")
    : "Nothing was scored.";
}

function boardRow(row, best) {
  const cells = columns().map(({ key: name }) => {
    switch (name) {
      case "label": return make("th", { scope: "row", title: row.entry.title }, mark(row.entry), row.label);
      case "machine": return make("td", { class: "words small" }, row.entry.machine);
      case "mean": return row.rooms || finite(row.mean)
        ? make("td", { class: best ? "best" : null }, number(row.mean))
        : make("td", {}, row.whole ? MISSING : make("a", { href: "#failed" }, "failed"));
      case "low": return make("td", { class: "small" }, finite(row.low) ? `${number(row.low)} … ${number(row.high)}` : MISSING);
      case "difference": return differenceCell(row);
      case "ms": case "p95": return make("td", {}, number(row[name]));
      case "prepare": return make("td", {}, seconds(row.prepare));
      case "bytes": return make("td", {}, bytes(row.bytes));
      case "peak": return make("td", {}, bytes(finite(row.peak) ? row.peak * 1e6 : null));
      case "rooms": return make("td", {}, state.scene === "" && row.entry.failed_rooms
        ? make("a", { href: "#failed", title: "It failed in the others" }, `${row.rooms} of ${row.rooms + row.entry.failed_rooms}`)
        : String(row.rooms));
      case "family": return make("td", { class: "words small" }, row.family);
    }
  });
  return make("tr", { class: row.rooms ? null : "failed", "data-label": row.label }, ...cells);
}

function differenceCell(row) {
  if (!finite(row.difference) || row.label === data.against) return make("td", { class: "small" }, MISSING);
  const sign = row.difference > 0 ? "+" : "";
  return make("td", { title: `95 %: ${number(row.differenceLow)} … ${number(row.differenceHigh)}` },
    `${sign}${number(row.difference)} `, make("span", { class: "small verdict" }, row.verdict ?? ""));
}

function mark(entry) {
  const style = look(entry.method);
  return draw("svg", { class: "mark", viewBox: "-8 -8 16 16", "aria-hidden": "true" }, marker(style.marker, 0, 0, 6.5, { fill: style.colour }));
}

function sortBy(column) {
  const down = state.sort.key === column.key ? !state.sort.down : Boolean(column.best);
  state.sort = { key: column.key, down };
  showBoard();
  $("sorted").textContent = `Sorted by ${column.title}, ${down ? "descending" : "ascending"}`;
}

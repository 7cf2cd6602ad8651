// Held-out error against training time or steps, a line a training; a panel a method, because each measures its own.
const AGAINST = { seconds: "seconds of training, looks included", steps: "steps of training" };

function showTraining() {
  const ofTrackHere = data.trainings.filter((one) => one.track === state.track);
  $("training").hidden = !ofTrackHere.length;
  if (!ofTrackHere.length) return;
  const box = $("training-charts"), say = (text) => { box.replaceChildren(make("p", { class: "note" }, text)); };
  if (severalMachines && state.machine === "" && state.training === "seconds") {
    return say("Choose one machine above: times of different machines are not comparable.");
  }
  const shown = ofTrackHere.filter((one) => (state.machine === "" || one.machine === state.machine) && (state.scene === "" || one.scenes.includes(state.scene)));
  if (!shown.length) return say("No method was trained for this.");
  const families = [...new Set(shown.map((one) => one.family))], range = trainingRange(shown);
  box.replaceChildren(...families.map((family) => make("figure", {}, make("figcaption", { class: "note" }), make("div", { class: "chart" }))));
  const labels = families.map((family) => [...new Set(shown.filter((one) => one.family === family).map((one) => one.name))]);
  const [probe, width] = canvasFor(box.querySelector(".chart"), 1, ""), several = labels.filter((own) => own.length > 1).flat();
  // One margin for all panels, so that their times stand below each other.
  const right = several.length ? Math.min(Math.max(...several.map((name) => textWidth(probe, name))) + 26, width * 0.4) : 10;
  families.forEach((family, at) => {
    const own = shown.filter((one) => one.family === family), [caption, chart] = box.children[at].children;
    const names = labels[at], title = names.length === 1 ? names[0] : family;
    caption.textContent = `${title}${own.length > 1 ? `, ${own.length} trainings` : ""}: held-out error, its own measure, lower is better`;
    trainingPanel(chart, own, names, range, title, right);
  });
}

// What is untrained stands at 0, a place of its own at the left of the logarithmic axis.
const trainedFor = (one, at) => one.steps[at] > 0 ? one[state.training][at] ?? 0 : 0;

function trainingRange(shown) {
  const known = shown.flatMap((one) => one.steps.map((_, at) => trainedFor(one, at))), positive = known.filter((value) => value > 0);
  if (!positive.length) return { low: 0.5, high: 2, nothing: 1 };
  const low = positive.reduce((a, b) => Math.min(a, b)), high = positive.reduce((a, b) => Math.max(a, b));
  const nothing = positive.length < known.length ? low / Math.max(3, (high / low) ** 0.2) : null;
  const pad = Math.max((high / low) ** 0.07, 1.3);
  return { low: (nothing ?? low) / pad, high: high * pad, nothing };
}

function trainingPanel(box, own, names, range, title, right) {
  const labelSize = 15, height = Math.max(220, names.length * labelSize + TOP + BOTTOM + 30);
  const [svg, width] = canvasFor(box, height, `Held-out error of ${title} against ${AGAINST[state.training]}; training.csv has the numbers`);
  const edge = width - right, errors = own.flatMap((one) => one.errors).filter(finite);
  const y = errors.length ? errorAxis(errors, null, false, height - BOTTOM, TOP) : axis(0, 1, height - BOTTOM, TOP, false);
  if (!errors.length) y.ticks = [];
  const x = axis(range.low, range.high, LEFT, edge, true);
  if (range.nothing !== null) {
    x.ticks = [range.nothing, ...x.ticks.filter((tick) => tick > 1.5 * range.nothing)];
    x.name = (tick) => tick === range.nothing ? "0" : short(tick);
  }
  frameOf(svg, x, y, width, height, right, AGAINST[state.training], "");
  for (const one of own) trainingLine(svg, one, own, names, x, y, range);
  if (names.length < 2) return;
  const ends = names.map((name) => {
    const last = own.filter((one) => one.name === name).map((one) => one.errors.filter(finite).at(-1)).filter(finite);
    return { name, y: last.length ? y.at(mean(last)) : TOP, colour: look(own.find((one) => one.name === name).method).colour };
  });
  spread(ends.map((end) => end.y), labelSize, TOP + 4, height - BOTTOM - 4).forEach((at, number) => {
    const { name, y: from, colour } = ends[number], node = draw("text", { class: "name", x: edge + 17, y: at + 4 }, name);
    svg.append(draw("line", { x1: edge + 2, x2: edge + 14, y1: from, y2: at, stroke: colour }), node);
    fitText(node, right - 19);
  });
}

function trainingLine(svg, one, own, names, x, y, range) {
  const style = look(one.method), several = own.filter((other) => other.name === one.name).length > 1;
  const alike = names.filter((name) => own.some((other) => other.name === name && other.method === one.method));
  const spots = one.steps.map((_, at) => [x.at(trainedFor(one, at) || range.nothing), finite(one.errors[at]) ? y.at(one.errors[at]) : null]);
  let path = "";
  spots.forEach(([across, up], at) => {
    if (up === null) return svg.append(draw("path", { d: `M${across - 3} ${TOP - 3}l6 6m0 -6l-6 6`, stroke: style.colour, "stroke-width": 1.2 }));
    const joins = at > 0 && spots[at - 1][1] !== null;
    path += `${joins ? "L" : "M"}${across.toFixed(1)} ${up.toFixed(1)}`;
    // Between two that are not finite a look has no line.
    if (!joins && (at + 1 >= spots.length || spots[at + 1][1] === null)) svg.append(draw("circle", { cx: across, cy: up, r: 1.5, fill: style.colour }));
  });
  svg.append(draw("path", { d: path, fill: "none", stroke: style.colour, "stroke-width": several ? 0.9 : 1.5, "stroke-opacity": several ? 0.75 : 1, "stroke-dasharray": DASHES[alike.indexOf(one.name) % DASHES.length] }));
  if (one.best === null) return;
  const shape = marker(style.marker, ...spots[one.best], several ? 3.2 : 4.5, { fill: style.colour });
  shape.append(draw("title", {}, `${one.name}, ${one.scenes.length === 1 ? one.scenes[0] : `${one.scenes.length} rooms`}, seed ${one.seed}: ${number(one.errors[one.best])} after ${number(one.steps[one.best])} steps, ${seconds(one.seconds[one.best])}`));
  svg.append(shape);
}

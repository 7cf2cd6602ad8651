// Where labels go, so that none lies on another: the same search as labels.py.
const NEAR = 13, RINGS = [8, 10, 13, 18, 24, 34, 46, 60, 80, 105, 135, 170, 210, 250, 290, 330, 370, 410, 450, 490];
const meets = (a, b, gap = 0) => a.left < b.right + gap && b.left < a.right + gap && a.top < b.bottom + gap && b.top < a.bottom + gap;
const nearest = (box, x, y) => [Math.min(Math.max(x, box.left), box.right), Math.min(Math.max(y, box.top), box.bottom)];

function crosses([x0, y0, x1, y1], box) {
  let start = 0, end = 1;
  for (const [step, room] of [[x0 - x1, x0 - box.left], [x1 - x0, box.right - x0], [y0 - y1, y0 - box.top], [y1 - y0, box.bottom - y0]]) {
    if (step === 0) { if (room < 0) return false; continue; }
    if (step < 0) start = Math.max(start, room / step); else end = Math.min(end, room / step);
    if (start > end) return false;
  }
  return true;
}

// labels: { x, y, width, height, required }; gives a box for each, or null where there was no room.
function place(labels, obstacles, bounds) {
  const placed = labels.map(() => null), taken = [], lines = [];
  const order = labels.map((_, at) => at).sort((a, b) => labels[b].required - labels[a].required || labels[a].x - labels[b].x);
  for (const at of order) {
    const { x, y, width, height, required } = labels[at];
    let best = null, cost = Infinity, bestRing = 0;
    for (const ring of RINGS) {
      if (ring >= cost || (!required && ring > NEAR)) break;
      for (let turn = 0; turn < 24; turn++) {
        const across = Math.cos(turn * Math.PI / 12), down = Math.sin(turn * Math.PI / 12);
        const left = x + ring * across + (across - 1) / 2 * width, top = y + ring * down + (down - 1) / 2 * height;
        const box = { left, top, right: left + width, bottom: top + height };
        if (box.left < bounds.left || box.right > bounds.right || box.top < bounds.top || box.bottom > bounds.bottom) continue;
        if (taken.some((other) => meets(box, other, 1.5))) continue;
        const covered = obstacles.filter((other) => meets(box, other)).length;
        let crossed = lines.filter((line) => crosses(line, box)).length;
        if (ring > NEAR) crossed += taken.filter((other) => crosses([x, y, ...nearest(box, x, y)], other)).length;
        if (covered + crossed && !required) continue;
        const price = ring + 25 * covered + 60 * crossed;
        if (price < cost) { best = box; cost = price; bestRing = ring; }
      }
    }
    if (!best) continue;
    placed[at] = best;
    taken.push(best);
    if (bestRing > NEAR) { best.line = [x, y, ...nearest(best, x, y)]; lines.push(best.line); }
  }
  return placed;
}

// Moves positions as little as can be until they are `size` apart and within [low, high].
function spread(wanted, size, low, high) {
  const step = Math.min(size, (high - low) / Math.max(1, wanted.length - 1));
  const order = wanted.map((_, at) => at).sort((a, b) => wanted[a] - wanted[b]);
  const blocks = [];
  order.forEach((at, rank) => {
    let value = wanted[at] - rank * step, count = 1;
    while (blocks.length && blocks.at(-1).value > value) {
      const last = blocks.pop();
      value = (value * count + last.value * last.count) / (count + last.count);
      count += last.count;
    }
    blocks.push({ value, count });
  });
  const result = [];
  let rank = 0;
  for (const { value, count } of blocks) {
    const base = Math.min(Math.max(value, low), high - (wanted.length - 1) * step);
    for (let number = 0; number < count; number++, rank++) result[order[rank]] = base + rank * step;
  }
  return result;
}

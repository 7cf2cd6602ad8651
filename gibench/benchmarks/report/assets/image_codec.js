// Images: loaded one by one when they are looked at, unpacked, and drawn under any exposure. image_files.py packs them.
const arrived = new Map(); // name → function that takes what the file holds
const kept = new Map(); // name → { promise of { width, height, channels, codes }, bytes }, least recently used first
let keptBytes = 0;
const MOST_BYTES = 256e6;

// Files beside the page call this. A classic script is what a page on disk may load from disk.
window.gibenchImage = (name, width, height, channels, text) => arrived.get(name)?.(width, height, channels, text);

function image(name) {
  const known = kept.get(name) ?? { promise: load(name), bytes: 0 };
  if (!kept.delete(name)) {
    known.promise.then((found) => { known.bytes = found.codes.byteLength; keptBytes += known.bytes; forget(name); }, () => kept.delete(name));
  }
  kept.set(name, known);
  return known.promise;
}

function forget(newest) {
  for (const [name, old] of kept) {
    if (keptBytes <= MOST_BYTES || name === newest) return;
    if (!old.bytes) continue;
    keptBytes -= old.bytes;
    kept.delete(name);
  }
}

function load(name) {
  return new Promise((resolve, reject) => {
    const script = make("script", { src: name });
    const end = (act) => { arrived.delete(name); script.remove(); act(); };
    arrived.set(name, (width, height, channels, text) => {
      end(() => unpack(width, height, channels, text).then((codes) => resolve({ width, height, channels, codes }), reject));
    });
    script.onerror = () => end(() => reject(new Error(`${name} is missing`)));
    document.head.append(script);
  });
}

async function unpack(width, height, channels, text) {
  const packed = Uint8Array.from(atob(text), (sign) => sign.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const content = new Uint8Array(await new Response(stream).arrayBuffer());
  const size = width * height;
  const codes = new Int16Array(size * channels); // plane by plane
  let large = size * channels; // where numbers of two bytes begin
  for (let channel = 0; channel < channels; channel++) {
    const base = channel * size;
    for (let row = 0; row < height; row++) {
      for (let column = 0; column < width; column++) {
        const at = base + row * width + column;
        let coded = content[at];
        if (coded === 255) { coded = content[large] | (content[large + 1] << 8); large += 2; }
        const rest = coded & 1 ? -((coded + 1) >> 1) : coded >> 1;
        let guess = 0;
        if (row && column) {
          const left = codes[at - 1], above = codes[at - width], both = codes[at - width - 1];
          const low = Math.min(left, above), high = Math.max(left, above);
          guess = both >= high ? low : both <= low ? high : left + above - both;
        } else if (column) guess = codes[at - 1];
        else if (row) guess = codes[at - width];
        codes[at] = guess + rest;
      }
    }
  }
  if (channels === 3) for (let at = 0; at < size; at++) { codes[at] += codes[size + at]; codes[2 * size + at] += codes[size + at]; }
  return codes;
}

// Byte on the display of each code, under an exposure in f-stops: IEC 61966-2-1, as gibench.metrics.tone_map.
function displayTable(stops) {
  return Uint8ClampedArray.from({ length: 1024 }, (_, code) => {
    const value = Math.min(1, data.code.toe * (2 ** (code / data.code.stepsPerStop) - 1) * 2 ** stops);
    return 255 * (value <= 0.0031308 ? 12.92 * value : 1.055 * value ** (1 / 2.4) - 0.055);
  });
}

function paint(canvas, found, stops) {
  const { width, height, codes } = found, size = width * height, table = displayTable(stops);
  const context = sized(canvas, width, height), picture = context.createImageData(width, height), pixels = picture.data;
  for (let at = 0, to = 0; at < size; at++) {
    pixels[to++] = table[codes[at]];
    pixels[to++] = table[codes[size + at]];
    pixels[to++] = table[codes[2 * size + at]];
    pixels[to++] = 255;
  }
  context.putImageData(picture, 0, 0);
}

const magma = Uint8Array.from(atob(data.magma), (sign) => sign.charCodeAt(0));

// Error 0 … 255, shown from 0 to `range` of the whole scale.
function paintError(canvas, found, range) {
  const { width, height, codes } = found;
  const context = sized(canvas, width, height), picture = context.createImageData(width, height), pixels = picture.data;
  for (let at = 0, to = 0; at < codes.length; at++) {
    const from = 3 * Math.min(255, Math.round(codes[at] / range));
    pixels[to++] = magma[from];
    pixels[to++] = magma[from + 1];
    pixels[to++] = magma[from + 2];
    pixels[to++] = 255;
  }
  context.putImageData(picture, 0, 0);
}

function sized(canvas, width, height) {
  if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
  return canvas.getContext("2d");
}

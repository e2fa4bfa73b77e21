// Drawing on canvases. Every function takes what is to be drawn and keeps nothing.

export function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

// four digits for a person
export function number(value) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value !== 0 && (Math.abs(value) >= 1e5 || Math.abs(value) < 1e-3)) {
    const [factor, exponent] = value.toExponential(2).split("e");
    return `${factor}·10${raised(Number(exponent))}`;
  }
  return String(Number(value.toPrecision(4)));
}

// sharp on every screen; the size follows the page
function context(canvas) {
  const scale = window.devicePixelRatio || 1;
  const width = canvas.clientWidth, height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * scale) || canvas.height !== Math.round(height * scale)) {
    canvas.width = Math.round(width * scale);
    canvas.height = Math.round(height * scale);
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  pen.clearRect(0, 0, width, height);
  pen.font = "11px 'DejaVu Sans', 'Segoe UI', Roboto, sans-serif";
  pen.lineWidth = 1;
  return { pen, width, height };
}

function padded(low, high) {
  if (!(high > low)) {
    const half = Math.abs(low) * 0.05 || 1;
    return [low - half, low + half];
  }
  return [low - 0.06 * (high - low), high + 0.06 * (high - low)];
}

function ticks(low, high, n) {
  const raw = (high - low) / Math.max(1, n);
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((k) => k * power).find((candidate) => candidate >= raw);
  const found = [];
  for (let k = Math.ceil(low / step); k * step <= high * (1 + 1e-12) + 1e-300; k += 1) {
    if (k * step <= high) found.push(k * step);
  }
  return found;
}

function logTicks(low, high) {
  const found = [];
  for (let power = Math.ceil(Math.log10(low) - 1e-9); 10 ** power <= high * (1 + 1e-9); power += 1) found.push(10 ** power);
  const every = Math.max(1, Math.ceil(found.length / 6));
  return found.filter((_, k) => k % every === 0);
}

function raised(exponent) {
  return String(exponent).replace(/-/, "⁻").replace(/\d/g, (digit) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[digit]);
}

function power(value) {
  const exponent = Math.round(Math.log10(value));
  return exponent >= -2 && exponent <= 4 ? String(Number((10 ** exponent).toPrecision(1))) : `10${raised(exponent)}`;
}

// Text with bars over its letters, begun at its upper left corner. Many fonts have no macron to put over a letter, and
// where they have one it is three pixels wide at this size; so the bar is drawn, as wide as its letter.
function barred(pen, text, x, y) {
  const [first, ...others] = text.split("\u0304");
  let at = x, part = first;
  for (const next of others) {
    const begin = at + pen.measureText(part.slice(0, -1)).width, end = at + pen.measureText(part).width;
    pen.fillText(part, at, y);
    pen.fillRect(begin + 1, Math.round(y) - 2, end - begin - 2, 1);
    at = end;
    part = next;
  }
  pen.fillText(part, at, y);
}

// a frame with axes; returns how values become places
function axes(canvas, box) {
  const { pen, width, height } = context(canvas);
  const texts = box.yTicks.map((value) => (box.logarithmic ? power(value) : number(value)));
  const left = 8 + Math.max(...texts.map((text) => pen.measureText(text).width), 12);
  const bottom = height - (box.xLabel ? 32 : 17), top = box.yLabel ? 21 : 6, right = width - 8;
  const of = (value) => (box.logarithmic ? Math.log10(value) : value);
  const x = (value) => left + ((of(value) - of(box.x[0])) / (of(box.x[1]) - of(box.x[0]))) * (right - left);
  const y = (value) => bottom - ((of(value) - of(box.y[0])) / (of(box.y[1]) - of(box.y[0]))) * (bottom - top);
  pen.strokeStyle = colour("line");
  pen.fillStyle = colour("soft");
  pen.textBaseline = "middle";
  pen.textAlign = "right";
  box.yTicks.forEach((value, k) => {
    pen.beginPath();
    pen.moveTo(left, y(value));
    pen.lineTo(right, y(value));
    pen.stroke();
    pen.fillText(texts[k], left - 4, y(value));
  });
  pen.textAlign = "center";
  pen.textBaseline = "top";
  for (const value of box.xTicks) {
    pen.beginPath();
    pen.moveTo(x(value), top);
    pen.lineTo(x(value), bottom);
    pen.stroke();
    const text = box.logarithmic ? power(value) : number(value);
    const half = pen.measureText(text).width / 2;
    pen.fillText(text, Math.min(x(value), right - half + 6), bottom + 3);
  }
  if (box.xLabel) pen.fillText(box.xLabel, (left + right) / 2, bottom + 17);
  pen.textAlign = "left";
  if (box.yLabel) barred(pen, box.yLabel, 2, 5);
  return { pen, x, y, left, right, top, bottom };
}

// an envelope over time: columns {t, low, high}, null where nothing arrived
export function curve(canvas, columns, columnS, now, windowS, marks) {
  const known = columns.filter((column) => column.low !== null);
  const y = known.length
    ? padded(Math.min(...known.map((c) => c.low)), Math.max(...known.map((c) => c.high)))
    : [-1, 1];
  const x = [now - windowS, now];
  const drawn = axes(canvas, { x, y, xTicks: ticks(x[0], x[1], 5).filter((t) => t >= 0), yTicks: ticks(y[0], y[1], 4) });
  const { pen, left, right, top, bottom } = drawn;
  pen.save();
  pen.beginPath();
  pen.rect(left, top, right - left, bottom - top);
  pen.clip();
  pen.fillStyle = colour("lost");
  for (const [from, to] of gaps(columns, columnS, now)) {
    pen.fillRect(drawn.x(from), top, Math.max(1, drawn.x(to) - drawn.x(from)), bottom - top);
  }
  pen.strokeStyle = colour("curve");
  pen.fillStyle = colour("curve");
  pen.lineWidth = 1.2;
  pen.beginPath();
  const wide = Math.max(1, drawn.x(columnS) - drawn.x(0));
  let before = null;
  for (const column of columns) {
    if (column.low === null) { before = null; continue; }
    const at = drawn.x(column.t + columnS / 2);
    const high = drawn.y(column.high), low = drawn.y(column.low);
    if (before !== null) { pen.moveTo(before.at, before.middle); pen.lineTo(at, (high + low) / 2); }
    // as wide as the column is: lines of one pixel would make a pattern of their own
    if (low - high > 1) pen.fillRect(at - wide / 2, high, wide, low - high);
    before = { at, middle: (high + low) / 2 };
  }
  pen.stroke();
  pen.strokeStyle = colour("mark");
  pen.lineWidth = 1;
  pen.textBaseline = "top";
  pen.setLineDash([4, 3]);
  for (const mark of marks.filter((one) => one.t >= x[0])) {
    const at = drawn.x(mark.t);
    pen.beginPath();
    pen.moveTo(at, top);
    pen.lineTo(at, bottom);
    pen.stroke();
    const text = mark.text || "mark", width = pen.measureText(text).width;
    const begin = Math.min(at + 3, right - width - 4);
    pen.fillStyle = colour("panel");
    pen.fillRect(begin - 1, top, width + 4, 14);
    pen.fillStyle = colour("mark");
    pen.fillText(text, begin + 1, top + 2);
  }
  pen.restore();
}

// spans without a value after the first one, and up to now where nothing comes any more
export function gaps(columns, columnS, now) {
  const found = [];
  let began = null, isBegun = false;
  for (const column of columns) {
    if (column.low !== null) {
      if (began !== null) found.push([began, column.t]);
      began = null;
      isBegun = true;
    } else if (began === null && (isBegun || column.isLate)) {
      began = column.t;
    }
  }
  const last = columns.length ? columns[columns.length - 1].t + columnS : 0;
  if (began !== null) found.push([began, Math.max(now, last)]);
  else if (isBegun && now - last > Math.max(0.4, 2 * columnS)) found.push([last, now]);
  return found;
}

export function spectrum(canvas, frequency, density, units) {
  const good = frequency.map((f, k) => [f, density[k]]).filter(([f, d]) => f > 0 && d > 0);
  if (!good.length) { context(canvas); return; }
  const y = [Math.min(...good.map(([, d]) => d)), Math.max(...good.map(([, d]) => d))];
  // what lies ten decades below the largest is nothing that was measured
  const low = Math.max(y[0], y[1] * 1e-10);
  const x = [good[0][0], good[good.length - 1][0]];
  const range = [low / 2, y[1] * 2];
  const drawn = axes(canvas, {
    x, y: range, logarithmic: true, xTicks: logTicks(x[0], x[1]), yTicks: logTicks(range[0], range[1]),
    xLabel: "frequency [Hz]", yLabel: `power spectral density [${units}]`,
  });
  line(drawn, good.map(([f, d]) => [f, Math.max(d, low)]), "curve");
}

// cycles, the newest strongest
export function loop(canvas, cycles, xLabel, yLabel) {
  const all = cycles.flat();
  const x = padded(Math.min(...all.map((p) => p[0])), Math.max(...all.map((p) => p[0])));
  const y = padded(Math.min(...all.map((p) => p[1])), Math.max(...all.map((p) => p[1])));
  const drawn = axes(canvas, { x, y, xTicks: ticks(x[0], x[1], 5), yTicks: ticks(y[0], y[1], 5), xLabel, yLabel });
  cycles.forEach((cycle, k) => {
    const isNewest = k === cycles.length - 1;
    drawn.pen.globalAlpha = isNewest ? 1 : 0.15 + (0.5 * (k + 1)) / cycles.length;
    drawn.pen.lineWidth = isNewest ? 2 : 1;
    line(drawn, cycle, isNewest ? "second" : "curve");
  });
  drawn.pen.globalAlpha = 1;
}

// points {x, y, error}, joined
export function trend(canvas, points, xLabel, yLabel) {
  const x = padded(Math.min(...points.map((p) => p.x)), Math.max(...points.map((p) => p.x)));
  const y = padded(Math.min(0, ...points.map((p) => p.y - p.error)), Math.max(...points.map((p) => p.y + p.error)));
  const drawn = axes(canvas, { x, y, xTicks: ticks(x[0], x[1], 5), yTicks: ticks(y[0], y[1], 4), xLabel, yLabel });
  line(drawn, points.map((p) => [p.x, p.y]), "curve");
  drawn.pen.fillStyle = colour("curve");
  for (const point of points) {
    const at = drawn.x(point.x);
    drawn.pen.beginPath();
    drawn.pen.moveTo(at, drawn.y(point.y - point.error));
    drawn.pen.lineTo(at, drawn.y(point.y + point.error));
    drawn.pen.stroke();
    drawn.pen.fillRect(at - 1.5, drawn.y(point.y) - 1.5, 3, 3);
  }
}

function line(drawn, points, name) {
  drawn.pen.strokeStyle = colour(name);
  drawn.pen.beginPath();
  points.forEach(([a, b], k) => (k ? drawn.pen.lineTo(drawn.x(a), drawn.y(b)) : drawn.pen.moveTo(drawn.x(a), drawn.y(b))));
  drawn.pen.stroke();
}

// What comes over the WebSocket, put into the page. Texts of devices are set as text, never as markup.

import * as plots from "./plots.js";

const $ = (id) => document.getElementById(id);
const state = {
  about: null, status: null, now: [], window: 5, curves: new Map(), events: [], analyses: {}, finished: null,
  shown: [], spectrumKey: null, isOver: false,
};
const key = (source, channel) => `${source}:${channel}`;
let socket = null;
let isDue = false;

function element(tag, text = "", className = "") {
  const made = document.createElement(tag);
  made.textContent = text;
  if (className) made.className = className;
  return made;
}

// the same element stays in place as long as its text does, so that nothing flickers under a pointer
function put(node, text, className) {
  if (node.textContent !== text) node.textContent = text;
  if (className !== undefined && node.className !== className) node.className = className;
}

function bytes(n) {
  for (const [unit, size] of [["TB", 1e12], ["GB", 1e9], ["MB", 1e6], ["kB", 1e3]]) {
    if (n >= size) return `${(n / size).toFixed(1)} ${unit}`;
  }
  return `${n} B`;
}

function clock(seconds) {
  const whole = Math.floor(Math.max(0, seconds));
  const parts = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60, whole % 60];
  const text = parts.map((part) => String(part).padStart(2, "0")).join(":");
  return parts[0] ? text : text.slice(3);
}

const grouped = (n) => String(n).replace(/\B(?=(\d{3})+$)/g, " ");

function connect() {
  const folder = location.pathname.replace(/[^/]*$/, "");
  socket = new WebSocket(`ws://${location.host}${folder}live`);
  socket.onmessage = (message) => { take(JSON.parse(message.data)); };
  socket.onclose = () => {
    if (state.isOver) return;
    notice("no connection to the recorder; trying again. The recording does not depend on this page.");
    setTimeout(connect, 1000);
  };
  socket.onopen = () => {
    notice("");
    state.curves.clear();
    state.events = [];
    send({ window: state.window });
    if (state.shown.length) send({ show: state.shown });
  };
}

function send(message) {
  if (socket && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
}

function notice(text) {
  $("notice").hidden = !text;
  put($("notice"), text);
}

function take(message) {
  if (message.about) describe(message.about);
  if (message.status && message.status.sources) state.status = message.status;
  state.now = message.now;
  state.window = message.window;
  for (const curve of message.curves || []) keep(curve);
  if (message.events) state.events.push(...message.events);
  if (message.analyses) state.analyses = message.analyses;
  if (message.finished) state.finished = message.finished;
  state.isOver = state.isOver || message.ended;
  if (!isDue) {
    isDue = true;
    requestAnimationFrame(() => { isDue = false; draw(message); });
  }
}

function describe(about) {
  state.about = about;
  put($("run"), String(about.attributes.run_id || "recording"));
  document.title = `${about.attributes.run_id || "recording"} – sloshlab live`;
  if (!state.shown.length) {
    about.sources.forEach((source, s) => source.channels.forEach((_, c) => state.shown.push([s, c])));
    state.shown = state.shown.slice(0, 8);
  }
  $("windows").replaceChildren(...about.windows.map((seconds) => {
    const button = element("button", seconds < 60 ? `${seconds} s` : `${seconds / 60} min`);
    button.type = "button";
    button.dataset.seconds = seconds;
    button.onclick = () => send({ window: seconds });
    return button;
  }));
  $("spectrum-channel").replaceChildren(...about.sources.flatMap((source, s) => source.channels.map((channel, c) => {
    const option = element("option", channel.name);
    option.value = key(s, c);
    return option;
  })));
  state.spectrumKey = state.spectrumKey || (about.sources.length ? key(0, 0) : null);
  $("spectrum-channel").value = state.spectrumKey;
  layCurves();
  layDevices();
}

function layCurves() {
  $("curves").replaceChildren(...state.shown.map(([s, c]) => {
    const channel = state.about.sources[s].channels[c];
    const box = element("div", "", "curve");
    const title = element("h3", channel.name);
    title.append(element("span", `[${channel.units}]`), element("span", "", "level"), element("span", "", "flag bad"));
    const canvas = element("canvas");
    canvas.setAttribute("role", "img");
    box.dataset.key = key(s, c);
    box.append(title, canvas);
    return box;
  }));
}

function keep(curve) {
  const name = key(curve.source, curve.channel);
  let kept = state.curves.get(name);
  if (!kept || curve.anew) {
    kept = { first: curve.first, low: [], high: [] };
    state.curves.set(name, kept);
  }
  // columns that were skipped while this page was slow
  while (kept.first + kept.low.length < curve.first) { kept.low.push(null); kept.high.push(null); }
  const at = Math.max(0, curve.first - kept.first);
  kept.low.splice(at, curve.low.length, ...curve.low);
  kept.high.splice(at, curve.high.length, ...curve.high);
  const surplus = kept.low.length - 700;
  if (surplus > 0) { kept.low.splice(0, surplus); kept.high.splice(0, surplus); kept.first += surplus; }
}

function draw() {
  drawHead();
  if (!state.about) return;
  for (const button of $("windows").children) {
    button.setAttribute("aria-pressed", String(Number(button.dataset.seconds) === state.window));
  }
  for (const box of $("curves").children) drawCurve(box);
  drawDevices();
  drawEvents();
  drawAnalyses();
}

function drawHead() {
  const status = state.status;
  const ended = state.finished || state.isOver;
  const isLosing = status && status.sources.some((s) => ["disconnected", "silent", "failed"].includes(s.state));
  put($("state"), ended ? "ended" : !status ? "connecting" : status.is_stopping ? "stopping"
    : status.waiting_for ? "waiting for the trigger" : isLosing ? "recording, a device is missing" : "recording",
  `pill ${ended ? "" : isLosing ? "bad" : status && status.waiting_for ? "warn" : "good"}`);
  if (!status) return;
  const lost = status.sources.reduce((sum, source) => sum + source.n_lost, 0);
  const free = status.n_bytes_free;
  figures([
    ["recorded", clock(status.elapsed_s)],
    ...(status.remaining_s === null ? [] : [["left", clock(status.remaining_s)]]),
    ["lost", `${grouped(lost)} samples`, lost ? "bad" : "good"],
    ["on disk", bytes(status.n_bytes_written)],
    ...(free === null || free === undefined ? [] : [["disk left", bytes(free), free < 2 ** 30 ? "bad" : ""]]),
    ...(status.waiting_for ? [["trigger", status.waiting_for]] : []),
    ...(status.n_skipped ? [["not shown here", `${grouped(status.n_skipped)} samples; the recording has them`, "warn"]] : []),
  ]);
  if (state.finished) {
    const flags = state.finished.flags;
    notice(flags.length ? `recording ended: ${flags.join("; ")}` : "");
    $("mark").hidden = true;
  }
}

function figures(rows) {
  const list = $("figures");
  while (list.children.length > rows.length) list.lastChild.remove();
  rows.forEach(([name, text, className], k) => {
    if (!list.children[k]) {
      const row = element("div");
      row.append(element("dt"), element("dd"));
      list.append(row);
    }
    put(list.children[k].children[0], name);
    put(list.children[k].children[1], text, className || "");
  });
}

function drawCurve(box) {
  const [s, c] = box.dataset.key.split(":").map(Number);
  const source = state.about.sources[s];
  const kept = state.curves.get(box.dataset.key) || { first: 0, low: [], high: [] };
  const columnS = source.column_s[String(state.window)];
  const now = state.now[s] || 0;
  const begin = Math.max(0, Math.floor((now - state.window) / columnS) - kept.first);
  const columns = [];
  for (let k = begin; k < kept.low.length; k += 1) {
    columns.push({ t: (kept.first + k) * columnS, low: kept.low[k], high: kept.high[k], isLate: kept.first + begin > 0 });
  }
  const marks = state.events.filter((event) => event.is_mark)
    .map((event) => ({ t: event.t[s], text: event.message.replace(/^mark: ?/, "") }));
  const canvas = box.querySelector("canvas");
  plots.curve(canvas, columns, columnS, now, state.window, marks);
  const of = state.status && state.status.sources[s];
  const level = of && of.levels[c];
  const isGone = of && ["disconnected", "silent", "failed"].includes(of.state);
  if (level) {
    put(box.querySelector(".level"), `RMS ${plots.number(level.rms)}, peak ${plots.number(level.peak)}`);
    put(box.querySelector(".flag"), isGone ? of.state_text : level.clipped_in_window ? "clips" : "");
  }
  canvas.setAttribute("aria-label", `${source.channels[c].name} over the last ${state.window} s`);
}

const COLUMNS = ["channel", "RMS", "peak", "units", "limit", "clipped", "missing"];

function layDevices() {
  $("devices").replaceChildren(...state.about.sources.map((source, s) => {
    const box = element("div", "", "device");
    const table = element("table");
    const head = table.createTHead().insertRow();
    COLUMNS.forEach((name, k) => head.append(element("th", name, k && name !== "units" ? "number" : "")));
    const body = table.createTBody();
    source.channels.forEach((channel, c) => {
      const row = body.insertRow();
      const name = row.insertCell();
      const label = element("label");
      const tick = element("input");
      tick.type = "checkbox";
      tick.checked = state.shown.some(([a, b]) => a === s && b === c);
      tick.title = "show its curve";
      tick.onchange = () => show(s, c, tick);
      label.append(tick, ` ${channel.name}`);
      name.append(label);
      COLUMNS.slice(1).forEach((column) => { row.insertCell().className = column === "units" ? "" : "number"; });
      row.cells[3].textContent = channel.units;
    });
    const scroll = element("div", "", "scroll");
    scroll.append(table);
    box.append(element("p", "", "line"), element("p", "", "troubles bad"), scroll);
    return box;
  }));
}

function show(source, channel, tick) {
  const others = state.shown.filter(([s, c]) => s !== source || c !== channel);
  if (tick.checked && others.length >= state.about.most_shown) { tick.checked = false; return; }
  state.shown = tick.checked ? [...others, [source, channel]].sort((a, b) => a[0] - b[0] || a[1] - b[1]) : others;
  send({ show: state.shown });
  layCurves();
}

function drawDevices() {
  if (!state.status) return;
  state.status.sources.forEach((source, s) => {
    const box = $("devices").children[s];
    if (!box) return;
    const measured = source.measured_rate_hz === null ? "" : `${source.measured_rate_hz.toFixed(1)} of `;
    const drift = source.drift_ppm === null ? ""
      : `, drift ${source.drift_ppm.toFixed(1)} ± ${source.drift_uncertainty_ppm.toFixed(1)} ppm`;
    put(box.querySelector(".line"), `${source.device}: ${source.state_text}, ${grouped(source.n_samples)} samples, `
      + `${measured}${plots.number(source.rate_hz)} Hz, lost ${grouped(source.n_lost)}${drift}, `
      + `buffer ${Math.round(100 * source.queue_fill)} %`);
    const troubles = Object.entries(source.troubles).map(([text, count]) => `${grouped(count)} × ${text}`);
    put(box.querySelector(".troubles"), [...troubles, ...(source.error ? [source.error] : [])].join("; "));
    [...box.querySelector("tbody").rows].forEach((row, c) => {
      const level = source.levels[c];
      put(row.cells[1], plots.number(level.rms));
      put(row.cells[2], plots.number(level.peak));
      put(row.cells[4], plots.number(level.limit));
      put(row.cells[5], grouped(level.n_clipped), `number ${level.n_clipped ? "bad" : ""}`);
      put(row.cells[6], grouped(level.n_missing), `number ${level.n_missing ? "bad" : ""}`);
    });
  });
}

let nDrawn = 0;
function drawEvents() {
  if (state.events.length === nDrawn) return;
  if (state.events.length < nDrawn || !nDrawn) $("events").replaceChildren();
  if (state.events.length < nDrawn) nDrawn = 0;
  for (const event of state.events.slice(nDrawn)) {
    const row = element("li", "", event.is_mark ? "mark" : event.is_failure ? "bad" : "warn");
    row.append(element("time", clock(event.t[event.source || 0] || 0)), ` ${event.message}`);
    $("events").prepend(row);
  }
  nDrawn = state.events.length;
}

function drawAnalyses() {
  const { spectra, work } = state.analyses;
  if (spectra) {
    const found = spectra[state.spectrumKey];
    put($("spectrum-note"), found ? found.note : "");
    if (found && found.frequency_hz) plots.spectrum($("spectrum"), found.frequency_hz, found.density, found.units);
  }
  if (!work) return;
  put($("work"), work.headline || "");
  put($("work-note"), work.note || "");
  $("trend").hidden = !(work.trend && work.trend.length > 1);
  if (!$("trend").hidden) plots.trend($("trend"), work.trend, "time [s]", work.trend_label);
  $("loop").hidden = !work.loop;
  put($("loop-note"), work.loop ? work.loop.note : work.note || "");
  const named = work.loop || {};
  $("loop").setAttribute("aria-label", `${named.y_label} over ${named.x_label}`);
  if (work.loop) plots.loop($("loop"), work.loop.cycles, work.loop.x_label, work.loop.y_label);
}

function mark() {
  send({ mark: $("mark-text").value });
  $("mark-text").value = "";
}

$("mark").onsubmit = (event) => { event.preventDefault(); mark(); };
$("spectrum-channel").onchange = (event) => { state.spectrumKey = event.target.value; drawAnalyses(); };
document.addEventListener("keydown", (event) => {
  const isTyping = ["INPUT", "SELECT", "TEXTAREA"].includes(event.target.tagName);
  if (!isTyping && event.key.toLowerCase() === "m" && !event.ctrlKey && !event.metaKey && !event.altKey) mark();
});
window.addEventListener("resize", () => { if (state.about) draw(); });
connect();

// What every figure needs: numbers unpacked, colours for light and dark, panels, controls.

const MISSING = 65535;

// numbers are carried little-endian, whatever computer reads them
function codesOf(text, bytesEach) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const view = new DataView(bytes.buffer), codes = [];
  for (let at = 0; at < bytes.length; at += bytesEach)
    codes.push(bytesEach === 2 ? view.getUint16(at, true) : view.getUint32(at, true));
  return codes;
}

function unpacked(carried) {
  return codesOf(carried.codes, 2).map((code) => (code === MISSING ? NaN : carried.low + carried.step * code));
}

function samplesOf(carried) {
  if (carried.count !== undefined) return Array.from({ length: carried.count }, (_, index) => index);
  let at = 0;
  return codesOf(carried.steps, carried.bits / 8).map((step) => (at += step));
}

function limitsOf(...lists) {
  let low = Infinity, high = -Infinity;
  for (const list of lists)
    for (const value of list)
      if (Number.isFinite(value)) { low = Math.min(low, value); high = Math.max(high, value); }
  if (low > high) return [0, 1];
  const margin = 0.05 * (high - low) || 0.5 * Math.abs(high) || 1;
  return [low - margin, high + margin];
}

const DARK = window.matchMedia("(prefers-color-scheme: dark)");
const PALETTES = {
  light: { ink: "#1c2733", paper: "#ffffff", line: "#d5dbe1", recorded: "#9fb0c0", believed: "#8a6d00",
    before: "#2f5f93", after: "#d62728", other: ["#0072b2", "#d55e00", "#009e73", "#cc79a7"], mark: "#e6007e" },
  dark: { ink: "#e4e9ee", paper: "#1d242c", line: "#36414c", recorded: "#71818f", believed: "#e0c050",
    before: "#7db9f5", after: "#ff6b5e", other: ["#56b4e9", "#ff9550", "#3ecf9f", "#e59ac4"], mark: "#ff5cc0" },
};

function palette() { return DARK.matches ? PALETTES.dark : PALETTES.light; }

function colourOf(role, number) {
  const colours = palette();
  return role === "other" ? colours.other[number % colours.other.length] : colours[role];
}

function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...children);
  return made;
}

let nControls = 0;

function choice(label, options, changed) {
  const id = `control-${nControls += 1}`, select = element("select", { id });
  const groups = new Map();
  options.forEach(({ text, group }, index) => {
    const option = element("option", { value: String(index) }, text);
    if (!group) { select.append(option); return; }
    if (!groups.has(group)) {
      groups.set(group, element("optgroup", { label: group }));
      select.append(groups.get(group));
    }
    groups.get(group).append(option);
  });
  select.addEventListener("change", () => changed(Number(select.value)));
  return { select, shown: element("span", { class: "control" }, element("label", { for: id }, label), select) };
}

function button(text, pressed) {
  const made = element("button", { type: "button" }, text);
  made.addEventListener("click", pressed);
  return made;
}

// A box with the colour of its lines; those that are off are in a set, and `changed` draws anew.
function switchOf(label, colour, off, changed) {
  const box = element("input", { type: "checkbox" });
  box.checked = !off.has(label);
  box.addEventListener("change", () => {
    if (box.checked) off.delete(label); else off.add(label);
    changed();
  });
  const swatch = element("span", { class: "swatch", "aria-hidden": "true" });
  swatch.style.background = colour;
  return element("label", { class: "switch" }, box, swatch, label);
}

const rethemed = [];
DARK.addEventListener("change", () => rethemed.forEach((paint) => paint()));

function themed(paint) { paint(); rethemed.push(paint); }

// A panel: a drawing of the library in a place that can be reached and zoomed with keys.
class Panel {
  constructor({ label, xLabel, yLabel, height, xRange, tools = "pan,box_zoom,wheel_zoom,reset", yScale }) {
    const coarse = window.matchMedia("(pointer: coarse)").matches;
    this.x = xRange || new Bokeh.Range1d({ start: 0, end: 1 });
    this.y = new Bokeh.Range1d({ start: 0, end: 1 });
    this.figure = Bokeh.Plotting.figure({
      height, sizing_mode: "stretch_width", tools, x_range: this.x, y_range: this.y,
      x_axis_label: xLabel, y_axis_label: yLabel, toolbar_location: "above", min_width: 120,
    });
    Object.assign(this.figure.toolbar, { logo: null, group: false });
    // a page that is scrolled past must not zoom, a finger that scrolls must not draw a box
    this.figure.toolbar.active_scroll = null;
    if (coarse) this.figure.toolbar.active_drag = null;
    else this.figure.toolbar.active_drag = this.figure.toolbar.tools.find((tool) => tool.type === "BoxZoomTool");
    this.place = element("div", { class: "panel", tabindex: "0", role: "group", "aria-label":
      `${label}. Keys: arrows move, plus and minus zoom, 0 shows everything.` });
    this.place.addEventListener("keydown", (event) => this.key(event));
    themed(() => this.paint());
  }

  paint() {
    const { ink, paper, line } = palette(), figure = this.figure;
    Object.assign(figure, { background_fill_color: paper, border_fill_color: paper, outline_line_color: line });
    for (const axis of [...figure.below, ...figure.left])
      Object.assign(axis, { axis_label_text_color: ink, major_label_text_color: ink, axis_line_color: line,
        major_tick_line_color: ink, minor_tick_line_color: null, axis_label_text_font_style: "normal",
        axis_label_text_font_size: "12px", major_label_text_font_size: "11px" });
    for (const grid of figure.center) if (grid.type === "Grid") grid.grid_line_color = line;
  }

  limits(x, y) {
    if (x) Object.assign(this.x, { start: x[0], end: x[1], reset_start: x[0], reset_end: x[1] });
    if (y) Object.assign(this.y, { start: y[0], end: y[1], reset_start: y[0], reset_end: y[1] });
  }

  // Of what is drawn between two abscissas, all is seen.
  fitHeight([from, to], drawn) {
    this.limits(null, limitsOf(...drawn.map(({ x, y }) => y.filter((_, at) => x[at] >= from && x[at] <= to))));
  }

  key(event) {
    const wide = this.x.end - this.x.start, middle = 0.5 * (this.x.end + this.x.start);
    const view = { ArrowLeft: [this.x.start - 0.2 * wide, this.x.end - 0.2 * wide],
      ArrowRight: [this.x.start + 0.2 * wide, this.x.end + 0.2 * wide],
      "+": [middle - 0.35 * wide, middle + 0.35 * wide], "-": [middle - 0.7 * wide, middle + 0.7 * wide],
      0: [this.x.reset_start, this.x.reset_end] }[event.key];
    if (!view || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    [this.x.start, this.x.end] = view;
  }
}

// Panels of one figure share ranges, so they are in one document of the library.
function showTogether(panels) {
  const shown = new Bokeh.Document();
  panels.forEach((panel) => shown.add_root(panel.figure));
  return Bokeh.embed.add_document_standalone(shown, panels[0].place, panels.map((panel) => panel.place));
}

function powerOfTen(value) {
  const digits = { "-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹" };
  return `10${[...String(value)].map((digit) => digits[digit]).join("")}`;
}

// Ticks of an axis that carries logarithms.
function decadeTicks(panel, limits) {
  const [low, high] = [Math.ceil(limits[0]), Math.floor(limits[1])];
  const every = Math.max(1, Math.ceil((high - low + 1) / 6)), ticks = [];
  for (let power = low; power <= high; power += every) ticks.push(power);
  const axis = panel.figure.left[0];
  axis.ticker = new Bokeh.FixedTicker({ ticks });
  axis.major_label_overrides = new Map(ticks.map((power) => [power, powerOfTen(power)]));
}

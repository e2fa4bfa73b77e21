// A map whose points show their loop, their window of signals and their spectrum.

class WindowMapFigure {
  constructor(content, place) {
    this.content = content;
    this.place = place;
    this.xs = unpacked(content.x);
    this.ys = unpacked(content.y);
    this.build();
    this.colour(0);
    this.choose(content.first);
  }

  build() {
    const { labels, quantities, windows, title } = this.content;
    this.quantityChoice = choice("Colour", quantities.map(({ label }) => ({ text: label })), (at) => this.colour(at));
    this.windowChoice = choice("Point", windows.map(({ words, run }) => ({ text: words, group: run })),
      (at) => this.choose(at));
    const controls = element("div", { class: "controls" }, this.quantityChoice.shown, this.windowChoice.shown,
      element("span", { class: "control" }, button("previous", () => this.step(-1)), button("next", () => this.step(1))));
    this.words = element("p", { class: "touch-words", "aria-live": "polite" });
    this.map = new Panel({ label: `${title}. Click a point`, xLabel: labels.x, yLabel: labels.y, height: 380,
      tools: "tap,pan,box_zoom,wheel_zoom,reset" });
    this.loop = new Panel({ label: "Loop of the point", xLabel: labels.displacement, yLabel: labels.force,
      height: 470 });
    this.history = new Panel({ label: "Window of the point, over time", xLabel: "time within the window [s]",
      yLabel: labels.force, height: 220 });
    this.spectrum = new Panel({ label: "Spectrum of the point", xLabel: "order: frequency over that of the motion",
      yLabel: labels.amplitude, height: 220 });
    this.draw();
    this.place.append(controls, this.map.place, this.words, element("div", { class: "panels" }, this.loop.place,
      this.history.place, this.spectrum.place));
    this.panels = [this.map, this.loop, this.history, this.spectrum];
    const [left, right, low, high] = this.content.extent;
    this.map.limits([left, right], [low, high]);
  }

  draw() {
    this.mapper = new Bokeh.LinearColorMapper({ palette: ["#888888"], low: 0, high: 1, nan_color: "#00000000" });
    const field = (name) => ({ field: name }), shaded = { field: "value", transform: this.mapper };
    this.cells = new Bokeh.ColumnDataSource({ data: { x: [], y: [], value: [] } });
    this.cellGlyph = this.map.figure.rect(field("x"), field("y"), 1, 1, { source: this.cells, fill_color: shaded,
      line_color: shaded, line_width: 1 }).glyph;
    const others = new Bokeh.ColumnDataSource({ data: { x: unpacked(this.content.others.x),
      y: unpacked(this.content.others.y) } });
    const dots = this.map.figure.scatter(field("x"), field("y"), { source: others, size: 2, line_color: null });
    this.points = new Bokeh.ColumnDataSource({ data: { x: this.xs, y: this.ys, value: this.xs.map(() => 0) } });
    const circles = this.map.figure.scatter(field("x"), field("y"), { source: this.points, size: 9,
      fill_color: shaded, line_color: "#222222", line_width: 0.8 });
    circles.nonselection_glyph = circles.selection_glyph = null;
    this.map.figure.toolbar.tools.find((tool) => tool.type === "TapTool").renderers = [circles];
    this.ring = new Bokeh.ColumnDataSource({ data: { x: [], y: [] } });
    const ring = this.map.figure.scatter(field("x"), field("y"), { source: this.ring, size: 18, fill_color: null,
      line_width: 3 });
    this.points.selected.properties.indices.change.connect(() => {
      const [at] = this.points.selected.indices;
      if (at !== undefined && at !== this.at) this.choose(at);
    });
    this.bar = new Bokeh.ColorBar({ color_mapper: this.mapper, height: 10, padding: 4, title: "",
      title_text_font_style: "normal", title_text_font_size: "12px", title_standoff: 4 });
    this.map.figure.add_layout(this.bar, "below");
    const drawn = (panel, options) => {
      const source = new Bokeh.ColumnDataSource({ data: { x: [], y: [] } });
      return { source, renderer: panel.figure.line(field("x"), field("y"), { source, ...options }) };
    };
    this.cycles = new Bokeh.ColumnDataSource({ data: { xs: [], ys: [], colour: [] } });
    this.loop.figure.multi_line(field("xs"), field("ys"), { source: this.cycles, line_color: field("colour"),
      line_width: 1.2 });
    this.force = drawn(this.history, { line_width: 1.2 });
    this.lines = drawn(this.spectrum, { line_width: 1.2 });
    themed(() => {
      const { ink, paper, mark, before } = palette();
      ring.glyph.line_color = mark;
      dots.glyph.fill_color = "#111111";
      this.force.renderer.glyph.line_color = this.lines.renderer.glyph.line_color = before;
      Object.assign(this.bar, { title_text_color: ink, major_label_text_color: ink, background_fill_color: paper });
    });
  }

  colour(at) {
    const { label, values, image, colours, low, high } = this.content.quantities[at];
    Object.assign(this.mapper, { palette: colours, low, high });
    this.bar.title = label;
    this.points.data = { x: this.xs, y: this.ys, value: unpacked(values) };
    this.cells.data = image ? this.cellsOf(unpacked(image.values), image.rows) : { x: [], y: [], value: [] };
  }

  // the map as cells about the points that it was computed at, none where nothing was measured
  cellsOf(numbers, nRows) {
    const [left, right, low, high] = this.content.extent, nColumns = numbers.length / nRows;
    const width = (right - left) / nColumns, height = (high - low) / nRows, x = [], y = [], value = [];
    Object.assign(this.cellGlyph, { width: { value: width }, height: { value: height } });
    numbers.forEach((number, at) => {
      if (!Number.isFinite(number)) return;
      x.push(left + (0.5 + (at % nColumns)) * width);
      y.push(low + (0.5 + Math.floor(at / nColumns)) * height);
      value.push(number);
    });
    return { x, y, value };
  }

  step(by) {
    const n = this.content.windows.length;
    this.choose((this.at + by + n) % n);
  }

  choose(at) {
    this.at = at;
    const window = this.content.windows[at], { interval, count } = window.time;
    const time = count ? samplesOf({ count }).map((sample) => sample * interval) : unpacked(window.time);
    const force = unpacked(window.force), displacement = unpacked(window.displacement);
    this.ring.data = { x: [this.xs[at]], y: [this.ys[at]] };
    this.points.selected.indices = [at];
    this.windowChoice.select.value = String(at);
    this.force.source.data = { x: time, y: force };
    this.history.limits(time.length ? [time[0], time[time.length - 1]] : [0, 1], limitsOf(force));
    this.cycles.data = this.cyclesOf(force, displacement);
    this.loop.limits(limitsOf(displacement), limitsOf(force));
    const order = unpacked(window.order), amplitude = unpacked(window.amplitude), limits = limitsOf(amplitude);
    this.lines.source.data = { x: order, y: amplitude };
    this.spectrum.limits(order.length ? [0, order[order.length - 1]] : [0, 1], limits);
    decadeTicks(this.spectrum, limits);
    const values = this.content.quantities.map(({ label }, index) => `${label}: ${this.valueOf(index, at)}`);
    this.words.textContent = `${window.run}, ${window.words}. ${values.join("; ")}.`;
  }

  valueOf(quantity, at) {
    const value = unpacked(this.content.quantities[quantity].values)[at];
    return Number.isFinite(value) ? value.toPrecision(3).replace("-", "−") : "–";
  }

  // one line a period, from dark to light as time goes on
  cyclesOf(force, displacement) {
    const edges = [0];
    for (let at = 1; at < displacement.length; at += 1)
      if (displacement[at - 1] < 0 && displacement[at] >= 0) edges.push(at);
    edges.push(displacement.length - 1);
    const xs = [], ys = [], colour = [], { colours } = this.content.quantities[0];
    for (let cycle = 1; cycle < edges.length; cycle += 1) {
      xs.push(displacement.slice(edges[cycle - 1], edges[cycle] + 1));
      ys.push(force.slice(edges[cycle - 1], edges[cycle] + 1));
      colour.push(colours[Math.floor((0.15 + (0.7 * cycle) / edges.length) * (colours.length - 1))]);
    }
    return { xs, ys, colour };
  }
}

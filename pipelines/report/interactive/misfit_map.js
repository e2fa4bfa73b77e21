// Where a channel of a run is missed, over time and frequency; a cell shows its stretch in the time histories.

class MisfitMapFigure {
  constructor(content, place) {
    this.content = content;
    this.run = this.model = 0;
    this.build(place);
    this.chooseRun(0);
  }

  build(place) {
    const { runs, models, title, label, histories } = this.content;
    this.runChoice = choice("Run", runs.map(({ name, group }) => ({ text: name, group })), (at) => this.chooseRun(at));
    this.channelPlace = element("span", { class: "control" });
    this.modelChoice = choice("Model", models.map((text) => ({ text })), (at) => { this.model = at; this.fill(); });
    this.modelChoice.shown.hidden = models.length < 2;
    this.stretchPlace = element("span", { class: "control" });
    this.words = element("p", { class: "touch-words", "aria-live": "polite" });
    this.map = new Panel({ label: `${title}. Click a cell`, xLabel: "time [s]", yLabel: "frequency [Hz]", height: 340,
      tools: "tap,pan,box_zoom,wheel_zoom,reset" });
    this.panels = [this.map];
    this.target = element("a", { href: `#${histories}` }, "time histories");
    this.draw(label);
    place.append(element("div", { class: "controls" }, this.runChoice.shown, this.channelPlace,
      this.modelChoice.shown, this.stretchPlace), this.map.place, this.words);
  }

  draw(label) {
    const field = (name) => ({ field: name });
    this.mapper = new Bokeh.LinearColorMapper({ palette: this.content.colours, low: 0, high: this.content.high });
    const shaded = { field: "value", transform: this.mapper };
    this.cells = new Bokeh.ColumnDataSource({ data: { x: [], y: [], value: [] } });
    const cells = this.map.figure.rect(field("x"), field("y"), 1, 1, { source: this.cells, fill_color: shaded,
      line_color: shaded, line_width: 1 });
    cells.nonselection_glyph = cells.selection_glyph = null;
    this.cellGlyph = cells.glyph;
    this.map.figure.toolbar.tools.find((tool) => tool.type === "TapTool").renderers = [cells];
    this.frame = new Bokeh.ColumnDataSource({ data: { x: [], y: [], width: [], height: [] } });
    const frame = this.map.figure.rect(field("x"), field("y"), field("width"), field("height"),
      { source: this.frame, fill_color: null, line_width: 3 });
    this.cells.selected.properties.indices.change.connect(() => {
      const [at] = this.cells.selected.indices;
      if (at !== undefined) this.point(at % this.nBlocks);
    });
    this.bar = new Bokeh.ColorBar({ color_mapper: this.mapper, height: 10, padding: 4, title: label,
      title_text_font_style: "normal", title_text_font_size: "12px", title_standoff: 4 });
    this.map.figure.add_layout(this.bar, "below");
    themed(() => {
      const { ink, paper, mark } = palette();
      frame.glyph.line_color = mark;
      Object.assign(this.bar, { title_text_color: ink, major_label_text_color: ink, background_fill_color: paper });
    });
  }

  get shown() { return this.content.runs[this.run].channels[this.channel]; }

  chooseRun(at) {
    const before = this.channel === undefined ? null : this.shown.name;
    this.run = at;
    const { channels } = this.content.runs[at];
    this.channel = Math.max(0, channels.findIndex(({ name }) => name === before));
    this.channelChoice = choice("Channel", channels.map(({ name }) => ({ text: name })),
      (index) => { this.channel = index; this.fill(); });
    this.channelChoice.select.value = String(this.channel);
    this.channelPlace.replaceChildren(this.channelChoice.shown);
    this.fill();
  }

  // cells row by row, the lowest band first, as they are carried
  fill() {
    const { start, interval, band, blocks, models, stretches } = this.shown, value = unpacked(models[this.model]);
    this.nBlocks = blocks;
    const x = value.map((_, at) => start + (0.5 + (at % blocks)) * interval);
    const y = value.map((_, at) => (0.5 + Math.floor(at / blocks)) * band);
    Object.assign(this.cellGlyph, { width: { value: interval }, height: { value: band } });
    this.cells.selected.indices = [];
    this.cells.data = { x, y, value };
    this.height = (value.length / blocks) * band;
    this.map.limits([start, start + blocks * interval], [0, this.height]);
    this.frame.data = { x: [], y: [], width: [], height: [] };
    const texts = stretches.map((block) => ({ text: this.spanText(block) }));
    this.stretchChoice = choice("Missed most", [{ text: "choose a stretch" }, ...texts],
      (at) => { if (at) this.point(stretches[at - 1]); });
    this.stretchPlace.replaceChildren(this.stretchChoice.shown);
    this.words.textContent = "A click on a cell, or the list, shows its stretch in the time histories.";
  }

  spanOf(block) {
    const { start, interval } = this.shown;
    return [start + block * interval, start + (block + 1) * interval];
  }

  spanText(block) {
    return `${this.spanOf(block).map((time) => time.toFixed(2)).join(" … ")} s`;
  }

  async point(block) {
    const [from, to] = this.spanOf(block), { name } = this.shown, run = this.content.runs[this.run].name;
    this.frame.data = { x: [0.5 * (from + to)], y: [0.5 * this.height], width: [to - from], height: [this.height] };
    const histories = await figureOf(this.content.histories);
    // the neighbours, too: what is missed begins somewhere
    const isShown = histories && histories.show(run, name, [from - 0.5 * (to - from), to + 0.5 * (to - from)]);
    this.words.replaceChildren(`${run}, ${name}, ${this.spanText(block)}: `,
      ...(isShown ? ["shown in the ", this.target, "."] : ["this page has no time history of it."]));
  }
}

// Curves over one abscissa: the chart that was chosen, its lines and points switched on and off.

class ChartsFigure {
  constructor(content, place) {
    this.content = content;
    this.off = new Set();
    const { charts, title, choice: what } = content;
    this.chartChoice = choice(what, charts.map(({ name, group }) => ({ text: name, group })), (at) => this.choose(at));
    this.chartChoice.shown.hidden = charts.length < 2;
    this.switches = element("span", { class: "switches", role: "group", "aria-label": "Lines" });
    this.panel = new Panel({ label: title, xLabel: " ", yLabel: " ", height: 330 });
    this.curves = Array.from({ length: Math.max(...charts.map(({ curves }) => curves.length)) }, () => this.empty());
    this.panels = [this.panel];
    place.append(element("div", { class: "controls" }, this.chartChoice.shown, this.switches), this.panel.place);
    this.choose(0);
    themed(() => this.paint());
  }

  empty() {
    const source = new Bokeh.ColumnDataSource({ data: { x: [], y: [] } }), at = [{ field: "x" }, { field: "y" }];
    return { source, line: this.panel.figure.line(...at, { source, line_width: 1.6 }),
      points: this.panel.figure.scatter(...at, { source, size: 6, line_color: null }) };
  }

  get shown() { return this.content.charts[this.at]; }

  choose(at) {
    this.at = at;
    const { curves, x, y } = this.shown;
    this.curves.forEach(({ source }, index) => {
      const known = index < curves.length;
      source.data = { x: known ? unpacked(curves[index].x) : [], y: known ? unpacked(curves[index].y) : [] };
    });
    this.panel.figure.below[0].axis_label = x;
    this.panel.figure.left[0].axis_label = y;
    this.panel.limits(...["x", "y"].map((axis) => limitsOf(...this.curves.map(({ source }) => source.data[axis]))));
    this.paint();
  }

  paint() {
    this.switches.replaceChildren();
    this.shown.curves.forEach(({ label, role }, index) => {
      const { line, points } = this.curves[index], colour = colourOf(role, index);
      line.glyph.line_color = points.glyph.fill_color = colour;
      if (this.shown.curves.length > 1) this.switches.append(switchOf(label, colour, this.off, () => this.veil()));
    });
    this.veil();
  }

  veil() {
    this.shown.curves.forEach(({ label, points: isPoints }, index) => {
      const { line, points } = this.curves[index], isOn = !this.off.has(label);
      line.visible = isOn && !isPoints;
      points.visible = isOn && isPoints;
    });
  }
}

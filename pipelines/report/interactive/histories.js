// Time histories of a chosen run and channel: lines, what they differ by from what was recorded, spectra.

class HistoriesFigure {
  constructor(content, place) {
    this.content = content;
    this.place = place;
    this.off = new Set(content.runs.flatMap((run) => run.channels.flatMap((channel) =>
      channel.lines.filter((line) => line.hidden).map((line) => line.label))));
    this.nLines = Math.max(...content.runs.flatMap((run) => run.channels.map((channel) => channel.lines.length)));
    const everything = content.runs.flatMap((run) => run.channels);
    this.hasDifference = everything.some((channel) => channel.difference_to);
    this.hasSpectra = everything.some((channel) => channel.spectra.length);
    this.run = this.channel = 0;
    this.build();
    this.choose(0, 0);
  }

  build() {
    const runs = this.content.runs.map((run) => ({ text: run.name, group: run.group }));
    this.runChoice = choice("Run", runs, (index) => this.choose(index, this.channel));
    this.channelChoice = null;
    this.switches = element("span", { class: "switches", role: "group", "aria-label": "Lines" });
    this.words = element("p", { class: "touch-words", "aria-live": "polite" });
    this.channelPlace = element("span", { class: "control" });
    this.views = element("span", { class: "control" },
      button("close up", () => this.look(true)), button("whole run", () => this.look(false)));
    this.controls = element("div", { class: "controls" }, this.runChoice.shown, this.channelPlace, this.switches,
      this.views);
    this.x = new Bokeh.Range1d({ start: 0, end: 1 });
    this.history = new Panel({ label: `${this.content.title}: over time`, xLabel: "time [s]", yLabel: " ",
      height: 270, xRange: this.x });
    this.panels = [this.history];
    if (this.hasDifference) {
      this.difference = new Panel({ label: "Recorded less simulated, over time", xLabel: "time [s]", yLabel: " ",
        height: 190, xRange: this.x });
      this.panels.push(this.difference);
    }
    if (this.hasSpectra) {
      this.spectrum = new Panel({ label: "Spectra", xLabel: "frequency [Hz]", yLabel: " ", height: 220 });
      this.panels.push(this.spectrum);
    }
    this.lines = Array.from({ length: this.nLines }, () => this.emptyLines());
    this.place.append(this.controls, this.words, ...this.panels.map((panel) => panel.place));
    themed(() => this.paint());
  }

  emptyLines() {
    const drawn = (panel) => {
      if (!panel) return null;
      const source = new Bokeh.ColumnDataSource({ data: { x: [], y: [] } });
      return { source, renderer: panel.figure.line({ field: "x" }, { field: "y" }, { source, line_width: 1.4 }) };
    };
    return { history: drawn(this.history), difference: drawn(this.difference), spectrum: drawn(this.spectrum) };
  }

  get shown() { return this.content.runs[this.run].channels[this.channel]; }

  choose(run, channel) {
    const channels = this.content.runs[run].channels;
    // the same channel of another run, where it has it
    const name = this.content.runs[this.run].channels[channel] && this.content.runs[this.run].channels[channel].name;
    const same = channels.findIndex((other) => other.name === name);
    this.run = run;
    this.channel = same >= 0 ? same : 0;
    this.channelChoice = choice("Channel", channels.map((one) => ({ text: one.name })),
      (index) => this.choose(this.run, index));
    this.channelChoice.select.value = String(this.channel);
    const focused = this.channelPlace.contains(document.activeElement);
    this.channelPlace.replaceChildren(this.channelChoice.shown);
    if (focused) this.channelChoice.select.focus();
    this.fill();
    this.paint();
    this.look(true);
  }

  fill() {
    const channel = this.shown, samples = samplesOf(channel.samples);
    const time = samples.map((sample) => channel.start + channel.interval * sample);
    const values = channel.lines.map((line) => unpacked(line.values));
    const reference = channel.lines.findIndex((line) => line.label === channel.difference_to);
    const frequency = unpacked(channel.frequency), spectra = [];
    this.lines.forEach((line, index) => {
      const known = index < values.length;
      line.history.source.data = { x: known ? time : [], y: known ? values[index] : [] };
      if (line.difference) {
        const differs = known && reference >= 0 && index !== reference;
        const left = differs ? values[index].map((value, at) => values[reference][at] - value) : [];
        line.difference.source.data = { x: differs ? time : [], y: left };
      }
      if (line.spectrum) {
        const spectrum = known && channel.spectra.find((one) => one.label === channel.lines[index].label);
        const power = spectrum ? unpacked(spectrum.values) : [];
        line.spectrum.source.data = { x: spectrum ? frequency : [], y: power };
        spectra.push(power);
      }
    });
    this.whole = time.length ? [time[0], time[time.length - 1]] : [0, 1];
    this.history.limits(this.whole, null);
    this.history.figure.left[0].axis_label = `${channel.name} [${channel.unit}]`;
    if (this.difference) this.difference.place.hidden = reference < 0 || values.length < 2;
    if (this.difference)
      this.difference.figure.left[0].axis_label = `recorded − simulated [${channel.unit}]`;
    if (this.spectrum) {
      const limits = limitsOf(...spectra);
      this.spectrum.limits(frequency.length ? [frequency[0], frequency[frequency.length - 1]] : [0, 1], limits);
      this.spectrum.figure.left[0].axis_label = channel.spectrum_label;
      decadeTicks(this.spectrum, limits);
    }
    this.words.textContent = samples.length < channel.of
      ? `Drawn: ${samples.length} of ${channel.of} samples, the extremes of every stretch among them.`
      : `Drawn: all ${channel.of} samples.`;
  }

  look(closely) {
    this.lookAt(closely && this.shown.view ? this.shown.view : this.whole);
    this.views.hidden = !this.shown.view;
  }

  lookAt(view) {
    [this.x.start, this.x.end] = view;
    for (const part of ["history", "difference"]) if (this[part]) this[part].fitHeight(view, this.visible(part));
  }

  visible(part) {
    return this.lines.map((line) => line[part]).filter(({ renderer }) => renderer.visible)
      .map(({ source }) => source.data);
  }

  paint() {
    if (!this.lines) return;
    const { lines } = this.shown;
    this.switches.replaceChildren();
    this.lines.forEach((drawn, index) => {
      if (index >= lines.length) return;
      const { role, label } = lines[index], colour = colourOf(role, index);
      for (const part of Object.values(drawn)) {
        if (!part) continue;
        part.renderer.glyph.line_color = colour;
        part.renderer.glyph.line_width = role === "recorded" && part === drawn.history ? 3.2 : 1.3;
        part.renderer.visible = !this.off.has(label);
      }
      if (lines.length > 1) this.switches.append(switchOf(label, colour, this.off, () => this.hide(label)));
    });
  }

  hide(label) {
    this.shown.lines.forEach((line, index) => {
      if (line.label !== label) return;
      for (const part of Object.values(this.lines[index])) if (part) part.renderer.visible = !this.off.has(label);
    });
  }

  // What another figure of the page points at: a run, its channel and a stretch of time.
  show(run, channel, view) {
    const runAt = this.content.runs.findIndex(({ name }) => name === run);
    if (runAt < 0) return false;
    const channelAt = this.content.runs[runAt].channels.findIndex(({ name }) => name === channel);
    if (channelAt < 0) return false;
    this.runChoice.select.value = String(runAt);
    this.choose(runAt, channelAt);
    if (this.channel !== channelAt) this.choose(runAt, channelAt);
    this.lookAt(view);
    return true;
  }
}

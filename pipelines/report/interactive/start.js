// Every figure that the page carries, drawn as it comes into sight; one that fails stays as it is printed.

const KINDS = { histories: HistoriesFigure, map: WindowMapFigure, charts: ChartsFigure, misfit: MisfitMapFigure };
const begun = new Map();
Bokeh.logger.set_level("error");

function begin(figure) {
  if (!begun.has(figure.id)) begun.set(figure.id, draw(figure));
  return begun.get(figure.id);
}

async function draw(figure) {
  const place = figure.querySelector(".touch");
  const content = JSON.parse(figure.querySelector("script[type='application/json']").textContent);
  figure.classList.add("touched");
  try {
    const made = new KINDS[content.kind](content, place);
    await showTogether(made.panels);
    place.dataset.state = "ready";
    return made;
  } catch (error) {
    figure.classList.remove("touched");
    place.replaceChildren();
    place.dataset.state = "failed";
    console.error(`${figure.id}: ${error.message}`);
    return null;
  }
}

// Another figure of the page, drawn; null where it stands still.
async function figureOf(name) {
  const figure = document.getElementById(name);
  return figure && figure.classList.contains("touchable") ? begin(figure) : null;
}

const seen = new IntersectionObserver((entries) => {
  for (const entry of entries) {
    if (!entry.isIntersecting) continue;
    seen.unobserve(entry.target);
    begin(entry.target);
  }
}, { rootMargin: "600px" });
document.querySelectorAll("figure.touchable").forEach((figure) => seen.observe(figure));

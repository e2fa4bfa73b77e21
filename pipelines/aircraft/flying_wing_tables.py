"""Tables of a flying aircraft: the source beside what was reached, and every gust and model."""

from __future__ import annotations

import math

from pipelines.aircraft.flying_wing_comparison import Compared, fate_of, first_of, percent, point, share
from pipelines.aircraft.flying_wing_results import AircraftExperiment, GustResult
from pipelines.aircraft.offset_scan import LEAST_STATIC_MARGIN
from pipelines.report.numbers import interval, text
from pipelines.report.tables import Table
from sloshlab.aircraft.oscillation_measures import OscillationMeasures


def comparison_table(compared: tuple[Compared, ...]) -> Table:
    """What the source prints beside what was reached."""
    words = {True: "yes", False: "no", None: "–"}
    rows = tuple((row.fact, row.printed, row.reached, words[row.holds], row.why) for row in compared)
    return Table(
        "Printed and reached",
        ("fact", "the source prints", "reached", "same relation", "why different"),
        rows,
        "Speeds of gusts are as far from the flutter found here as those of the source from its own. A relation "
        "is reported where it does not hold, and nothing was changed to make it hold.",
    )


def gust_table(result: GustResult) -> Table:
    """Frequency, damping, and end of all models in one gust."""
    rows = []
    for model, run in result.runs.items():
        angle, first = run.angle_of_attack, run.first_mode
        rows.append(
            (
                model,
                text(first.frequency_hz, 4),
                share(first.damping_ratio),
                text(math.degrees(angle.largest), 3),
                text(angle.late_frequency_hz, 4),
                text(angle.late_growth_per_s, 2),
                run.recorded.response.ending or fate_of(run),
                _spread(result.members.get(model, ())),
            )
        )
    return Table(
        result.gust.name,
        (
            "model",
            "f of q₁ [Hz]",
            "ζ of q₁",
            "largest Δw/U [°]",
            "late f [Hz]",
            "late growth [1/s]",
            "end",
            "members of the ensemble",
        ),
        tuple(rows),
        f"U = {result.gust.speed_m_per_s:.3f} m/s, L_g = {result.gust.length_m:.3g} m. f and ζ from the first "
        "peak after the gust to the third; growth over the last sixths. Members: range of the limit cycle of "
        "Δw/U, or of ζ where there is none.",
    )


def damping_table(experiment: AircraftExperiment) -> Table:
    """What the damping of sideways liquids, which is not printed, decides."""
    rows = []
    for ratio, crossings in experiment.by_damping.items():
        cells = [f"{100 * ratio:g} %"]
        for kind in ("symmetric", "antisymmetric", "sloshing", "flutter"):
            found = first_of(crossings, kind)
            cells.append("–" if found is None else point(found.speed_m_per_s, found.frequency_rad_per_s))
        rows.append(tuple(cells))
    return Table(
        "Damping of the liquid's sideways modes",
        ("ζ of the liquid", "symmetric flutter", "antisymmetric flutter", "a liquid's own oscillation", "other"),
        tuple(rows),
        "Where oscillations begin to grow with liquids that slosh sideways. A root is the liquid's own where more "
        "than half of the kinetic energy is in it.",
    )


def scan_sentence(experiment: AircraftExperiment) -> tuple[str, ...]:
    """Where sideways sloshing raises and lowers the flutter."""
    if experiment.scan is None:
        return ()
    changes = [place.change for row in experiment.scan.places for place in row if math.isfinite(place.change)]
    if not changes:
        return ("no place of the scan flutters within its range of speeds",)
    raised = sum(change > 0 for change in changes)
    said = (
        f"sideways sloshing raises the symmetric flutter at {raised} and lowers it at {len(changes) - raised} of "
        f"{len(changes)} places of the tanks: {percent(min(changes))} to {percent(max(changes))}"
    )
    chosen = experiment.scan.chosen()
    if chosen is None:
        return (said, f"it raises it nowhere with a static margin of {100 * LEAST_STATIC_MARGIN:g} % of the chord")
    place = experiment.scan.places[chosen[0]][chosen[1]]
    where = f"x = {place.x_m:.3f} m, y = ±{place.y_m:.3f} m"
    return (
        said,
        f"most with a static margin of {100 * LEAST_STATIC_MARGIN:g} %: {percent(place.change)} at {where}",
    )


def departure_table(experiment: AircraftExperiment) -> Table:
    """When each tank left what its model knows."""
    rows = tuple(
        (gust, model, departure.tank, str(departure.reason)) for gust, model, departure in experiment.departures
    )
    note = "" if rows else "No tank left the training of its model."
    return Table(
        "Tanks outside the training of their model", ("gust", "model", "tank", "when and how"), rows, note
    )


def _spread(members: tuple[OscillationMeasures, ...]) -> str:
    if not members:
        return "–"
    cycles = [math.degrees(member.limit_cycle) for member in members if math.isfinite(member.limit_cycle)]
    if len(cycles) == len(members):
        return f"{interval(cycles)}°"
    ratios = interval([100 * member.damping_ratio for member in members])
    fates = ", ".join(dict.fromkeys(member.fate for member in members))
    return f"ζ {ratios} %; {fates}"

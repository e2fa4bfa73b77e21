"""Facts of chapter 3.2 of the source beside their counterparts, and whether the same relations hold."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal

from pipelines.aircraft.flying_wing_gusts import PRINTED_FLUTTER
from pipelines.aircraft.flying_wing_results import AircraftExperiment, GustResult, GustRun
from pipelines.report.numbers import text
from sloshlab.aircraft.flutter_crossings import FlutterCrossing

PRINTED_FREQUENCY: Final = {1: {"frozen": 23.53, "lateral": 23.82}, 2: {"frozen": 22.7, "lateral": 23.12}}
"""Of the flutter of `PRINTED_FLUTTER`, rad/s."""
Fate = Literal["diverges", "decays", "limit cycle"]
OTHER_AIRCRAFT: Final = "another aircraft of the same shape: its mass, modes and places of tanks are not printed"


@dataclass(frozen=True)
class Compared:
    """A fact of the source and its counterpart here.

    Attributes
    ----------
    fact, printed, reached, why : str
    holds : bool or None
        Whether the relation that the source states is there; None where there is no relation.
    """

    fact: str
    printed: str
    reached: str
    why: str
    holds: bool | None = None


def comparisons(experiment: AircraftExperiment) -> tuple[Compared, ...]:
    """Facts of chapter 3.2 for an aircraft with one tank or two; none for others."""
    number = len(experiment.model.tanks)
    if number not in PRINTED_FLUTTER or experiment.settings.gust is not None:
        return ()
    found = [*_of_stability(experiment, number)]
    found += _of_one_tank(experiment) if number == 1 else _of_two_tanks(experiment)
    return tuple(found)


def _of_stability(experiment: AircraftExperiment, number: int) -> list[Compared]:
    rows = []
    for model in ("frozen", "lateral"):
        crossing = experiment.flutter_of(model)
        reached = "none" if crossing is None else point(crossing.speed_m_per_s, crossing.frequency_rad_per_s)
        printed = point(PRINTED_FLUTTER[number][model], PRINTED_FREQUENCY[number][model])
        rows.append(Compared(f"symmetric flutter, {model}", printed, reached, OTHER_AIRCRAFT))
    frozen, lateral = experiment.flutter_of("frozen"), experiment.flutter_of("lateral")
    if frozen is None or lateral is None:
        return rows
    speed = lateral.speed_m_per_s / frozen.speed_m_per_s - 1
    frequency = lateral.frequency_rad_per_s / frozen.frequency_rad_per_s - 1
    printed_speed = PRINTED_FLUTTER[number]["lateral"] / PRINTED_FLUTTER[number]["frozen"] - 1
    printed_frequency = PRINTED_FREQUENCY[number]["lateral"] / PRINTED_FREQUENCY[number]["frozen"] - 1
    rows.append(
        Compared(
            "… changed by sideways sloshing",
            f"{percent(printed_speed)}, {percent(printed_frequency)}",
            f"{percent(speed)}, {percent(frequency)}",
            "the share of the liquid in the flutter differs with the aircraft" if number == 1 else OTHER_AIRCRAFT,
            speed * printed_speed > 0 and frequency * printed_frequency > 0,
        )
    )
    return rows


def _of_one_tank(experiment: AircraftExperiment) -> list[Compared]:
    before, after = _gust(experiment, "before"), _gust(experiment, "after")
    rows = _vertical_sloshing(before, is_lower=True, why="")
    rows += _sideways(before)
    if after is not None:
        expected: dict[str, Fate] = {"frozen": "diverges", "lateral": "diverges"}
        rows.append(_fates(after, {**expected, "vertical": "limit cycle", "full": "limit cycle"}))
        rows += _larger(after)
    return rows


def _vertical_sloshing(before: GustResult | None, *, is_lower: bool, why: str) -> list[Compared]:
    """Damping and frequency that vertical sloshing adds before flutter, which the source finds lower or higher."""
    if before is None or "vertical" not in before.runs:
        return []
    damping = {model: run.first_mode.damping_ratio for model, run in before.runs.items()}
    frequency = {model: run.first_mode.frequency_hz for model, run in before.runs.items()}
    shift = frequency["vertical"] - frequency["frozen"]
    return [
        Compared(
            f"damping of q₁, {before.gust.name}",
            "vertical and full more than frozen",
            ", ".join(f"{model} {share(value)}" for model, value in damping.items()),
            why,
            min(damping["vertical"], damping["full"]) > damping["frozen"],
        ),
        Compared(
            f"frequency of q₁, {before.gust.name}",
            f"vertical {'lower' if is_lower else 'higher'}, lateral slightly higher than frozen",
            ", ".join(f"{model} {text(value, 4)}" for model, value in frequency.items()) + " Hz",
            "the sign depends on how the liquid's mass fades and on the slope of the flutter's frequency",
            (shift < 0) == is_lower and frequency["lateral"] > frequency["frozen"],
        ),
    ]


def _of_two_tanks(experiment: AircraftExperiment) -> list[Compared]:
    crossings = experiment.crossings
    sloshing = {ratio: first_of(found, "sloshing") for ratio, found in experiment.by_damping.items()}
    third = {name: first_of(crossings[name], "antisymmetric") for name in ("frozen", "lateral")}
    rows = [
        Compared(
            "a liquid's own oscillation grows, lateral",
            "from 16.2 m/s on",
            "; ".join(
                f"ζ = {100 * ratio:g} %: "
                + ("nowhere" if one is None else point(one.speed_m_per_s, one.frequency_rad_per_s))
                for ratio, one in sloshing.items()
            ),
            "decided by the damping of the liquid, which is not printed",
            any(one is not None for one in sloshing.values()),
        ),
        Compared(
            "antisymmetric flutter, frozen and lateral",
            "22.65 m/s (48.22 rad/s), 20.94 m/s (49.13 rad/s)",
            ", ".join("none in the range" if one is None else point(one.speed_m_per_s, one.frequency_rad_per_s)
                      for one in third.values()),
            OTHER_AIRCRAFT,
            None,
        ),
    ]  # fmt: skip
    expected: dict[str, dict[str, Fate]] = {
        "before": {"frozen": "decays", "vertical": "decays", "full": "decays"},
        "between": {"frozen": "diverges", "lateral": "decays", "vertical": "decays", "full": "decays"},
        "after": {"lateral": "diverges", "vertical": "limit cycle", "full": "decays"},
    }
    fading = "here the tanks' mass holds the flutter up, and a liquid that sloshes takes a share of it away"
    rows += _vertical_sloshing(_gust(experiment, "before"), is_lower=False, why=fading)
    for label, fates in expected.items():
        result = _gust(experiment, label)
        if result is not None:
            rows.append(_fates(result, fates))
            rows += _most_damped(result, label)
    return rows


def _sideways(result: GustResult | None) -> list[Compared]:
    """Of a tank in the plane of symmetry; one beside it rolls as its wing bends."""
    if result is None or "lateral" not in result.runs:
        return []
    share = result.runs["lateral"].sideways
    return [
        Compared(
            f"y over x of the liquid, {result.gust.name}",
            "y-modes stay at rest",
            f"{share:.1e}",
            "the deck is not quite its own mirror image" if share > 1e-9 else "",
            share < 1e-9,
        )
    ]


def _fates(result: GustResult, expected: dict[str, Fate]) -> Compared:
    known = {model: fate for model, fate in expected.items() if model in result.runs}
    return Compared(
        f"{result.gust.name} at {result.gust.speed_m_per_s:.2f} m/s",
        ", ".join(f"{model} {fate}" for model, fate in expected.items()),
        ", ".join(f"{model} {fate_of(result.runs[model])}" for model in known),
        "near 1 g the network decides: see the members of the ensemble" if "vertical" in known else "",
        all(_ends_as(result.runs[model], fate) for model, fate in known.items()),
    )


def _ends_as(run: GustRun, expected: Fate) -> bool:
    if expected == "diverges":
        return run.has_diverged
    return not run.has_diverged and run.angle_of_attack.fate == expected


def _larger(result: GustResult) -> list[Compared]:
    if not {"vertical", "full"} <= result.runs.keys():
        return []
    amplitude = {model: result.runs[model].angle_of_attack.limit_cycle for model in ("vertical", "full")}
    return [
        Compared(
            f"limit cycle of Δw/U, {result.gust.name}",
            "full larger than vertical",
            ", ".join(f"{model} {fate_of(result.runs[model])}" for model in amplitude),
            "",
            # one that decays ends on none
            amplitude["full"]
            > (0.0 if result.runs["vertical"].angle_of_attack.fate == "decays" else amplitude["vertical"]),
        )
    ]


def _most_damped(result: GustResult, label: str) -> list[Compared]:
    """Full sloshing damps more than vertical alone."""
    if not {"vertical", "full"} <= result.runs.keys():
        return []
    damping = {model: result.runs[model].first_mode.damping_ratio for model in ("vertical", "full")}
    printed = {"before": "full the most damped"}.get(label, "full more damped than vertical")
    return [
        Compared(
            f"damping of q₁, {result.gust.name}",
            printed,
            ", ".join(f"{model} {share(value)}" for model, value in damping.items()),
            "",
            damping["full"] > damping["vertical"],
        )
    ]


def _gust(experiment: AircraftExperiment, label: str) -> GustResult | None:
    return next(
        (result for result in experiment.gusts if result.gust.is_main and result.gust.name.startswith(label)), None
    )


def fate_of(run: GustRun) -> str:
    """What becomes of a run in words."""
    if run.recorded.response.ending:
        return "diverges"
    measures = run.angle_of_attack
    return f"limit cycle {degrees(measures.limit_cycle)}" if measures.fate == "limit cycle" else measures.fate


def first_of(crossings: tuple[FlutterCrossing, ...], kind: str) -> FlutterCrossing | None:
    """The first crossing of a kind; None if there is none."""
    return next((crossing for crossing in crossings if crossing.kind == kind), None)


def point(speed: float, frequency: float) -> str:
    """Speed and frequency."""
    return f"{speed:.2f} m/s, {frequency:.2f} rad/s"


def share(ratio: float) -> str:
    """A ratio in per cent; a dash for what is not known."""
    return "–" if not math.isfinite(ratio) else f"{100 * ratio:.2f} %".replace("-", "−")


def degrees(radians: float) -> str:
    """An angle."""
    return "none" if not math.isfinite(radians) else f"{math.degrees(radians):.3g}°"


def percent(share: float) -> str:
    """A change with its sign."""
    return f"{100 * share:+.2f} %".replace("-", "−")

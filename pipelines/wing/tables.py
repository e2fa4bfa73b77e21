"""Tables of a wing: what the source prints and what was reached, bars, calibration, dampers, departures."""

from __future__ import annotations

import numpy as np

from pipelines.report.numbers import signed, text
from pipelines.report.tables import Table
from pipelines.wing.results import BETA_HAT, FROZEN, SLOSHING, EnergyBalance, GustCase, WingExperiment, WingResult
from sloshlab.aircraft.limit_cycle import BranchPoint
from sloshlab.aircraft.wing_calibration import RATIO_TOLERANCE, SPEED_TOLERANCE_M_PER_S
from sloshlab.constants import GRAVITY_M_PER_S2

_MET, _MISSED, _OPEN = "met", "missed", "not decided"
_SAME_CYCLE = 0.02
_FOLD_TOLERANCE_M_PER_S = 1.0
_ZERO_LINE = 0.15
_PRINTED_FLUTTER_M_PER_S = 319.3
_PRINTED_FOLD_M_PER_S = 323.0


def printed_and_reached(result: WingResult) -> Table:
    """Every fact of chapter 3.1 beside what this wing does."""
    flutter = result.state.flutter
    effective = result.effective_mass.get(BETA_HAT)
    found = result.bifurcation
    rows = [
        ("flutter, frozen", "319.3 m/s, from the first bending", _flutter(result), "an input of the stiffness"),
        ("ω_F/ω₁", "1.95", text(result.state.frequency_ratio, 4), "an input, too"),
        (
            "flutter with β̂ = −0.154", "about 2 m/s earlier (of the limit cycle's onset)",
            "–" if effective is None or flutter is None
            else f"{signed(effective.speed_m_per_s - flutter.speed_m_per_s, 2)} m/s",
            "sign as settled; its size is the share of the liquid in the mode",
        ),
    ]  # fmt: skip
    rows += [_gust_row(case) for case in result.gusts]
    rows += [
        ("two gusts at 321 m/s", "the same limit cycle", _same_cycle(result)[1], ""),
        (
            "onset of the limit cycle", "about 317 m/s", text(found.onset_m_per_s, 5),
            "where the trained model damps weak motion, more than the recordings do (see limits)",
        ),
        (
            "end of the limit cycle", "slightly below 323 m/s", text(found.fold_m_per_s, 5),
            "the liquid's share in the mode decides it; see the matched wing",
        ),
    ]  # fmt: skip
    if result.landing is not None:
        rows.append(_landing_row(result.landing))
    if result.dampers is not None:
        rows.append((
            "dampers c₁, c₂, c₃", "all damp too much; c₂, c₃ more than c₁", _dampings(result.dampers),
            "damping ratio of the first cycles, beside that of the trained model",
        ))  # fmt: skip
    return Table("Printed and reached", ("what", "the source prints", "reached", "why different"), tuple(rows))


def _flutter(result: WingResult) -> str:
    flutter = result.state.flutter
    return "none" if flutter is None else f"{flutter.speed_m_per_s:.2f} m/s, from {flutter.origin}"


def _gust_row(case: GustCase) -> tuple[str, str, str, str]:
    frozen, sloshing = case.readings[FROZEN], case.readings[SLOSHING]
    speed = case.case.speed_m_per_s
    w, printed = case.case.amplitude_m_per_s, case.printed_m_per_s
    facts = (
        f"ζ = {_percent(frozen.first_damping_ratio)} frozen, {_percent(sloshing.first_damping_ratio)} sloshing"
        f"; tip ends at {1e3 * sloshing.end.amplitude:.3g} mm"
    )
    if sloshing.record.response.ending:
        facts += f"; {sloshing.record.response.ending}"
    why = (
        "" if w > 0.999 * printed else f"w = {w:.3g} m/s: more takes tanks beyond 6 g, as the source chose its own"
    )
    says = (
        "frozen diverges, sloshing: limit cycle"
        if speed > _PRINTED_FLUTTER_M_PER_S
        else "more damped with sloshing"
    )
    return (f"{speed:g} m/s, w = {printed:g} m/s", says, facts, why)


def _percent(value: float) -> str:
    return "–" if not np.isfinite(value) else f"{100 * value:.2f} %".replace("-", "−")


def _landing_row(case: GustCase) -> tuple[str, str, str, str]:
    frozen, sloshing = case.readings[FROZEN], case.readings[SLOSHING]
    facts = f"ζ = {_percent(frozen.first_damping_ratio)} frozen, {_percent(sloshing.first_damping_ratio)} sloshing"
    return (
        "landing",
        "a bit more damped",
        facts,
        "no recording is printed: a half sine and a ringing, qualitative",
    )


def _dampings(case: GustCase) -> str:
    names = {SLOSHING: "trained", "c_1": "c₁", "c_2": "c₂", "c_3": "c₃"}
    return ", ".join(
        f"{names[model]} {_percent(reading.first_damping_ratio)}"
        for model, reading in case.readings.items()
        if model in names
    )


def _same_cycle(result: WingResult) -> tuple[bool | None, str]:
    """Whether motions after the smallest and the largest gust at one speed end with the same amplitude."""
    speed = max(case.case.speed_m_per_s for case in result.gusts)
    ends = [case.readings[SLOSHING] for case in result.gusts if case.case.speed_m_per_s == speed]
    amplitudes = [reading.end.amplitude for reading in ends]
    if any(reading.record.response.ending for reading in ends):
        return None, "a simulation ended early"
    if max(amplitudes) < BranchPoint.vanished_m:
        return False, "all motions die: no limit cycle at this speed"
    spread = max(amplitudes) / min(amplitudes) - 1
    return spread <= _SAME_CYCLE, f"{1e3 * min(amplitudes):.3g} … {1e3 * max(amplitudes):.3g} mm"


def bars(experiment: WingExperiment, result: WingResult, *, is_matched: bool) -> Table:
    """What the project asks of this command, and what was reached."""
    flutter = result.state.flutter
    speed = float("nan") if flutter is None else flutter.speed_m_per_s
    effective = result.effective_mass.get(BETA_HAT)
    shift = float("nan") if effective is None else effective.speed_m_per_s - speed
    same, ends = _same_cycle(result)
    sub = [case for case in result.gusts if case.case.speed_m_per_s < _PRINTED_FLUTTER_M_PER_S]
    damped = all(
        case.readings[SLOSHING].first_damping_ratio > case.readings[FROZEN].first_damping_ratio for case in sub
    )
    rows = [
        *_calibration_bars(result, speed),
        _bar("shift by β̂ = −0.154", "negative", f"{signed(shift, 2)} m/s", shift < 0),
        _bar("damping at 266 and 315 m/s", "sloshing above frozen",
             "; ".join(_gust_row(case)[2].split(";")[0] for case in sub), damped),
        _bar("two gusts at 321 m/s", "a limit cycle, amplitudes within 2 %", ends, same),
        *_fold_bars(result, is_matched=is_matched),
        *_zero_line_bar(result),
        *_damper_bars(result),
    ]  # fmt: skip
    return Table("Asked and reached", ("what", "asked", "reached", ""), tuple(rows))


def _calibration_bars(result: WingResult, speed_m_per_s: float) -> list[tuple[str, str, str, str]]:
    """Targets of the file, which is the place where they are stated; none of a file without."""
    targets, ratio = result.state.described.calibration, result.state.frequency_ratio
    if targets is None:
        return []
    wanted, wanted_ratio = targets.flutter_speed_m_per_s, targets.frequency_ratio
    return [
        _bar("flutter, frozen", f"{wanted:g} ± {SPEED_TOLERANCE_M_PER_S:g} m/s (calibrated)",
             text(speed_m_per_s, 5), abs(speed_m_per_s - wanted) <= SPEED_TOLERANCE_M_PER_S),
        _bar("ω_F/ω₁", f"{wanted_ratio:g} ± {RATIO_TOLERANCE:g} (calibrated)", text(ratio, 4),
             abs(ratio - wanted_ratio) <= RATIO_TOLERANCE),
    ]  # fmt: skip


def _bar(what: str, asked: str, reached: str, is_met: bool | None) -> tuple[str, str, str, str]:
    return (what, asked, reached, _OPEN if is_met is None else _MET if is_met else _MISSED)


def _fold_bars(result: WingResult, *, is_matched: bool) -> list[tuple[str, str, str, str]]:
    fold = result.bifurcation.fold_m_per_s
    rows = []
    if is_matched:
        met = None if not np.isfinite(fold) else abs(fold - _PRINTED_FOLD_M_PER_S) <= _FOLD_TOLERANCE_M_PER_S
        rows.append(_bar("end of the limit cycle", "323 ± 1 m/s", text(fold, 5), met))
    if result.energy is not None:
        by_map = result.energy.effective.fold_m_per_s()
        both = np.isfinite(fold) and np.isfinite(by_map)
        met = abs(fold - by_map) <= _FOLD_TOLERANCE_M_PER_S if both else None
        reached = f"{text(fold, 5)} by simulation, {text(by_map, 5)} by the map"
        rows.append(_bar("fold by both ways", "within 1 m/s of each other", reached, met))
    return rows


def zero_line_errors(result: WingResult, balance: EnergyBalance) -> list[tuple[float, float]]:
    """Speed, and zero of the energy map over the simulated amplitude less one, where both are known."""
    zeros = [(speed, amplitude) for speed, amplitude, stable in balance.effective.limit_cycles() if stable]
    if not zeros:
        return []
    speeds, amplitudes = np.array(zeros).T
    found = []
    for point in result.bifurcation.up:
        if point.is_alive and point.cycle.is_converged and speeds.min() <= point.speed_m_per_s <= speeds.max():
            by_map = float(np.interp(point.speed_m_per_s, speeds, amplitudes))
            found.append((point.speed_m_per_s, by_map / point.cycle.amplitude - 1))
    return found


def _zero_line_bar(result: WingResult) -> list[tuple[str, str, str, str]]:
    if result.energy is None:
        return []
    errors = [error for _, error in zero_line_errors(result, result.energy)]
    if not errors:
        return [
            _bar(
                "zero line of the energy map", "within 15 % of the simulated amplitude", "no speed with both", None
            )
        ]
    largest = max(errors, key=abs)
    reached = f"{signed(100 * min(errors), 0)} … {signed(100 * max(errors), 0)} %"
    return [
        _bar(
            "zero line of the energy map",
            "within 15 % of the simulated amplitude",
            reached,
            abs(largest) <= _ZERO_LINE,
        )
    ]


def _damper_bars(result: WingResult) -> list[tuple[str, str, str, str]]:
    if result.dampers is None:
        return []
    ratio = {model: reading.first_damping_ratio for model, reading in result.dampers.readings.items()}
    c_1, c_2, c_3 = (ratio.get(name, float("nan")) for name in ("c_1", "c_2", "c_3"))
    met = min(c_1, c_2, c_3) > ratio[SLOSHING] and min(c_2, c_3) >= c_1
    return [
        _bar(
            "dampers at 315 m/s", "all above the trained model, c₂ and c₃ above c₁", _dampings(result.dampers), met
        )
    ]


def tanks(result: WingResult) -> Table:
    """Sizes, ω̄ at flutter, dampers of each tank."""
    flutter = result.state.flutter
    rows = []
    for tank in result.state.model.tanks:
        box = tank.box
        scale = np.sqrt(GRAVITY_M_PER_S2 / box.height_m)
        omega_bar = float("nan") if flutter is None else flutter.frequency_rad_per_s / scale
        dampers = [
            result.damping_n_s_per_m.get(name, {}).get(tank.name, float("nan")) for name in ("c_1", "c_2", "c_3")
        ]
        rows.append((
            tank.name, f"{tank.place_m[1]:.1f}", f"{box.length_m:.2f} × {box.width_m:.2f} × {box.height_m:.2f}",
            text(box.liquid_mass_kg), text(float(omega_bar)), *(text(value) for value in dampers),
        ))  # fmt: skip
    coefficients = tuple(f"{name} [N s/m]" for name in ("c₁", "c₂", "c₃"))
    header = ("tank", "y [m]", "size [m]", "liquid [kg]", "ω̄ at flutter", *coefficients)
    return Table("Tanks", header, tuple(rows), "Dampers by (E.8) from the measured map, at the flutter frequency.")


def stiffness(result: WingResult) -> Table:
    """What was calibrated, and what for."""
    described = result.state.described
    wing, targets = described.wing, described.calibration
    rows = [
        ("EI at the root", f"{wing.root_bending_stiffness_n_m2:.5g} N m²"),
        ("GJ/EI", f"{wing.torsion_over_bending:.5f}"),
        ("flutter, root locus", _flutter(result)),
        ("flutter, p-k", f"{text(result.stability.p_k_flutter_m_per_s, 6)} m/s"),
        ("ω_F/ω₁", text(result.state.frequency_ratio, 5)),
        ("mass without liquid, liquid",
         f"{result.state.model.structure.rigid_mass[0, 0]:.5g} kg, {result.state.model.liquid_mass_kg:.5g} kg"),
        ("dry modes", ", ".join(f"{f:.2f}" for f in result.state.model.structure.frequencies_hz[:6]) + " Hz …"),
    ]  # fmt: skip
    if targets is not None:
        wanted = f"{targets.flutter_speed_m_per_s:g} m/s and ω_F/ω₁ = {targets.frequency_ratio:g}"
        rows.insert(
            2, ("solved for (inputs, no results)", f"{wanted} {f'({targets.source})' if targets.source else ''}")
        )
    return Table("Stiffness", ("", ""), tuple(rows))


def departures(result: WingResult) -> Table:
    """Where tanks were outside what their model knows."""
    rows = [(name, one.tank, str(one.reason)) for name, one in result.departures]
    return Table(
        "Tanks outside the training of their model", ("case", "tank", "how"), tuple(rows),
        "Tanks near the root hardly move: weaker than any training. That is told here and not "
        "flagged, since what such "
        "a tank does is small; the trained model damps weak motion more than the recordings do.",
    )  # fmt: skip

"""Tables of the report: what was measured, with what, and how well."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from pipelines.report.figure import NothingToDrawError
from pipelines.report.numbers import MISSING, interval, prefixed_unit, signed, text
from pipelines.report.tables import Table
from pipelines.sweep.figures_quality import identity_difference
from pipelines.sweep.figures_response import responses
from pipelines.sweep.figures_runs import law_text
from pipelines.sweep.selection import REFERENCE_FREQUENCIES_HZ, by_level, is_sweep, level_g, rig_text, runs_of
from sloshlab import viscous_equivalent
from sloshlab.errors import SloshlabError
from sloshlab.free_surface_modes import mode_table
from sloshlab.sweep.frequency_response import force_amplitude_n
from sloshlab.sweep.regime import FARADAY, QUIET_FORCE_RATIO, REGIMES

if TYPE_CHECKING:
    from pipelines.sweep.results import RigResult, RunResult, SweepExperiment


def run_table(runs: Sequence[RunResult]) -> Table:
    """All runs with their law, windows and losses."""
    rows = []
    for number, run in enumerate(runs, start=1):
        law = run.stated or run.law
        error = 1e3 * run.boundary_error_s
        rows.append(
            (
                str(number),
                run.attributes.run_id,
                run.rig_name or MISSING,
                text(level_g(run)) if run.windows.sizes["window"] else MISSING,
                law_text(law) + ("" if law.stated else " (identified)"),
                interval(run.windows["frequency_hz"].values),
                str(run.windows.sizes["window"]),
                f"{run.n_cycles_lost} of {run.n_cycles}",
                text(error, 2),
            )
        )
    return Table(
        "Runs",
        ("no.", "run", "rig", "level [g]", "sweep law", "frequency [Hz]", "windows", "cycles left out",
         "boundary error [ms]"),
        tuple(rows),
        "The level is the one the recording states, else the median over its windows. The boundary error is the "
        "largest difference between the cycle boundaries measured and those of the stated law, the constant "
        "offset removed.",
    )  # fmt: skip


def free_surface_table(rigs: Sequence[RigResult]) -> Table:
    """Table 1.1: symmetric modes of the free surface for every fill level."""
    title, orders = "Free-surface modes (counterpart of Table 1.1)", ("l", "m")
    columns: list[dict[tuple[int, int], float]] = []
    try:
        for rig in rigs:
            modes = mode_table(rig.rig.tank, rig.rig.liquid)
            columns.append({(mode.order_l, mode.order_m): mode.frequency_hz for mode in modes})
    except SloshlabError as error:
        return Table(title, orders, (), f"Not evaluated: {error}")
    pairs = sorted(columns[0], key=lambda pair: columns[0][pair])
    rows = [(str(l_), str(m), *(text(column.get((l_, m), math.nan), 4) for column in columns)) for l_, m in pairs]
    header = (*orders, *(f"f [Hz], {rig_text(rig)}" for rig in rigs))
    return Table(
        title,
        header,
        tuple(rows),
        "Natural frequencies of the first symmetric modes cos(lπx/l₁) cos(mπy/l₂) with surface tension, "
        "ω² = (g k + σk³/ρ) tanh(k h_f).",
    )


def beta_table(experiment: SweepExperiment) -> Table:
    """Mean of β per level and fill level."""
    levels = sorted({_rounded(level_g(run)) for run in by_level(experiment.runs) if is_sweep(run)})
    rows = []
    for level in levels:
        cells = []
        for rig in experiment.rigs:
            chosen = [run for run in runs_of(experiment, rig) if is_sweep(run) and _rounded(level_g(run)) == level]
            values = np.concatenate([run.windows["beta"].values for run in chosen]) if chosen else np.empty(0)
            cells.append(text(float(values.mean())) if values.size else MISSING)
        rows.append((f"{level:g}", *cells))
    return Table(
        "Effective mass: mean of β over each level",
        ("level [g]", *(rig_text(rig) for rig in experiment.rigs)),
        tuple(rows),
        "The liquid adds (1 + β) m_l to the tank; β = 0 is liquid that moves with the tank like a solid. The mean "
        "is over the windows of the sweeps of that level.",
    )


def _rounded(level: float) -> float:
    return float(f"{level:.2g}")


def dry_mass_table(rigs: Sequence[RigResult]) -> Table:
    """Dry mass and gain, identified from runs without moving liquid, against the rig description."""
    rows = []
    for rig in rigs:
        dry, believed = rig.dry_mass, rig.rig.tank.dry_mass_kg
        if dry is None:
            rows.append((rig.name, text(believed, 4), MISSING, MISSING, MISSING, MISSING, "rig description"))
            continue
        gain = f"{dry.gain_ratio:.4f} ± {text(dry.gain_ratio_std, 2)}" if dry.gain_is_identified else "taken as 1"
        rows.append(
            (
                rig.name,
                text(believed, 4),
                f"{dry.mass_kg:.4f} ± {text(dry.mass_std_kg, 2)}",
                signed(100 * (dry.mass_kg / believed - 1), 2),
                gain,
                text(1e6 * dry.delay_s, 2),
                ", ".join(dry.source_runs),
            )
        )
    return Table(
        "Dry mass and gain",
        ("rig", "believed [kg]", "identified [kg]", "difference [%]", "gain of force over acceleration",
         "delay of force [µs]", "from"),
        tuple(rows),
        "The dry mass is all that rests on the force cells without liquid. Runs with the tank empty and with the "
        "liquid frozen to it tell the mass from the gain; all forces are divided by the gain.",
    )  # fmt: skip


def regime_table(windows: xr.Dataset) -> Table:
    """The numbers that decide the regime, per label."""
    rows = []
    for label in REGIMES:
        chosen = windows.isel(window=np.flatnonzero(windows["regime"].values.astype(str) == label))
        if chosen.sizes["window"] == 0:
            rows.append((label, "0", *[MISSING] * 6))
            continue
        names = ("force_ratio", "subharmonic_share", "harmonic_share", "unrepeated_share", "crest_factor")
        medians = [text(float(np.nanmedian(chosen[name].values)), 2) for name in names]
        rows.append((label, str(chosen.sizes["window"]), interval(chosen["acceleration_g"].values, 2), *medians))
    return Table(
        "Numbers that decide the regime (medians)",
        ("regime", "windows", "acceleration [g]", "force ratio", "repeats every 2nd cycle", "repeats at 2Ω … 5Ω",
         "does not repeat", "crest factor"),
        tuple(rows),
        f"A window is quiet if the force ratio (RMS of Δf without its part in phase with the acceleration over "
        f"that of m_l ü) is below {QUIET_FORCE_RATIO:g}. It is counted with the Faraday waves if it dissipates "
        f"smoothly, with less than {QUIET_FORCE_RATIO:g} of m_l ü beside the fundamental, where the shares are "
        f"those of next to nothing{_n_smooth_text(windows)}. Otherwise the largest of the three shares names it. "
        "The crest factor is shown for information.",
    )  # fmt: skip


def _n_smooth_text(windows: xr.Dataset) -> str:
    n_smooth, n_waves = counted_with_the_waves(windows)
    if not n_smooth:
        return ""
    return f" ({n_smooth} of the {n_waves} windows called {FARADAY}, whatever their largest share)"


def counted_with_the_waves(windows: xr.Dataset) -> tuple[int, int]:
    """Windows called Faraday whose largest share is not what repeats every second cycle, and all so called."""
    is_wave = windows["regime"].values.astype(str) == FARADAY
    others = np.maximum(windows["harmonic_share"].values, windows["unrepeated_share"].values)
    return int((is_wave & (windows["subharmonic_share"].values < others)).sum()), int(is_wave.sum())


def viscous_table(rig: RigResult) -> Table:
    """Equivalent viscous coefficients c₁, c₂, c₃ of the map (Appendix E)."""
    w_bar = rig.maps.dataset["w_bar"]
    scales = {"liquid_mass_kg": rig.rig.liquid_mass_kg, "tank_height_m": rig.rig.tank.height_m}
    rows = []
    try:
        omega_bar, u_bar, largest = viscous_equivalent.maximum_of(w_bar)
        at_maximum = viscous_equivalent.damping_at_maximum_kg_per_s(w_bar, **scales)
    except SloshlabError as error:
        return Table("Equivalent viscous coefficients", ("frequency [Hz]",), (), f"Not evaluated: {error}")
    for frequency in REFERENCE_FREQUENCIES_HZ:
        omega = 2 * math.pi * frequency / rig.rig.frequency_scale_rad_per_s
        try:
            mean = viscous_equivalent.damping_mean_over_amplitude_kg_per_s(w_bar, omega, **scales)
            greatest = viscous_equivalent.damping_of_maximum_kg_per_s(w_bar, omega, **scales)
        except SloshlabError:
            continue
        rows.append((text(frequency), text(omega), text(mean), text(at_maximum), text(greatest)))
    return Table(
        f"Equivalent viscous coefficients, {rig_text(rig)}",
        ("frequency [Hz]", "ω̄", "c₁ [kg/s]", "c₂ [kg/s]", "c₃ [kg/s]"),
        tuple(rows),
        "Dampers that dissipate what the liquid dissipates, c = (m_l/π) √(g/h) ω̄ W̄ (E.4): c₁ with W̄ "
        "averaged over "
        f"the measured amplitudes at the frequency, c₂ at the maximum of the map (W̄ = {text(largest)} at "
        f"ω̄ = {text(omega_bar)}, ū = {text(u_bar)}), c₃ with that maximum taken at the frequency.",
    )


def settings_table(experiment: SweepExperiment) -> Table:
    """Rig, liquid and settings."""
    settings = experiment.settings.windows
    rows: list[tuple[str, ...]] = [
        ("P, half width of a window", str(settings.half_width_cycles), "cycles"),
        ("M, distance of windows", str(settings.spacing_cycles), "cycles"),
        ("fewest usable cycles of a window", str(settings.smallest_n_cycles), "cycles"),
    ]
    for rig in experiment.rigs:
        tank, liquid = rig.rig.tank, rig.rig.liquid
        box = " × ".join(f"{1e3 * side:.4g}" for side in (tank.height_m, tank.length_m, tank.width_m))
        rows += [
            (f"{rig.name}: tank, height × length × width", box, "mm"),
            (f"{rig.name}: liquid", liquid.name, ""),
            (f"{rig.name}: fill level α", f"{liquid.fill_level:g}", ""),
            (f"{rig.name}: mass of the liquid m_l", text(rig.rig.liquid_mass_kg, 5), "kg"),
            (f"{rig.name}: density", text(liquid.density_kg_per_m3, 4), "kg/m³"),
            (f"{rig.name}: surface tension", text(liquid.surface_tension_n_per_m, 3), "N/m"),
            (f"{rig.name}: kinematic viscosity", text(liquid.kinematic_viscosity_m2_per_s, 3), "m²/s"),
            (f"{rig.name}: √(g/h), √(gh)",
             f"{rig.rig.frequency_scale_rad_per_s:.3f}, {rig.rig.velocity_scale_m_per_s:.4f}", "rad/s, m/s"),
        ]  # fmt: skip
    return Table("Parameters", ("parameter", "value", "unit"), tuple(rows), "g = 9.81 m/s².")


def agreement_table(runs: Sequence[RunResult]) -> Table | None:
    """Redundant sensors: gain, delay and disagreement over all runs."""
    pairs = [p for run in runs if run.quality.accelerometers for p in run.quality.accelerometers.pairs]
    if not pairs:
        return None
    rows = []
    for name, reference in sorted({(pair.name, pair.reference) for pair in pairs}):
        own = [pair for pair in pairs if (pair.name, pair.reference) == (name, reference)]
        rows.append(
            (
                name,
                reference,
                interval([pair.gain_ratio for pair in own], 4),
                interval([1e6 * pair.delay_s for pair in own], 2),
                interval([1e3 * pair.phase_error_at_20_hz_rad for pair in own], 2),
                interval([100 * pair.rms_disagreement for pair in own], 2),
            )
        )
    return Table(
        "Agreement of redundant accelerometers",
        ("sensor", "against", "gain", "delay [µs]", "phase at 20 Hz [mrad]", "RMS disagreement [%]"),
        tuple(rows),
        "The RMS disagreement contains gain, delay and noise together.",
    )


def identity_table(experiment: SweepExperiment) -> Table:
    """Energy identity: difference of both works, per rig."""
    sets = [(rig.name, rig.windows) for rig in experiment.rigs] or [("all runs", experiment.windows)]
    rows, symbol = [], ""
    for name, windows in sets:
        difference, symbol, _ = identity_difference(windows)
        size = np.abs(difference[np.isfinite(difference)])
        if size.size:
            values = (np.sqrt(np.mean(size**2)), np.median(size), size.max())
            rows.append((name, *(text(float(value), 2) for value in values)))
    return Table(
        f"Energy identity: (W of the loop − πγΩu₀²) over {symbol}",
        ("windows of", "RMS", "median", "largest"),
        tuple(rows),
    )


def validation_table(experiment: SweepExperiment) -> Table:
    """Cross-validated errors of the maps."""
    symbols = {"work_j": ("W/(u₀Ω)²", "kg"), "w_bar": ("W̄", ""), "beta": ("β", "")}
    sets = [(rig.name, rig.maps) for rig in experiment.rigs]
    if experiment.work_maps is not None:
        sets.append(("all runs", experiment.work_maps))
    rows = []
    for owner, maps in sets:
        for name, result in maps.validation.items():
            symbol, unit = symbols.get(name, (name, ""))
            values = (result.left_out_windows_rms, result.left_out_runs_rms)
            rows.append(
                (owner, symbol, unit or "1", *(text(value, 2) for value in values), f"{result.smoothing:g}")
            )
    return Table(
        "Error of the maps, cross-validated",
        (
            "map of",
            "quantity",
            "unit",
            "windows left out (RMS)",
            "whole runs left out (RMS)",
            "smoothing",
        ),
        tuple(rows),
        "The maps of W and of W̄ are one interpolation of W/(u₀Ω)². Runs at the edge of the region are "
        "not left out.",
    )


def resonance_table(runs: Sequence[RunResult]) -> Table:
    """Resonance of every run: where acceleration, work and ü/F are largest."""
    rows = []
    for run in runs:
        try:
            [response] = responses([run])
        except NothingToDrawError:
            continue
        rows.append(
            (
                run.attributes.run_id,
                text(response.strongest_hz, 4),
                text(response.strongest_g, 3),
                text(response.work_peak_hz, 4),
                text(response.peak_hz, 4),
                text(response.peak_per_kg, 3),
                interval(force_amplitude_n(run.windows), 3),
            )
        )
    return Table(
        "Resonance of every run",
        ("run", "largest acceleration at [Hz]", "acceleration there [g]", "largest work at [Hz]",
         "largest |ü/F| at [Hz]", "|ü/F| there [1/kg]", "force amplitude along the run [N]"),
        tuple(rows),
        "From the parabola through the largest window and its neighbours; work and |ü/F| within 10 % of "
        "the frequency "
        "of the largest acceleration. A frequency that falls as the level rises is softening.",
    )  # fmt: skip


def work_level_table(runs: Sequence[RunResult]) -> Table:
    """Largest work per cycle of every run and where."""
    factor, unit = prefixed_unit(np.concatenate([run.windows["work_j"].values for run in runs]), "J")
    rows = []
    for run in runs:
        at = int(np.nanargmax(run.windows["work_j"].values))
        window = run.windows.isel(window=at)
        rows.append(
            (
                run.attributes.run_id,
                f"{text(factor * float(window['work_j']))} ± "
                f"{text(factor * float(window['work_j_std']) / math.sqrt(float(window['n_cycles'])), 2)}",
                text(float(window["frequency_hz"]), 4),
                text(float(window["acceleration_g"])),
                text(1e3 * float(window["amplitude_m"])),
            )
        )
    return Table(
        "Largest work per cycle",
        ("run", f"W [{unit}]", "at [Hz]", "acceleration [g]", "displacement amplitude [mm]"),
        tuple(rows),
    )

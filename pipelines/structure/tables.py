"""Tables of the report on a beam or a guided tank."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from pipelines.report.numbers import MISSING, interval, signed, text
from pipelines.report.tables import Table
from pipelines.structure.figures_spectra import TABLE_2_5
from pipelines.structure.figures_twin import pairs_of, relative_error
from pipelines.structure.results import CONFIGURATIONS, METHODS, BeamExperiment, BeamRun, in_g
from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.modal.instantaneous_damping import InstantaneousDamping
from sloshlab.modal.pooled_decays import mean_at_common_amplitudes

_AMPLITUDES_G: Final = (6.0, 4.0, 3.0, 2.0, 1.5, 1.0, 0.5, 0.25)


def mode_table(experiment: BeamExperiment) -> Table:
    """Modes as the rig states them, as measured with the liquid frozen, and of the updated model (Table 2.4)."""
    updated = experiment.updated
    rows = []
    for mode, name in enumerate(experiment.modes.names):
        found, believed = experiment.frozen_modes.get(mode), experiment.modes.frequency_hz[mode]
        modelled = updated.modelled_hz[mode] if updated is not None and mode < updated.modelled_hz.size else None
        rows.append(
            (
                name,
                text(believed, 5),
                MISSING if found is None else f"{found.frequency_hz:.5g} ± {text(found.frequency_hz_std, 1)}",
                MISSING if found is None else f"{signed(100 * (found.frequency_hz / believed - 1), 2)} %",
                text(modelled, 5),
                text(100 * experiment.modes.damping_ratio[mode]),
                MISSING if found is None else text(100 * found.damping_ratio),
                MISSING if found is None else found.source,
            )
        )
    header = ("mode", "stated f [Hz]", "measured f [Hz]", "deviation", "updated model f [Hz]", "stated ζ [%]",
              "measured ζ [%]", "from")  # fmt: skip
    return Table("Modes with the liquid frozen", header, tuple(rows), _update_note(experiment))


def _update_note(experiment: BeamExperiment) -> str:
    updated = experiment.updated
    mass = experiment.carried_mass
    carried = (
        ""
        if mass is None
        else f" Force over acceleration in the frozen runs: {mass.mass_kg:.4f} ± {text(mass.mass_std_kg, 1)} kg "
        "beyond "
        f"the force sensor; the rig says {experiment.rig.tank.dry_mass_kg + experiment.rig.liquid_mass_kg:.4g} kg."
    )
    if updated is None:
        return f"Counterpart of Table 2.4. No structural update: {experiment.update_reason}." + carried
    error = "" if np.isnan(updated.tip_mass_kg_std) else f" ± {text(updated.tip_mass_kg_std, 1)}"
    return (
        "Counterpart of Table 2.4. The updated model is a uniform Euler–Bernoulli beam of finite elements, its "
        "tip "
        f"mass and bending stiffness fitted to the measured frequencies: {updated.beam.tip_mass_kg:.3f}{error} "
        "kg at "
        f"the tip, E = {updated.beam.youngs_modulus_pa / 1e9:.1f} GPa." + carried
    )


def filter_table(experiment: BeamExperiment) -> Table | None:
    """Conditioning and residual of the modal filter of every run."""
    rows = []
    for run in experiment.runs:
        if run.modal_filter is None:
            continue
        residuals = ", ".join(
            f"{name.removeprefix('acceleration_')} {text(value, 2)} ({text(100 * share, 2)} %)"
            for name, value, share in zip(
                run.response.sensor_names,
                run.response.residual_rms_m_per_s2,
                run.response.residual_share,
                strict=True,
            )
        )
        visible = ", ".join(text(value, 3) for value in run.modal_filter.visibility)
        rows.append((run.name, visible, text(run.modal_filter.condition_number, 3), residuals))
    if not rows:
        return None
    return Table(
        "Modal filter",
        (
            "run",
            "visibility of the modes",
            "condition number",
            "residual at each sensor [m/s²] (share of its RMS)",
        ),
        tuple(rows),
        "Visibility: length of the part of a mode's shape at the sensors that no other mode can make, over the "
        "mode's largest deflection; noise of a sensor appears with its inverse. Residual: RMS of what the modes "
        "leave at a sensor.",
    )


def decay_table(experiment: BeamExperiment) -> Table | None:
    """Every measured free run: release, transient, amplitude, first mode by three methods at three amplitudes."""
    rows = []
    measured = [run for run in experiment.free_runs if not run.is_simulated]
    for run in measured or experiment.free_runs:
        decay = run.first_decay
        if decay is None:
            continue
        transient = 1e3 * (decay.release.transient_end_s - decay.release.release_s)
        amplitude = decay.log_decrement.acceleration_amplitude_m_per_s2
        rows.append(
            (
                run.name,
                run.group,
                text(decay.release.release_s + float(run.time_s[0])),
                f"{transient:.0f} ms" if transient > 0 else "none",
                text(float(amplitude.max()) / GRAVITY_M_PER_S2),
                *(_at_ends(reading) for reading in decay.readings),
            )
        )
    if not rows:
        return None
    header = (
        "run",
        "liquid",
        "release [s]",
        "transient",
        "largest a [g]",
        *(f"ζ₁ by {method} [%]" for method in METHODS),
    )
    note = (
        "ζ₁ at the largest, the middle and the smallest amplitude that may be used, with half the 90 % interval."
    )
    return Table("Free decays", header, tuple(rows), note)


def _at_ends(reading: InstantaneousDamping) -> str:
    places = np.flatnonzero(reading.used)
    if not places.size:
        return MISSING
    order = places[np.argsort(-reading.acceleration_amplitude_m_per_s2[places])]
    chosen = [order[0], order[order.size // 2], order[-1]]
    half = reading.coverage_factor * reading.damping_ratio_std
    return "; ".join(f"{text(100 * reading.damping_ratio[at], 3)} ± {text(100 * half[at], 1)}" for at in chosen)


def pooled_table(experiment: BeamExperiment) -> Table | None:
    """Mean over repeats at round amplitudes, by all methods."""
    rows = []
    for group in experiment.groups:
        for amplitude in _AMPLITUDES_G:
            cells = [_pooled_at(experiment, group, method, amplitude) for method in METHODS]
            if any(cell != MISSING for cell, _ in cells):
                n = max(number for _, number in cells)
                rows.append((group, f"{amplitude:g}", str(n), *(cell for cell, _ in cells)))
    if not rows:
        return None
    return Table(
        "Damping of the first mode over repeats",
        ("liquid", "a [g]", "repeats", *(f"ζ₁ by {method} [%]" for method in METHODS)),
        tuple(rows),
        "Mean over the repeats within an eighth of a decade of amplitude, ± half the 90 % interval of the mean "
        "from the scatter between repeats; no interval with one repeat, and none for twins, which repeat exactly.",
    )


def _pooled_at(experiment: BeamExperiment, group: str, method: str, amplitude_g: float) -> tuple[str, int]:
    pooled = experiment.pooled.get((group, method))
    if pooled is None:
        return MISSING, 0
    distance = np.abs(np.log10(in_g(pooled.acceleration_amplitude_m_per_s2) / amplitude_g))
    at = int(np.argmin(distance))
    if distance[at] > 0.06:
        return MISSING, 0
    mean, n = text(100 * pooled.damping_ratio[at]), int(pooled.n_repeats[at])
    if n < 2 or group not in CONFIGURATIONS:
        return mean, n
    low, high = 100 * pooled.damping_ratio_interval[:, at]
    return f"{mean} ± {text(0.5 * (high - low), 2)}", n


def random_table(experiment: BeamExperiment) -> Table | None:
    """ζ₁ over the RMS of the root (Table 2.5)."""
    rows = []
    for run in experiment.random_runs:
        random = run.random
        if random is None:
            continue
        alone = random.density_fit
        rows.append(
            (
                run.name,
                run.group,
                text(random.root_rms_g, 3),
                f"{text(random.tank_rms_g, 3)} ({text(random.tank_peak_g, 3)})",
                MISSING
                if alone is None
                else _with_interval(alone.damping_ratio, alone.coverage_factor * alone.damping_ratio_std),
                MISSING if alone is None else f"{text(alone.frequency_hz, 4)}",
                _modal_cell(run),
                _published(run),
            )
        )
    if not rows:
        return None
    reasons = [
        f"{run.name}, {experiment.modes.names[fit.mode]}: {fit.reason}"
        for run in experiment.random_runs
        if run.random is not None
        for fit in run.random.fits
        if fit.reason
    ]
    note = f" Not fitted: {'; '.join(reasons[:4])}{' …' if len(reasons) > 4 else ''}." if reasons else ""
    return Table(
        "Damping of the first mode in random motion",
        ("run", "liquid", "RMS of the root [g]", "RMS (peak) of the tank [g]", "ζ₁, response alone [%]", "f₁ [Hz]",
         "ζ₁ from H₁ [%]", "Table 2.5 [%]"),
        tuple(rows),
        "Counterpart of Table 2.5; ± half the 90 % interval. The damping of a liquid depends on the amplitude: "
        "these "
        "are means over a random motion." + note,
    )  # fmt: skip


def _with_interval(value: float, half: float) -> str:
    return f"{text(100 * value)} ± {text(100 * half, 2)}"


def _modal_cell(run: BeamRun) -> str:
    fit = run.random.fits[0].fit if run.random is not None else None
    if fit is None:
        return MISSING
    return _with_interval(float(fit.damping_ratio[0]), fit.coverage_factor * float(fit.damping_ratio_std[0]))


def _published(run: BeamRun) -> str:
    column = {"sloshing": "experiment", "frozen": "frozen"}.get(run.group)
    if column is None or run.random is None:
        return MISSING
    near = [damping for rms, damping in TABLE_2_5[column] if abs(run.random.root_rms_g / rms - 1) < 0.1]
    return f"{near[0]:.2f}" if near else MISSING


def twin_table(experiment: BeamExperiment) -> Table | None:
    """How far the twins are from the recordings that drove them."""
    rows = []
    for measured, simulated in pairs_of(experiment, experiment.runs):
        for run in simulated:
            acceleration, force = relative_error(measured, run)
            own, of_twin = _damping_of_both(measured, run)
            rows.append(
                (
                    measured.name,
                    run.group,
                    text(100 * acceleration, 3),
                    text(100 * force, 3),
                    own,
                    of_twin,
                )
            )
    if not rows:
        return None
    header = ("recording", "twin", "error of ü [%]", "error of F [%]", "ζ₁ measured [%]", "ζ₁ of the twin [%]")
    note = (
        "Error: RMS of the difference over RMS of the recording, over the whole run; a small difference of "
        "frequency makes a large error of a long decay. ζ₁ of decays: local sine fit, mean over the bins of the "
        "recording's amplitude that the twin passes through too, each counted once however long the decay stays "
        "there. ζ₁ of random motion: from the density of the tank."
    )
    return Table("Twins against recordings", header, tuple(rows), note)


def _damping_of_both(measured: BeamRun, simulated: BeamRun) -> tuple[str, str]:
    """ζ₁ [%] of a recording and its twin over the same amplitudes."""
    if measured.random is not None and simulated.random is not None:
        fits = measured.random.density_fit, simulated.random.density_fit
        first, second = (MISSING if fit is None else text(100 * fit.damping_ratio) for fit in fits)
        return first, second
    decays = measured.first_decay, simulated.first_decay
    readings = [decay.local_sine_fit for decay in decays if decay is not None and decay.local_sine_fit.used.any()]
    if len(readings) < 2:
        return MISSING, MISSING
    own, of_twin = mean_at_common_amplitudes(readings[0], readings[1])
    return text(100 * own), text(100 * of_twin)


def run_table(runs: Sequence[BeamRun]) -> Table:
    """All runs with what was done and what was measured."""
    rows = [
        (
            str(number),
            run.name,
            run.attributes.experiment,
            run.group,
            run.level_text,
            text(run.attributes.sampling_rate_hz, 4),
            interval([float(run.time_s[0]), float(run.time_s[-1])]),
            str(len(run.quality.gaps)),
        )
        for number, run in enumerate(runs, start=1)
    ]
    header = ("no.", "run", "experiment", "liquid", "level", "rate [Hz]", "analysed [s]", "gaps")
    return Table("Runs", header, tuple(rows))


def reason_table(experiment: BeamExperiment) -> Table | None:
    """Modes whose decay could not be read, and why."""
    rows = [
        (run.name, experiment.modes.names[decay.mode], decay.reason)
        for run in experiment.free_runs
        for decay in run.decays
        if decay.reason
    ]
    return Table("Modes whose decay was not read", ("run", "mode", "reason"), tuple(rows)) if rows else None


def settings_table(experiment: BeamExperiment) -> Table:
    """What the analysis was told."""
    settings = experiment.settings
    rows = [
        ("modes kept", ", ".join(experiment.modes.names)),
        ("cycles per stretch of envelope and sine fit", str(settings.n_cycles)),
        ("M_dry + m_l beyond the force sensor", f"{experiment.total_mass_kg:.4f} kg"),
    ]
    if experiment.random_runs:
        rows.append(("segments of random runs", f"{settings.segment_s:g} s, Hann window, half overlapping"))
    return Table("Parameters", ("what", "value"), tuple(rows))

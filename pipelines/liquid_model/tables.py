"""Tables of the report of a model."""

from __future__ import annotations

import itertools
from typing import Final

import numpy as np

from pipelines.liquid_model.figures_maps import SYMBOLS
from pipelines.liquid_model.results import ComparedRun, ValidatedModel
from pipelines.report.numbers import MISSING, text
from pipelines.report.tables import Table
from sloshlab.reduced_order_model.fit_quality import FitQuality, fit_quality
from sloshlab.reduced_order_model.repeat_ceiling import FREQUENCY_TOLERANCE, SPEED_TOLERANCE

ACCELERATION_CLASSES_G: Final = (0.0, 0.5, 1.0, 2.0, 3.0, 4.0, 10.0)
WANTED_MAP_ERROR: Final = 0.10
_FEWEST_SAMPLES: Final = 50
_MOST_EXCURSIONS: Final = 12


def fit_table(validated: ValidatedModel) -> Table:
    """Both e_f, free and one step ahead, of every run."""
    rows = []
    for run in validated.runs:
        free, ahead = run.fit(), run.fit(free=False)
        force = run.signals.dynamic_force_n
        rows.append(
            (
                run.role,
                run.name,
                f"{free.fit_percent:.1f}",
                f"{free.fit_percent_as_printed:.1f}",
                f"{ahead.fit_percent:.1f}",
                f"{ahead.fit_percent_as_printed:.1f}",
                text(free.rms_error),
                text(float(np.nanstd(force))),
            )
        )
    feedback = (
        "The model feeds its own outputs back; one step ahead it sees the measured ones."
        if validated.model.has_feedback
        else "The model has no feedback: one step ahead and free run are the same."
    )
    return Table(
        "Fit (2.24)",
        ("role", "run", "e_f free [%]", "as printed", "e_f one step [%]", "as printed", "RMS error [N]",
         "RMS force [N]"),
        tuple(rows),
        "e_f = 100 (1 − ‖y − ŷ‖/‖y − mean y‖), the usual one; (2.24) as printed divides by ‖y − mean ŷ‖. "
        "" + feedback,
    )  # fmt: skip


def amplitude_table(validated: ValidatedModel) -> Table:
    """Fit of the validation runs by acceleration."""
    rows = []
    for low, high in itertools.pairwise(ACCELERATION_CLASSES_G):
        found = _within(validated.of_role("validation"), low, high)
        if found is not None:
            force, quality = found
            rows.append(
                (
                    f"{low:g} … {high:g}",
                    f"{100 * quality.n_samples / max(_n_samples(validated), 1):.0f}",
                    f"{quality.fit_percent:.1f}",
                    text(quality.rms_error),
                    text(force),
                )
            )
    return Table(
        "Fit of the validation by amplitude",
        ("acceleration [g]", "share of time [%]", "e_f free [%]", "RMS error [N]", "RMS force [N]"),
        tuple(rows),
        "By the acceleration of each cycle of the motion.",
    )


def _n_samples(validated: ValidatedModel) -> int:
    return sum(run.signals.dynamic_force_n.size for run in validated.of_role("validation"))


def _within(runs: tuple[ComparedRun, ...], low_g: float, high_g: float) -> tuple[float, FitQuality] | None:
    """RMS of the force, and the fit, over cycles of some acceleration."""
    forces, simulated = [], []
    for run in runs:
        edges = run.cycles.start_s * run.signals.sampling_rate_hz
        cycle = np.searchsorted(edges, np.arange(run.free.size), side="right") - 1
        level = np.where(cycle >= 0, run.cycles.acceleration_g[np.maximum(cycle, 0)], -1.0) if edges.size else None
        if level is not None:
            inside = (level >= low_g) & (level < high_g)
            forces.append(run.signals.dynamic_force_n[inside])
            simulated.append(run.free[inside])
    force, predicted = (np.concatenate(parts) if parts else np.zeros(0) for parts in (forces, simulated))
    if np.isfinite(force + predicted).sum() < _FEWEST_SAMPLES:
        return None
    return float(np.nanstd(force)), fit_quality(force, predicted)


def ceiling_table(validated: ValidatedModel) -> Table:
    """What repeats allow, and what the model does on the same samples."""
    rows = [
        (
            pair.repeats.names[0],
            pair.repeats.names[1],
            f"{pair.repeats.fit().fit_percent:.1f}",
            f"{pair.repeats.fit_of_ideal_model().fit_percent:.1f}",
            f"{pair.model.fit_percent:.1f}",
            text(pair.repeats.fit().rms_error),
            text(pair.model.rms_error),
        )
        for pair in validated.ceiling
    ]
    caption = (
        "Cycles are counted by the phase of the tank's acceleration. Cycle n of a run is paired with the "
        "cycle of its "
        f"repeat at the same time, if frequencies differ by less than {100 * FREQUENCY_TOLERANCE:g} % and "
        "speeds by "
        f"less than {100 * SPEED_TOLERANCE:g} %; at the same share of both cycles, the repeat's force, "
        "limited to the "
        "band of the model, stands in for a prediction. An ideal model knows the mean over very many repeats: if "
        "their scatter is independent, its error is 1/√2 of that of one repeat. All on the same samples."
    )
    if not rows:
        return Table("Ceiling", (), (), f"Not evaluated: {validated.skipped.get('ceiling', 'no repeats')}.")
    return Table(
        "Ceiling set by repeats",
        ("run", "repeat", "e_f of the repeat [%]", "e_f of an ideal model [%]", "e_f of this model [%]",
         "error of the repeat [N]", "error of this model [N]"),
        tuple(rows),
        caption,
    )  # fmt: skip


def map_table(validated: ValidatedModel) -> Table:
    """Errors of the maps."""
    title = "Errors of the maps"
    if validated.maps is None:
        return Table(title, (), (), f"Not evaluated: {validated.skipped.get('maps', 'no maps')}.")
    rows = [
        (
            SYMBOLS[name],
            text(error.largest),
            text(error.rms),
            f"{100 * error.relative_rms:.1f}",
            text(error.mean),
            text(error.rms_of_windows),
        )
        for name, error in validated.maps.errors.items()
    ]
    return Table(
        title,
        ("map", "largest measured", "RMS error", "RMS error [% of largest]", "mean error", "RMS error of windows"),
        tuple(rows),
        f"Predicted − measured over the measured region, {validated.maps.source}; aim: RMS of W̄ at most "
        f"{100 * WANTED_MAP_ERROR:g} % of its largest value. The last column is over the windows "
        "themselves, without "
        "interpolation.",
    )


def residual_table(validated: ValidatedModel) -> Table:
    """Verdicts in words."""
    rows = [
        (
            run,
            test.against,
            f"{test.n_outside} of {test.lags.size}",
            text(float(np.abs(test.correlation).max()), 2),
            f"{100 * test.explained:.1f}",
            test.verdict,
        )
        for run, tests in validated.tests.items()
        for test in tests
    ]  # fmt: skip
    if not rows:
        return Table("Residual", (), (), f"Not tested: {validated.skipped.get('residual', 'no validation run')}.")
    return Table(
        "Tests of the residual",
        ("run", "against", "lags outside", "largest correlation", "explained [%]", "verdict"),
        tuple(rows),
        "Explained: share of the residual's variance that a linear filter over these lags would give. A "
        "residual that "
        "is not white is no fault where the force is not decided by the motion; one that is correlated "
        "with the input "
        "or its powers shows what a better model of the motion would find.",
    )


def excursion_table(validated: ValidatedModel) -> Table:
    """When and where runs leave the training."""
    rows = []
    for run in validated.judged:
        for excursion in sorted(run.excursions, key=lambda excursion: excursion.start_s - excursion.stop_s)[
            :_MOST_EXCURSIONS
        ]:
            rows.append(
                (
                    run.name,
                    f"{excursion.start_s:.2f} … {excursion.stop_s:.2f}",
                    excursion.reason,
                    text(excursion.frequency_hz),
                    text(excursion.speed_m_per_s),
                )
            )
    return Table(
        "Motion outside the training",
        ("run", "time [s]", "reason", "frequency [Hz]", "speed [m/s]"),
        tuple(rows),
        f"The longest {_MOST_EXCURSIONS} stretches of each run; frequency and speed of the cycle farthest out."
        if rows
        else "No validation or test run leaves what the training covered.",
    )


def model_table(validated: ValidatedModel) -> Table:
    """Structure, size and training."""
    model, training = validated.model, validated.training
    delays = model.delays
    rows = [
        ("structure", "NOE" if model.has_feedback else "NFIR"),
        ("network", f"{model.network.kind}, {_settings(model.network.settings())}"),
        ("parameters", str(model.network.n_parameters)),
        ("delays of the velocity", f"{min(delays.inputs)} … {max(delays.inputs)} samples"),
        ("delays of the force", ", ".join(map(str, delays.outputs)) or MISSING),
        ("rate", f"{model.sampling_rate_hz:g} Hz"),
    ]
    if training is not None:
        record, settings = training.record, training.settings
        rows += [
            ("why this rate", training.rate_reason),
            ("starts, seed", f"{settings.n_starts}, {settings.seed}"),
            ("epochs", f"{len(record.epochs)}, at most {settings.n_epochs} per start; {record.ended}"),
            ("kept", f"epoch {record.best.number} of start {record.best.start}"),
        ]
    return Table("Model", ("what", "value"), tuple(rows))


def _settings(settings: dict[str, int | str]) -> str:
    return ", ".join(f"{name.removeprefix('n_')} {value}" for name, value in settings.items())

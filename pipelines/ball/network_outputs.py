"""Writing a network that learnt from a ball: the model, what it was compared with, and the report."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
import xarray as xr

from pipelines.ball import network_figures
from pipelines.ball.network_results import BallNetwork
from pipelines.ball.sections import BALL
from pipelines.report.citations import Citation
from pipelines.report.numbers import MISSING, text
from pipelines.report.outputs import RESULT_ID, provenance_of, report_lines, stamp_of, write_dataset
from pipelines.report.page import Page, write_page
from pipelines.report.result_folder import result_folder
from pipelines.report.sections import FigurePlan, SectionPlan
from pipelines.report.tables import Table, provenance_table
from sloshlab import __version__
from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.quantities import described
from sloshlab.reduced_order_model.storage import save_model

_BANDS_G: Final = ((0.0, 1.0), (1.0, 2.0), (2.0, 4.0), (4.0, 8.0), (8.0, np.inf))
_PRINTED_HOURS: Final = 44
_PAPERS: Final = (
    BALL,
    Citation(
        "training by gradients",
        "D. C. Liu, J. Nocedal: On the limited memory BFGS method for large scale optimization. Mathematical "
        "Programming 45, 503–528 (1989).",
        "10.1007/BF01589116",
    ),
)


def files_of(*, report: bool) -> tuple[str, ...]:
    """Names of the files that are written."""
    return ("ROM.nc", "network.nc", *(["report.html"] if report else []))


def write_ball_network(learnt: BallNetwork, folder: Path, *, command: str, report: bool = True) -> dict[str, Any]:
    """Write `ROM.nc`, `network.nc` and the report; return the summary of the command.

    All files appear together, complete, or none does.
    """
    provenance = provenance_of(command, learnt.inputs, settings=learnt.settings)
    learnt.model.facts[RESULT_ID] = provenance[RESULT_ID]
    with result_folder(folder, provenance) as complete:
        save_model(learnt.model, complete / "ROM.nc")
        write_dataset(_dataset(learnt, provenance), complete / "network.nc")
        if report:
            page = _page(dataclasses.replace(learnt, provenance=provenance))
            write_page(page, complete, result_id=provenance[RESULT_ID])
    best = learnt.record.best
    lines = [
        f"network: {folder / 'ROM.nc'}, {learnt.model.network.n_parameters} parameters",
        f"training: {learnt.record.ended}; kept: step {best.number}",
        f"free run beside the ball: fit {learnt.fit_percent:.1f} %",
        f"ζ(a) of the release: {_sentence(learnt)}",
    ]
    _, to_ball, to_recorded = learnt.damping_errors(0.0, np.inf)
    return {
        "lines": lines + report_lines(folder, written=report),
        "flags": list(learnt.flags),
        "output": str(folder),
        "fit_percent": learnt.fit_percent,
        "damping_error_to_ball_percent": to_ball,
        "damping_error_to_recorded_percent": to_recorded,
        "steps": best.number,
    }


def _sentence(learnt: BallNetwork) -> str:
    _, to_ball, to_recorded = learnt.damping_errors(0.0, np.inf)
    own, recorded = (text(value, 2) for value in (to_ball, to_recorded))
    return f"network − ball {own} % of critical damping (RMS), network − recorded {recorded} %"


def _dataset(learnt: BallNetwork, provenance: dict[str, Any]) -> xr.Dataset:
    """ζ(a) of the three, and the maps."""
    measured = learnt.decays.measured
    at = measured.acceleration_m_per_s2
    along = ("frequency_hz", "amplitude_m")
    variables: dict[str, Any] = {
        "acceleration_amplitude_m_per_s2": ("measured_value", at),
        "damping_ratio": ("measured_value", measured.damping_ratio),
        "ball_damping_ratio": ("measured_value", learnt.with_ball.curve.at(at)),
        "network_damping_ratio": ("measured_value", learnt.with_network.curve.at(at)),
        "loss_factor": (along, learnt.loss.of_ball),
        "network_loss_factor": (along, learnt.loss.of_network),
    }
    coordinates = {"frequency_hz": learnt.loss.frequency_hz, "amplitude_m": learnt.loss.amplitude_m}
    dataset = described(xr.Dataset(variables, coords=coordinates))
    return dataset.assign_attrs(title="Network of a bouncing ball", rig=learnt.rig_name, **stamp_of(provenance))


def _page(learnt: BallNetwork) -> Page:
    draw = network_figures
    sections = (
        ("Training", {"scheme": draw.scheme, "training_path": draw.training_path,
                      "training_errors": draw.training_errors, "open_loop": draw.open_loop}),
        ("In place of the liquid", {"decays": draw.decays}),
        ("What it learnt of the ball", {"loss_factors": draw.loss_factors}),
    )  # fmt: skip
    tables = ((), (_printed_table(learnt),), (_damping_table(learnt), _loss_table(learnt)))
    plans = tuple(
        SectionPlan(
            title, tuple(FigurePlan(name, partial(each, learnt=learnt)) for name, each in figures.items()), own
        )
        for (title, figures), own in zip(sections, tables, strict=True)
    )
    return Page(
        title="Network of a bouncing ball",
        subtitle=f"{learnt.rig_name} · sloshlab {__version__}",
        flags=learnt.flags,
        summary=(
            f"A network that saw nothing but {learnt.motions[0].duration_s:g} s of a bouncing ball follows it by "
            f"e_f = {learnt.fit_percent:.1f} % on another motion.",
            f"In the guided tank, ζ(a): {_sentence(learnt)}.",
        ),
        plans=(*plans, SectionPlan("Provenance", (), (provenance_table(learnt.provenance),))),
        papers=_PAPERS,
    )


def _printed_table(learnt: BallNetwork) -> Table:
    """Appendix C beside this run."""
    settings, best = learnt.settings, learnt.record.best
    minutes = learnt.record.epochs[-1].elapsed_s / 60
    _, to_ball, to_recorded = learnt.damping_errors(0.0, np.inf)
    _, high, _ = learnt.damping_errors(4.0, np.inf)
    _, low, _ = learnt.damping_errors(0.0, 2.0)
    rows = (
        ("run of the ball", "200 s at 1 kHz, pseudo-harmonic",
         f"{settings.duration_s:g} s at {settings.rate_hz:g} Hz", "path not printed; here two slow swings"),
        ("network", "7 × 35, radial, 50 delays", f"{settings.n_layers} × {settings.n_neurons}, radial, "
         f"{settings.n_delays} delays", MISSING),
        ("output", "sloshing force F_S", "Δf = F_S + m_l z̈_T", "the rest is linear, and the twin carries it"),
        ("training", "Bayesian regularisation, 1000 epochs", f"L-BFGS, step {best.number} kept",
         "normal equations of 9 381 parameters are not needed"),
        ("targets", "all samples", f"one in {settings.training.every}", "neighbours say nearly the same"),
        ("time of the training", f"{_PRINTED_HOURS} h", f"{minutes:.1f} min", "as above"),
        ("acceleration of the release", "close to ball and experiment (Fig. C.2a)", "Fig. C.2 below", MISSING),
        ("ζ(a) beside the ball", "matches; better at high accelerations (Fig. C.2b)",
         f"{text(to_ball, 2)} % RMS; above 4 g {text(high, 2)} %, below 2 g {text(low, 2)} %", "none is printed"),
        ("ζ(a) beside the experiment", "reproduced in turn", f"{text(to_recorded, 2)} % RMS",
         "another liquid: that of the recordings given"),
    )  # fmt: skip
    caption = "Differences of ζ in per cent of critical damping."
    return Table("Printed and reached", ("", "printed (Appendix C)", "reached", "why different"), rows, caption)


def _damping_table(learnt: BallNetwork) -> Table:
    rows = []
    for low, high in _BANDS_G:
        n, to_ball, to_recorded = learnt.damping_errors(low, high)
        if n:
            numbers = tuple(text(value, 2) for value in (to_ball, to_recorded))
            rows.append((_band(low, high), str(n), *numbers))
    caption = "RMS differences in per cent of critical damping, at the amplitudes of the recorded values."
    header = ("a", "values", "network − ball", "network − recorded")
    return Table("Damping of the release", header, tuple(rows), caption)


def _loss_table(learnt: BallNetwork) -> Table:
    loss, rows = learnt.loss, []
    acceleration = loss.amplitude_m[None, :] * (2 * np.pi * loss.frequency_hz[:, None]) ** 2 / GRAVITY_M_PER_S2
    most = learnt.motions[0].largest_acceleration_m_per_s2 / GRAVITY_M_PER_S2
    for low, high in _within(most):
        inside = (acceleration >= low) & (acceleration < high) & np.isfinite(loss.of_ball)
        if inside.any():
            own, error = loss.of_ball[inside], loss.error[inside]
            rms = [float(np.sqrt(np.mean(values**2))) for values in (own, error)]
            rows.append((_band(low, high), str(int(inside.sum())), text(rms[0], 2), text(rms[1], 2),
                         text(float(error.mean()), 2)))  # fmt: skip
    header = ("acceleration", "points", "η of the ball, RMS", "error, RMS", "error, mean")
    caption = "Loss factor in steady harmonic motion, network − ball, within the accelerations of the training."
    return Table("Loss factor", header, tuple(rows), caption)


def _within(most: float) -> Iterator[tuple[float, float]]:
    for low, high in _BANDS_G:
        if low < most:
            yield low, min(high, most)


def _band(low: float, high: float) -> str:
    return f"from {low:.3g} g" if np.isinf(high) else f"{low:.3g} … {high:.3g} g"

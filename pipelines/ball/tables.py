"""Tables of the report on a ball."""

from __future__ import annotations

import numpy as np

from pipelines.ball.results import BallExperiment, LineResult
from pipelines.report.numbers import MISSING, signed, text
from pipelines.report.tables import Table
from sloshlab.bouncing_ball.guide import FrozenDecay

_PARAMETERS = {
    "radius_m": ("radius r₀", "m", "r₀/h", "radius"),
    "stiffness_n_per_m": ("stiffness k̂", "N/m", "k̂/(ρ g S ω̄²)", "stiffness"),
    "damping_kg_per_s": ("damping c", "kg/s", "c/(ρ S √(gh) ω̄)", "damping"),
    "hardening_per_m": ("hardening α", "1/m", "α h", "hardening"),
    "beta": ("frozen share β", "1", "β", "beta"),
}


def ball_parameter_table(experiment: BallExperiment) -> Table:
    """Values, intervals and non-dimensional form."""
    plain = experiment.identified.ball.non_dimensional(experiment.rig, experiment.omega_bar)
    rows = []
    for interval in experiment.identified.intervals:
        label, unit, scaled, field = _PARAMETERS[interval.name]
        ends = [text(end, 4) if np.isfinite(end) else "bound" for end in (interval.low, interval.high)]
        rows.append(
            (
                f"{label} [{unit}]",
                text(interval.value, 4),
                f"{ends[0]} … {ends[1]}",
                text(interval.profile_ratio, 2),
                f"at its {interval.at_bound} bound" if interval.at_bound else MISSING,
                f"{scaled} = {text(getattr(plain, field), 4)}",
            )
        )
    law = "always" if experiment.identified.ball.damping_in_flight else "in contact only"
    caption = (
        "90 % intervals: where the sum of squares, with all other parameters fitted again, has grown by t² times "
        "the variance of the residuals; “bound” where it has not at the bound of the search. Profile: that growth "
        "at the ends over the wanted one, far from 1 where the residuals are too rough to follow. Non-dimensional "
        f"by (2.19) at ω̄ = {text(experiment.omega_bar)}. The damper acts {law}."
    )
    header = ("parameter", "value", "90 % interval", "profile", "bound", "non-dimensional")
    return Table("Parameters of the ball", header, tuple(rows), caption)


def guide_table(frozen: FrozenDecay) -> Table:
    """What carries the tank."""
    guide = frozen.guide
    rows = (
        ("stiffness K [N/m]", text(guide.stiffness_n_per_m, 4)),
        ("dry friction b₀ [N]", text(guide.coulomb_force_n, 3)),
        ("viscous damping b₁ [kg/s]", text(guide.damping_kg_per_s, 3)),
    )
    caption = "Fitted to frequency and ζ(a) of the frozen decay, with the masses of the rig file; used throughout."
    return Table("The guide", ("quantity", "value"), rows, caption)


def band_table(result: LineResult) -> Table:
    """Errors at and away from the tuned frequency."""
    rows = tuple(
        (
            f"{band.low:.2f} … {band.high:.2f}" + (" (tuned)" if band.is_tuned else ""),
            str(band.n_windows) + (f" (+ {band.n_outside} outside)" if band.n_outside else ""),
            text(band.measured_rms, 3),
            text(band.ball_rms, 3),
            text(band.error_rms, 2),
            signed(band.error_mean, 2),
            f"{100 * band.relative_error:.0f} %",
        )
        for band in result.bands
    )
    header = ("ω̄", "windows", "W̄ measured, RMS", "W̄ of the ball, RMS", "error, RMS", "error, mean", "relative")
    caption = (
        "W̄ of the ball in steady harmonic motion at frequency and amplitude of each window, minus the "
        "measured one. "
        "The windows of the tuned band are in no other. Relative: RMS error over RMS of the measured W̄."
        + (
            " Outside: the ball leaves its tank, nothing is compared."
            if any(b.n_outside for b in result.bands)
            else ""
        )
    )
    return Table("Error at and away from the tuning frequency", header, rows, caption)


def search_table(experiment: BallExperiment) -> Table:
    """What the search did."""
    found = experiment.identified
    unit = "W̄" if isinstance(experiment.result, LineResult) else "% of critical damping"
    rows = (
        ("values matched", str(found.residuals.size)),
        (f"RMS after the global search [{unit}]", text(found.global_rms, 3)),
        (f"RMS after least squares [{unit}]", text(found.rms, 3)),
        ("simulations", str(found.n_evaluations)),
    )
    return Table("The search", ("quantity", "value"), rows, "Differential evolution, then bounded least squares.")

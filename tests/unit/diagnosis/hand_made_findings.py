"""Findings whose costs are written by hand, in units of the log-likelihood: no simulation is run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import log
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
from recorded_oscillators import effect

from sloshlab.diagnosis import effects
from sloshlab.diagnosis.candidate import Candidate, Surroundings
from sloshlab.diagnosis.case import Case, CaseRun
from sloshlab.diagnosis.explanation import Explanation, Findings
from sloshlab.diagnosis.force_surface import surface_effect
from sloshlab.diagnosis.free_run_problem import FreeRunFit
from sloshlab.diagnosis.split import Split
from sloshlab.diagnosis.verdict import Verdict, verdict_of

assert effects.__all__
N = 10_000
"""Coefficients of the fitted runs, and of the held-out ones."""
PER_NUMBER = 0.5 * log(2 * N)
FRICTION = {"structure.coulomb_friction.force_n": 0.37}
STRIBECK = {
    "structure.stribeck_friction.coulomb_n": 0.3,
    "structure.stribeck_friction.static_n": 0.5,
    "structure.stribeck_friction.stribeck_velocity_m_per_s": 0.02,
}
DRAG = {"structure.quadratic_drag.drag_n_s2_per_m2": 0.8}
OFFSET = {"structure.constant_force.force_n": -0.2}
BOTH_SIDES = {
    "structure.asymmetric_friction.force_up_n": 0.5,
    "structure.asymmetric_friction.force_down_n": 0.2,
}
HUM = {"sensor.mains_hum_60.acceleration_tip.amplitude": 0.25}
NOISE = 1.0
TIP = "acceleration_tip"
AT = Surroundings(
    rig=cast(Any, None),
    twin=cast(Any, None),
    displacement_m=0.02,
    velocity_m_per_s=0.8,
    acceleration_m_per_s2=32.0,
    frequency_hz=6.4,
    force_n=70.0,
    channels={TIP: 16.0, "force_interface": 35.0},
    driving=(),
    sampling_rate_hz=250.0,
    longest_run_s=4.0,
)
AT_ONE_FREQUENCY = replace(AT, has_one_frequency=True)


@dataclass(frozen=True, eq=False)
class HandMade(Findings):
    """Findings without recordings."""

    repeats: bool = False

    @property
    def has_repeats(self) -> bool:
        return self.repeats

    @property
    def held_out_tests(self) -> frozenset[str]:
        return frozenset({"run_2"})

    @property
    def n_fitting(self) -> int:
        return N

    @property
    def n_held_out(self) -> int:
        return N

    def readings(self, explanation: Explanation) -> dict[str, Any]:
        return {}


def candidates_of(values: Mapping[str, float]) -> tuple[Candidate, ...]:
    """Those whose numbers these are, ``block.name[.channel].parameter``."""
    found = []
    for key in dict.fromkeys(name.rpartition(".")[0] for name in values):
        block, name, *channel = key.split(".", 2)
        found.append(Candidate(effect(f"{block}.{name}"), AT, *channel))
    return tuple(found)


SPLIT = Split((), (cast(CaseRun, SimpleNamespace(name="run_2")),), ())


def left(
    fitted: float,
    held_out: float,
    values: Mapping[str, float] | None = None,
    *,
    squares: float | None = None,
    in_one_run: float | None = None,
    in_fitted_run: float | None = None,
    rms: float = NOISE,
    surface: str = "",
    repeatable: Mapping[tuple[str, str], float] | None = None,
) -> Explanation:
    """What leaves so much log-likelihood of the fitted and of the held-out runs unexplained.

    `squares` is the mean square of the one channel, ten for the baseline, one for the rest; `in_one_run` that of
    the held-out run where it differs, `in_fitted_run` that of the fitted one.
    """
    candidates = (Candidate(surface_effect(surface), AT),) if surface else ()
    candidates += candidates_of(values or {})
    names = tuple(values or {})
    cost = N + 2 * fitted
    fit = FreeRunFit(
        candidates, dict(values or {}), cost, cost, 1e-4 * np.eye(len(names)), names, np.ones(len(names))
    )
    squares = squares if squares is not None else NOISE if candidates else 10.0
    by_run = {
        ("run_1", TIP): squares if in_fitted_run is None else in_fitted_run,
        ("run_2", TIP): squares if in_one_run is None else in_one_run,
    }
    return Explanation(fit, N + 2 * held_out, rms, {TIP: squares}, by_run, rms, dict(repeatable or {}))


def findings(
    retuned: Explanation,
    explanations: Sequence[Explanation] = (),
    ceilings: Sequence[Explanation] = (),
    failed: Mapping[str, str] | None = None,
    at: Surroundings = AT,
    repeats: bool = False,
) -> Findings:
    return HandMade(
        cast(Case, None), cast(Any, None), SPLIT, at, [], [],
        left(9e4, 9e4), retuned, list(explanations), list(ceilings), dict(failed or {}), {}, repeats,
    )  # fmt: skip


def judged(*parts: Any, **more: Any) -> Verdict:
    return verdict_of(findings(*parts, **more))


def names(verdict: Verdict) -> list[tuple[str, ...]]:
    return [alternative.names for alternative in verdict.alternatives]


BASELINE = left(500.0, 500.0)
ANY_FORCE = left(0.0, 0.0, surface="structure")

"""Decays under dry friction that scipy made, 0.3 N up and 0.1 N down, and what a search needs of them."""

from __future__ import annotations

from pathlib import Path

from recorded_oscillators import decays, effect, rig, surroundings

from sloshlab.diagnosis import effects
from sloshlab.diagnosis.candidate import Candidate
from sloshlab.diagnosis.explanation import Explanation
from sloshlab.diagnosis.free_run_fit import fitted
from sloshlab.diagnosis.observations import observations
from sloshlab.diagnosis.rig_model import RigModel
from sloshlab.diagnosis.search.fits import Fits

assert effects.__all__
UP_N, DOWN_N = 0.3, 0.1
COULOMB, ASYMMETRIC, STRIBECK, CUBIC, CONSTANT = (
    f"structure.{name}"
    for name in (
        "coulomb_friction",
        "asymmetric_friction",
        "stribeck_friction",
        "cubic_stiffness",
        "constant_force",
    )
)
COULOMB_N = f"{COULOMB}.force_n"
MODE = "structure.missing_mode"


class Decays:
    """Two fitted decays and one that chooses nothing."""

    def __init__(self, folder: Path) -> None:
        runs = decays((0.006, 0.014, 0.01), duration_s=3.0, friction_n=(UP_N, DOWN_N))
        model = RigModel(rig(folder), folder, runs)
        observed = [observations(run, model.compared(run)) for run in runs]
        self.fits = Fits(model, observed[:2], observed[2:], lambda what, done, of: None)
        self.believed = model.believed
        at = surroundings(model)
        self.pool = {key: Candidate(effect(key), at) for key in (COULOMB, ASYMMETRIC, STRIBECK, CUBIC, CONSTANT)}
        self.baseline = fitted(self.fits.problem(), self.believed, n_iterations=6)[0]

    def fit(self, *keys: str, n_iterations: int = 4, **numbers: float) -> Explanation:
        candidates = [self.pool[key] for key in keys]
        start = {
            **self.believed,
            **{name: value for candidate in candidates for name, value in candidate.starts()[0].items()},
        }
        fit, _ = fitted(self.fits.problem(candidates), {**start, **numbers}, n_iterations=n_iterations)
        return self.fits.validated(fit)

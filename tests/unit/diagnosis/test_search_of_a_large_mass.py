"""A mass that moves a resonance by many of its widths: no step from a small one leads there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from recorded_oscillators import MASS_KG, decays, effect, rig, surroundings

from sloshlab.diagnosis import effects
from sloshlab.diagnosis.candidate import Candidate
from sloshlab.diagnosis.free_run_fit import INFLATION_STAGES, coarsely_fitted, fitted, refined
from sloshlab.diagnosis.free_run_problem import FreeRunFit
from sloshlab.diagnosis.observations import observations
from sloshlab.diagnosis.rig_model import RigModel
from sloshlab.diagnosis.search import screening
from sloshlab.diagnosis.search.fits import Fits
from sloshlab.diagnosis.search.screening import ScreenedCandidate, Screening
from sloshlab.diagnosis.search.start_values import starts_of_growing_size

assert effects.__all__
MASS, FRICTION, CUBIC = "structure.mass_error", "structure.coulomb_friction", "structure.cubic_stiffness"
LACKING_KG = -0.32 * MASS_KG


class Light:
    """Decays of an oscillator that is lighter than its rig file says."""

    def __init__(self, folder: Path, mass_kg: float) -> None:
        runs = decays((0.006, 0.014, 0.01), duration_s=3.0, mass_kg=mass_kg)
        model = RigModel(rig(folder), folder, runs)
        observed = [observations(run, model.compared(run)) for run in runs]
        self.fits = Fits(model, observed[:2], observed[2:], lambda what, done, of: None)
        self.pool = [Candidate(effect(key), surroundings(model)) for key in (MASS, FRICTION, CUBIC)]
        self.baseline: FreeRunFit = fitted(self.fits.problem(), model.believed, n_iterations=6)[0]

    def chosen(self) -> list[ScreenedCandidate]:
        jacobian = self.fits.jacobian(self.baseline)
        return Screening(self.fits).chosen(self.baseline, jacobian, self.pool, "", INFLATION_STAGES, is_near=False)


@pytest.fixture(scope="module")
def light(tmp_path_factory: pytest.TempPathFactory) -> Light:
    return Light(tmp_path_factory.mktemp("light"), MASS_KG + LACKING_KG)


def test_a_large_mass_starts_where_it_is_nearest(light: Light, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is kept whatever its score test predicts, and its fit ends at the frequency of what is lighter.

    Decays tell a mass to what is believed of the frequency.
    """
    monkeypatch.setattr(screening, "_MOST_FITTED", 0)
    [screened] = [screened for screened in light.chosen() if screened.candidate.key == MASS]
    assert screened.distant_start is not None
    assert screened.distant_start[f"{MASS}.mass_kg"] == pytest.approx(LACKING_KG, rel=0.25)
    done = refined(coarsely_fitted(light.fits.problem((screened.candidate,)), screened.starts))
    mass_kg = done.values["modal mass of mode 1"] * MASS_KG
    faster = done.values["frequency of mode 1"] ** 2 * mass_kg / (mass_kg + done.values[f"{MASS}.mass_kg"])
    assert faster == pytest.approx(MASS_KG / (MASS_KG + LACKING_KG), rel=2e-3)
    assert done.misfit < 1.2 * light.fits.problem().residual(np.zeros(len(light.baseline.names))).size


def test_no_distant_start_is_sought_beside_a_baseline_that_is_right(tmp_path: Path) -> None:
    assert [
        screened.distant_start for screened in Light(tmp_path, MASS_KG).chosen() if screened.distant_start
    ] == []


def test_only_what_does_no_work_is_sought_at_a_hundred_times_its_size(light: Light) -> None:
    sizes = {
        candidate.key: [next(iter(start.values())) for start in starts_of_growing_size(candidate)]
        for candidate in light.pool
    }
    assert sizes[FRICTION] == []
    first = next(iter(light.pool[0].starts()[0].values()))
    assert min(sizes[MASS], key=abs) == pytest.approx(1.5 * first)
    assert max(sizes[MASS]) == pytest.approx(1.5**11 * first)
    assert min(sizes[MASS]) == pytest.approx(-(1.5**11) * first)
    assert sizes[CUBIC]

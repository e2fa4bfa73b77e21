"""The sparse regression: terms that are in the equation of a motion are found, with their numbers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from recorded_oscillators import decays, rig
from scipy.integrate import solve_ivp

from sloshlab.identification.case import Case
from studies.rivals.baseline import retuned
from studies.rivals.libraries import LIBRARIES, STRUCTURE, STRUCTURE_TERMS, Motion, columns, names_of
from studies.rivals.regressed_models import GaussNewtonStep, regressed_models, sequentially_thresholded

MASS, DAMPING, STIFFNESS, CUBIC = 2.0, 1.5, 4000.0, 3.0e6


def _duffing(level_n: float) -> tuple[Motion, np.ndarray]:
    """m ẍ + c ẋ + k x + k₃ x³ = F cos ωt, and m ẍ + c ẋ + k x − F cos ωt, which is −k₃ x³."""
    omega, time = 2 * np.pi * 6.5, np.arange(4000) / 500

    def rates(t: float, y: np.ndarray) -> list[float]:
        force = level_n * np.cos(omega * t) - DAMPING * y[1] - STIFFNESS * y[0] - CUBIC * y[0] ** 3
        return [y[1], force / MASS]

    x, v = solve_ivp(rates, (0, time[-1]), [0.0, 0.0], t_eval=time, rtol=1e-9, atol=1e-12).y
    a = np.array([rates(t, y)[1] for t, y in zip(time, np.stack([x, v], axis=1), strict=True)])
    largest = (np.abs(x).max(), np.abs(v).max(), np.abs(a).max())
    return Motion(x, v, a, time, largest), MASS * a + DAMPING * v + STIFFNESS * x - level_n * np.cos(omega * time)


def test_stlsq_finds_the_cubic_spring_of_a_duffing_oscillator() -> None:
    pytest.importorskip("pysindy")
    motions, forces = zip(*(_duffing(level) for level in (4.0, 12.0)), strict=True)
    table = np.concatenate([columns(STRUCTURE_TERMS, motion) for motion in motions])
    force = np.concatenate(forces)
    noise = 0.05 * force.std() * np.random.default_rng(3).normal(size=force.size)
    found = dict(
        zip(
            [term.name for term in STRUCTURE_TERMS],
            sequentially_thresholded(table, force + noise, 0.3),
            strict=True,
        )
    )
    assert {name for name, value in found.items() if value} == {"x³"}
    # A ridge of a thousandth of the power of the column, and noise of a twentieth over 8000 samples.
    assert found["x³"] == pytest.approx(-CUBIC, rel=5e-3)


def test_stlsq_of_no_samples_or_of_no_force_has_no_terms() -> None:
    pytest.importorskip("pysindy")
    assert sequentially_thresholded(np.empty((0, 0)), np.empty(0), 0.1).size == 0
    assert not sequentially_thresholded(np.ones((10, 2)), np.zeros(10), 0.1).any()


@pytest.mark.parametrize(
    ("place", "shares", "names"),
    [
        ("structure", {"x³": 1.0, "x": 2.0, "a": 3.0}, ("cubic_stiffness",)),
        ("structure", {"v": 1.0, "x": 0.5}, ("viscous_damping",)),
        ("structure", {"v": 0.5, "x": 1.0}, ()),
        ("structure", {"1": 0.3, "sign v": 1.0}, ("asymmetric_friction",)),
        ("structure", {"1": 1.0}, ("constant_force",)),
        ("structure", {"sign v": 1.0, "sign v exp −(10 v/v̂)²": 0.4}, ("stribeck_friction",)),
        ("structure", {"x beyond 0.3 x̂": 1.0, "x beyond 0.6 x̂": 1.0}, ("clearance",)),
        ("tank", {"a": 1.0, "t a": 0.2}, ("liquid_loss",)),
        ("tank", {"a": 1.0, "v": 0.2}, ("mass_error",)),
        ("sensor", {"y³": 1.0}, ()),
        ("sensor", {"y": 0.1, "dy/dt": 1.0}, ("sensor_delay",)),
        ("sensor", {"dy/dt": 1.0, "∫y": 1.0}, ("sensor_delay", "sensor_high_pass")),
    ],
)
def test_terms_have_the_names_that_were_fixed(
    place: str, shares: dict[str, float], names: tuple[str, ...]
) -> None:
    assert names_of(place, shares) == names


def test_every_named_term_is_in_the_vocabulary() -> None:
    from sloshlab.missing_physics.candidate import known_effects

    known = {(effect.block, effect.known_as) for effect in known_effects()}
    named = {(place, term.effect) for place, terms in LIBRARIES.items() for term in terms if term.effect}
    assert named <= known


def test_amplitude_of_a_steady_sine_is_its_amplitude() -> None:
    time = np.arange(4000) / 400
    a = 3.0 * np.sin(2 * np.pi * 8 * time)
    amplitude = Motion(a, a, a, time, (3.0, 3.0, 6.0)).amplitude
    # Half a second is four periods: the mean square is a²/2 but at the ends.
    assert amplitude[400:-400] == pytest.approx(0.5, rel=1e-2)


def test_a_missing_spring_of_recorded_decays_is_named_with_its_number(tmp_path: Path) -> None:
    """The residuals of three decays are those of k₃ x³: noise is all that is left, and k₃ is the hidden one."""
    pytest.importorskip("pysindy")
    cubic = 6.0e4
    runs = decays((0.006, 0.010, 0.014), force=lambda t, x, v: -cubic * x**3)
    found = retuned(Case("case", tmp_path, rig(tmp_path), tuple(runs)))
    models = regressed_models(found)
    assert found.retuned.held_out_rms > 1.5
    alone = [model for model in models if [term.term for term in model.terms] == ["x³"]]
    assert [model.names for model in alone] == [((STRUCTURE, "cubic_stiffness"),)]
    # The step is linear about a baseline whose frequency is off by what the spring adds.
    assert alone[0].terms[0].coefficient == pytest.approx(-cubic, rel=0.05)
    assert alone[0].judged < 1.2
    named = [model for model in models if len(model.names) == 1]
    assert min(named, key=lambda model: model.judged).names == ((STRUCTURE, "cubic_stiffness"),)


def test_a_step_without_terms_leaves_what_the_retuned_baseline_leaves(tmp_path: Path) -> None:
    runs = decays((0.006, 0.010, 0.014), friction_n=(0.05, 0.05))
    found = retuned(Case("case", tmp_path, rig(tmp_path), tuple(runs)))
    after = GaussNewtonStep(found, []).model((), None)
    # The retuned baseline is the optimum already: its fit ends where a step gains less than 3e-5 of the cost.
    assert after.fitted == pytest.approx(found.retuned.fitted_rms**2, rel=1e-3)

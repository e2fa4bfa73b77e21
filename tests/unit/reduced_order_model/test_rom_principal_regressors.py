"""Training along the directions in which regressors vary: closed forms, distances kept, gaps, the same fit."""

from __future__ import annotations

import numpy as np
import pytest

from sloshlab.reduced_order_model.fit_quality import fit_quality
from sloshlab.reduced_order_model.networks.radial_basis import NormalisedRadialBasis, RadialBasis
from sloshlab.reduced_order_model.principal_regressors import along, principal_directions
from sloshlab.reduced_order_model.regressors import Delays, Run, regressors
from sloshlab.reduced_order_model.training import TrainingSettings, _with_fewer_regressors, fit

DELAYS = Delays.tapped(16)


def tones(n: int = 6000, seed: int = 0) -> Run:
    """Two sines and what a saturating force makes of them."""
    t = np.arange(n) + 1000.0 * seed
    x = np.sin(0.11 * t) + 0.6 * np.sin(0.29 * t + 0.4)
    return Run(x, np.tanh(1.5 * np.roll(x, 3)) + 0.2 * np.roll(x, 1))


def test_two_sines_have_four_directions() -> None:
    """Delayed values of a sine are a combination of its sine and cosine, whatever the delay."""
    basis = principal_directions([tones()], DELAYS)
    assert basis.shape == (16, 4)
    np.testing.assert_allclose(basis.T @ basis, np.eye(4), atol=1e-12)
    d = np.arange(1, 17)
    known = np.stack([f(w * d) for w in (0.11, 0.29) for f in (np.sin, np.cos)])
    np.testing.assert_allclose(known @ basis @ basis.T, known, atol=1e-9)


def test_white_noise_keeps_all_its_directions() -> None:
    x = np.random.default_rng(2).standard_normal(4000)
    assert principal_directions([Run(x, x)], DELAYS).shape == (16, 16)


def test_regressors_along_the_basis_are_known_where_all_of_them_are() -> None:
    run = tones(300)
    x = run.x.copy()
    x[100] = np.nan
    gappy, basis = Run(x, run.y), principal_directions([run], DELAYS)
    states = along(basis, gappy, DELAYS).states
    assert states is not None
    known = np.isfinite(states).all(axis=0)
    # the first 16 samples, and the 16 that see the gap, have no whole line of delays
    at = np.flatnonzero(known)
    np.testing.assert_allclose(states[:, at[:50]], basis.T @ regressors(gappy, DELAYS, at[0], at[50]), atol=1e-12)
    assert not known[:16].any()
    assert not known[101:117].any()
    assert known[16:100].all()
    assert known[117:].all()


@pytest.mark.parametrize("kind", [NormalisedRadialBasis, RadialBasis])
def test_a_lifted_network_says_the_same_of_all_regressors(kind: type) -> None:
    run, rng = tones(400), np.random.default_rng(5)
    basis = principal_directions([run], DELAYS)
    whole = kind(16, 5)
    fewer = whole.along(4)
    theta = rng.normal(size=fewer.n_parameters)
    phi = regressors(run, DELAYS, 16, 400)
    np.testing.assert_allclose(
        whole.output(np, whole.lifted(theta, basis), phi), fewer.output(np, theta, basis.T @ phi), atol=1e-8
    )


def test_a_model_trained_along_few_directions_fits_as_well(monkeypatch: pytest.MonkeyPatch) -> None:
    def trained() -> float:
        model, _ = fit(
            "normalised_rbf", {"n_neurons": 6}, DELAYS, [tones()], [tones(2000, 3)], sampling_rate_hz=100.0,
            settings=TrainingSettings(n_epochs=12),
        )  # fmt: skip
        assert model.network.n_inputs == 16
        run = tones(2000, 7)
        return float(fit_quality(run.y, model.simulate(run.x)).fit_percent)

    few = trained()
    monkeypatch.setattr("sloshlab.reduced_order_model.training._with_fewer_regressors", lambda task: (task, None))
    assert few > trained() - 1.0
    assert few > 90.0


def test_feedback_and_signals_that_fill_their_space_stay_as_they_are() -> None:
    from sloshlab.reduced_order_model.array_backend import array_backend
    from sloshlab.reduced_order_model.training import _Task

    noise = Run(np.random.default_rng(1).standard_normal(3000), np.zeros(3000))
    for run, delays in ((noise, DELAYS), (tones(), Delays.tapped(8, 8))):
        task = _Task(NormalisedRadialBasis(16, 3), delays, [run], [run], 1.0, array_backend())
        assert _with_fewer_regressors(task) == (task, None)

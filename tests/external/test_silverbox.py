"""The Silverbox, an electronic oscillator with a hardening spring: a free run on signals that training never saw.

Split and score are those of the benchmark (nonlinearbenchmark.org): the multisine of `SNLS80mV` but its last
quarter for everything that is chosen, the last quarter and the arrow for the score, of which the first 50 samples
are left out. Delays, neurons and spread were chosen by the seventh realisation (docs, "Public benchmarks").
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.io import loadmat

from sloshlab.reduced_order_model.fit_quality import fit_quality
from sloshlab.reduced_order_model.model import ReducedOrderModel
from sloshlab.reduced_order_model.regressors import Delays, Run
from sloshlab.reduced_order_model.training import TrainingSettings, fit

pytestmark = pytest.mark.external

RATE_HZ = 1e7 / 2**14
MULTISINE, SHARE_FOR_TRAINING = slice(40_650, 127_400), 0.75
ARROW, WITHOUT_EXTRAPOLATION = slice(100, 40_575), slice(100, 32_100)
REALISATION = 8692
"""Samples from the beginning of one realisation of the multisine to that of the next."""
N_KNOWN = 50
"""Outputs at the beginning that a model may see, and that do not count."""

Signals = tuple[NDArray[np.float64], NDArray[np.float64]]


@pytest.fixture(scope="module")
def record(external_data: Path) -> Signals:
    source = external_data / "silverbox" / "SNLS80mV.mat"
    if not source.is_file():
        pytest.skip(f"no {source.name} among the recordings of other laboratories")
    content = loadmat(source)
    return content["V1"].ravel().astype(float), content["V2"].ravel().astype(float)


@pytest.fixture(scope="module")
def model(record: Signals) -> ReducedOrderModel:
    x, y = (signal[MULTISINE] for signal in record)
    end = int(SHARE_FOR_TRAINING * x.size)
    training = Run.of(x[: 4 * REALISATION], y[: 4 * REALISATION])
    validation = Run.of(x[6 * REALISATION : end], y[6 * REALISATION : end])
    trained, _ = fit(
        "normalised_rbf",
        {"n_neurons": 20},
        Delays.tapped(2, 2, with_present=True),
        [training],
        [validation],
        RATE_HZ,
        TrainingSettings(n_epochs=40, input_spread=1.0),
    )
    return trained


def error_mv(model: ReducedOrderModel, x: NDArray[np.float64], y: NDArray[np.float64]) -> float:
    """RMS error of a free run [mV]; the model is given the first outputs only."""
    known = np.where(np.arange(y.size) < N_KNOWN, y, 0.0)
    simulated = model.simulate(x, known)
    return 1e3 * fit_quality(y[N_KNOWN:], simulated[N_KNOWN:]).rms_error


def test_multisine(model: ReducedOrderModel, record: Signals) -> None:
    """A polynomial NARX has 0.64 mV, a linear model 6.96 mV."""
    x, y = (signal[MULTISINE] for signal in record)
    first = int(SHARE_FOR_TRAINING * x.size)
    error = error_mv(model, x[first:], y[first:])
    print(f"multisine {error:.3f} mV")
    assert error <= 0.64


@pytest.mark.parametrize("part", [ARROW, WITHOUT_EXTRAPOLATION], ids=["whole", "without extrapolation"])
def test_arrow(model: ReducedOrderModel, record: Signals, part: slice) -> None:
    """A polynomial NARX has 2.25 mV, a linear model 14.4 mV; the last fifth exceeds what training saw."""
    x, y = (signal[part] for signal in record)
    error = error_mv(model, x, y)
    print(f"arrow {part} {error:.3f} mV")
    assert error <= 2.2


def test_a_linear_model_is_far_worse(record: Signals) -> None:
    """The task is not an easy one: least squares on the same regressors, running free."""
    x, y = (signal[MULTISINE] for signal in record)
    first = int(SHARE_FOR_TRAINING * x.size)

    def rows(u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.stack([u[2:], u[1:-1], u[:-2], v[1:-1], v[:-2], np.ones(u.size - 2)], axis=1)

    weights = np.linalg.lstsq(rows(x[:first], y[:first]), y[2:first], rcond=None)[0]
    u, v = x[first:], y[first:]
    simulated = v[:2].tolist()
    for k in range(2, u.size):
        simulated.append(weights @ np.array([u[k], u[k - 1], u[k - 2], simulated[-1], simulated[-2], 1.0]))
    error = 1e3 * fit_quality(v[N_KNOWN:], simulated[N_KNOWN:]).rms_error
    print(f"linear {error:.2f} mV")
    assert error > 5

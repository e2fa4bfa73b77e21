"""The Silverbox benchmark: `python silverbox.py SNLS80mV.mat` trains a model and scores its free run.

Split and score are those of nonlinearbenchmark.org: of the multisine everything but the last quarter is for
training and for every choice; the last quarter and the arrow are for the score, without the first 50 samples.
"""

import sys
from pathlib import Path

import numpy as np
from scipy.io import loadmat

from sloshlab.reduced_order_model.fit_quality import fit_quality
from sloshlab.reduced_order_model.regressors import Delays, Run
from sloshlab.reduced_order_model.training import TrainingSettings, fit

RATE_HZ = 1e7 / 2**14
MULTISINE, ARROW, WITHOUT_EXTRAPOLATION = slice(40_650, 127_400), slice(100, 40_575), slice(100, 32_100)
SHARE_FOR_TRAINING = 0.75
REALISATION = 8692  # samples from the beginning of one realisation of the multisine to that of the next
N_KNOWN = 50  # outputs at the beginning that a model may see, and that do not count


def signals(path):
    """Return input and output of a record [V]."""
    content = loadmat(path)
    return content["V1"].ravel().astype(float), content["V2"].ravel().astype(float)


def trained(x, y, *, neurons=20, delays=2, spread=1.0, epochs=150):
    """Train on four realisations of the multisine, validate with the seventh and what follows before the test."""
    x, y = x[MULTISINE], y[MULTISINE]
    end = int(SHARE_FOR_TRAINING * x.size)
    training = Run.of(x[: 4 * REALISATION], y[: 4 * REALISATION])
    validation = Run.of(x[6 * REALISATION : end], y[6 * REALISATION : end])
    return fit(
        "normalised_rbf",
        {"n_neurons": neurons},
        Delays.tapped(delays, delays, with_present=True),
        [training],
        [validation],
        sampling_rate_hz=RATE_HZ,
        settings=TrainingSettings(n_epochs=epochs, input_spread=spread, least_gain=0.0),
    )


def error_mv(model, x, y):
    """Return the RMS error of a free run [mV]; of the outputs the model is given the first ones only."""
    known = np.where(np.arange(y.size) < N_KNOWN, y, 0.0)
    return 1e3 * fit_quality(y[N_KNOWN:], model.simulate(x, known)[N_KNOWN:]).rms_error


def scores(model, x, y):
    """Return the errors on the test data [mV], by name."""
    first = MULTISINE.start + int(SHARE_FOR_TRAINING * (MULTISINE.stop - MULTISINE.start))
    parts = {
        "multisine": slice(first, MULTISINE.stop),
        "arrow": ARROW,
        "arrow without extrapolation": WITHOUT_EXTRAPOLATION,
    }
    return {name: error_mv(model, x[part], y[part]) for name, part in parts.items()}


def main(path):
    """Train once and write the scores."""
    x, y = signals(path)
    model, record = trained(x, y)
    sys.stdout.write(f"validation: {1e3 * record.best.validation_mse**0.5:.3f} mV, {record.ended}\n")
    for name, error in scores(model, x, y).items():
        sys.stdout.write(f"{name}: {error:.3f} mV\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))

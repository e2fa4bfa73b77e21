"""Training of the reduced-order model: time, memory, and the same task given to other packages.

The task is NFIR with 70 delays and 35 neurons on 480 s of the numerical tank, validated on 240 s, at the rate of
the recordings, on two cores. Rivals see the same regressors, scaled in the same way, for as long as ours took, and
keep their best epoch by the same validation run; those that are not installed are left out and named. Every
measurement runs in a process of its own: `python -m tests.benchmarks.reduced_order_model WHAT` prints JSON.
"""

from __future__ import annotations

import importlib.util
import json
import resource
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.reduced_order_model.fit_quality import fit_quality
from sloshlab.reduced_order_model.regressors import Delays, Run, blocks
from tests.benchmarks.own_process import measured_apart

FloatArray = NDArray[np.float64]
RECORDINGS: Final = Path("raw_data/numerical_tank/shaker")
N_DELAYS, N_NEURONS, SPREAD = 70, 35, 2.0
DELAYS: Final = Delays.tapped(N_DELAYS)
TIME_LABEL: Final = "reduced-order model: NFIR 70×35 on 480 s [s]"
MEMORY_LABEL: Final = "reduced-order model: its peak memory [GB]"
RIVALS: Final = {"scikit-learn": "sklearn", "PyTorch": "torch"}
TWO_CORES: Final = {
    name: "2" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
}


def model_figures() -> dict[str, float]:
    """Time and memory of the training, and the fit and the time of every rival that is installed."""
    print("training NFIR 70×35 …", flush=True)
    ours = _measured("ours")
    figures = {
        TIME_LABEL: ours["training_s"],
        MEMORY_LABEL: ours["peak_gb"],
        "reduced-order model: epochs": ours["epochs"],
        "reduced-order model: time per epoch [s]": ours["epoch_s"],
        "reduced-order model: fit on the validation run [%]": ours["fit_percent"],
    }
    for name, module in RIVALS.items():
        if importlib.util.find_spec(module) is None:
            print(f"{name} is not installed: left out; remedy: pip install -e '.[peers]'", flush=True)
            continue
        print(f"{name} on the same data for {ours['training_s']:.0f} s …", flush=True)
        rival = _measured(module, ours["training_s"])
        figures |= {
            f"reduced-order model: {name}, fit on the validation run [%]": rival["fit_percent"],
            f"reduced-order model: {name}, best fit after [s]": rival["best_after_s"],
            f"reduced-order model: {name}, epochs": rival["epochs"],
        }
    return figures


def _measured(what: str, *arguments: object) -> dict[str, float]:
    return measured_apart("tests.benchmarks.reduced_order_model", what, *arguments, environment=TWO_CORES)


def signals() -> tuple[Run, Run, float]:
    """Runs for training and validation, and their rate."""
    from sloshlab.recording import read_recording
    from sloshlab.reduced_order_model.liquid_signals import liquid_signals
    from sloshlab.rig import Rig

    rig = Rig.from_toml(RECORDINGS / "rig_fill_0.50.toml")
    training, validation = (
        liquid_signals(read_recording(RECORDINGS / f"fill_0.50_vfa_{duration}s.nc"), rig)
        for duration in (480, 240)
    )
    return training.run(), validation.run(), training.sampling_rate_hz


def ours() -> dict[str, float]:
    """Train once."""
    from sloshlab.reduced_order_model.training import Epoch, TrainingSettings, fit

    training, validation, rate_hz = signals()
    times: list[float] = []

    def after_epoch(epoch: Epoch) -> None:
        times.append(time.perf_counter())
        print(f"{epoch.number} {epoch.training_mse:.5f} {epoch.validation_mse:.5f}", flush=True)

    started = time.perf_counter()
    model, record = fit(
        "normalised_rbf", {"n_neurons": N_NEURONS}, DELAYS, [training], [validation], sampling_rate_hz=rate_hz,
        settings=TrainingSettings(input_spread=SPREAD), on_epoch=after_epoch,
    )  # fmt: skip
    training_s = time.perf_counter() - started
    return {
        "training_s": training_s,
        "epochs": len(record.epochs) - 1,
        "epoch_s": float(np.median(np.diff(times))),
        "peak_gb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9,
        "fit_percent": fit_quality(validation.y, model.simulate(validation.x)).fit_percent,
    }


def rival_data() -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Regressors, one row per sample, and outputs, all of unit variance, for training and validation."""
    training, validation, _ = signals()
    sizes = [values.std() for values in (training.x, training.y)]
    found = []
    for run in (training, validation):
        scaled = Run(run.x / sizes[0], run.y / sizes[1])
        parts = list(blocks([scaled], DELAYS, scaled.x.size))
        found += [np.ascontiguousarray(parts[0][0].T), parts[0][1]]
    return found[0], found[1], found[2], found[3]


def contest(
    epochs: Iterator[Callable[[FloatArray], FloatArray]], budget_s: float, phi: FloatArray, y: FloatArray
) -> dict[str, float]:
    """Take epochs until the time is used up; keep the best fit on the validation run, untimed."""
    used, n_epochs, best, best_after_s = 0.0, 0, -np.inf, 0.0
    while used < budget_s:
        started = time.perf_counter()
        predicted = next(epochs)
        used += time.perf_counter() - started
        n_epochs += 1
        fit = fit_quality(y, predicted(phi)).fit_percent
        print(f"{n_epochs} {used:.1f} {fit:.2f}", flush=True)
        if fit > best:
            best, best_after_s = fit, used
    return {"fit_percent": best, "best_after_s": best_after_s, "epochs": n_epochs}


def sklearn(budget_s: str) -> dict[str, float]:
    """`MLPRegressor` with one layer of 35 neurons and its own defaults (Adam)."""
    from sklearn.neural_network import MLPRegressor

    phi, y, phi_validation, y_validation = rival_data()
    network = MLPRegressor(hidden_layer_sizes=(N_NEURONS,), random_state=0)

    def epochs() -> Iterator[Callable[[FloatArray], FloatArray]]:
        while True:
            network.partial_fit(phi, y)
            yield network.predict

    return contest(epochs(), float(budget_s), phi_validation, y_validation)


def torch(budget_s: str) -> dict[str, float]:
    """The same network and start as ours by Adam, batches of 256 samples, step 0.001, double precision."""
    import torch as library

    phi, y, phi_validation, y_validation = rival_data()
    library.manual_seed(0)
    library.set_num_threads(2)
    scale = SPREAD / np.sqrt(N_DELAYS)
    inputs, outputs = library.from_numpy(phi * scale), library.from_numpy(y)
    chosen = library.randperm(len(outputs))[:N_NEURONS]
    centres, weights = (values[chosen].clone().requires_grad_() for values in (inputs, outputs))
    optimiser = library.optim.Adam([centres, weights], lr=1e-3)

    def output(x: Any) -> Any:
        exponents = 2 * x @ centres.T - (centres * centres).sum(1)
        return library.softmax(exponents, dim=1) @ weights

    def predicted(values: FloatArray) -> FloatArray:
        with library.no_grad():
            return output(library.from_numpy(values * scale)).numpy()

    def epochs() -> Iterator[Callable[[FloatArray], FloatArray]]:
        while True:
            for batch in library.randperm(len(outputs)).split(256):
                optimiser.zero_grad()
                ((output(inputs[batch]) - outputs[batch]) ** 2).mean().backward()
                optimiser.step()
            yield predicted

    return contest(epochs(), float(budget_s), phi_validation, y_validation)


if __name__ == "__main__":
    measurements = {"ours": ours, "sklearn": sklearn, "torch": torch}
    print(json.dumps(measurements[sys.argv[1]](*sys.argv[2:])))

"""Modal fit of a random run, beside stochastic subspace identification by pyOMA2, and beside its spectra alone.

Ten minutes of two modes at three sensors, sampled at 50 Hz, in several draws of excitation and noise. The fit of
H₁ knows the excitation; that of the density of one sensor and pyOMA2 do not. pyOMA2 is left out, and named, where
it is not installed.
"""

from __future__ import annotations

import contextlib
import io
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy import signal as signals

from sloshlab.modal.modal_fit import modal_fit_of_spectra
from sloshlab.modal.output_only_fit import fit_density
from sloshlab.modal.spectra import random_spectra
from tests.benchmarks.measurements import best_in_turn

FloatArray = NDArray[np.float64]
FIT_LABEL: Final = "modal fit of ten minutes of random motion, three sensors [s]"
RATE_HZ, DURATION_S, SEGMENT = 50.0, 600.0, 1500
FREQUENCIES_HZ, DAMPING_RATIOS = (10.87, 17.0), (0.015, 0.02)
SHAPES: Final = np.array([[1.0, 1.0], [0.65, -0.9], [0.33, -1.5]])
NOISE: Final = 0.05
"""Standard deviation of the sensors' noise over that of all responses."""
N_DRAWS: Final = 20


@dataclass(frozen=True)
class RandomRun:
    """What excites, shape (n,), and what sensors read, shape (3, n)."""

    excitation: FloatArray
    measured: FloatArray


def random_run(seed: int) -> RandomRun:
    """Two modes as sampled poles, which white noise excites.

    Parameters
    ----------
    seed : int
    """
    generator = np.random.default_rng(seed)
    excitation = generator.normal(size=round(DURATION_S * RATE_HZ))
    modal = []
    for frequency, damping in zip(FREQUENCIES_HZ, DAMPING_RATIOS, strict=True):
        omega = 2 * np.pi * frequency
        pole = np.exp((-damping * omega + 1j * omega * np.sqrt(1 - damping**2)) / RATE_HZ)
        numerator = [0.0, -2 * (0.7j * np.conj(pole)).real]
        modal.append(signals.lfilter(numerator, [1.0, -2 * pole.real, abs(pole) ** 2], excitation))
    clean = np.asarray(SHAPES @ np.array(modal))
    return RandomRun(excitation, clean + NOISE * clean.std() * generator.normal(size=clean.shape))


def by_transfer(run: RandomRun) -> FloatArray:
    """Damping ratios of both modes by H₁ of all sensors."""
    spectra = random_spectra(run.excitation, run.measured, RATE_HZ, segment_length=SEGMENT)
    return np.asarray(modal_fit_of_spectra(spectra, n_modes=2, frequency_range_hz=(7.0, 22.0)).damping_ratio)


def by_density(run: RandomRun) -> FloatArray:
    """Damping ratio of the first mode by the density of the first sensor alone."""
    spectra = random_spectra(run.excitation, run.measured, RATE_HZ, segment_length=SEGMENT)
    found = fit_density(
        spectra.frequency_hz,
        spectra.output_psd[0],
        frequency_range_hz=(8.0, 13.5),
        n_effective_averages=spectra.normalisation.n_effective_averages,
    )
    return np.array([found.damping_ratio])


_Method = Callable[[RandomRun], FloatArray]


def by_pyoma2() -> _Method | None:
    """Damping ratios of both modes by covariance-driven subspaces of all sensors; None without pyOMA2."""
    with _quiet():
        try:
            # at the level of the module it would have to be installed
            from pyoma2.algorithms import SSI
            from pyoma2.setup import SingleSetup
        except ImportError:
            return None

    def fit(run: RandomRun) -> FloatArray:
        with _quiet():
            setup: Any = SingleSetup(run.measured.T, RATE_HZ)
            algorithm = SSI(name="ssi", br=40, ordmax=12, calc_unc=False)
            setup.add_algorithms(algorithm)
            setup.run_by_name("ssi")
            setup.mpe("ssi", sel_freq=list(FREQUENCIES_HZ), order_in=8)
        return np.ravel(algorithm.result.Xi)

    return fit


def modal_figures() -> dict[str, float]:
    """Times in turn, best of five, and errors of the first mode's damping over all draws."""
    run = random_run(0)
    methods: dict[str, _Method] = {"H₁ of all sensors": by_transfer, "density of one sensor": by_density}
    peer = by_pyoma2()
    if peer is None:
        print("pyOMA2 is not installed: left out; remedy: pip install -e '.[peers]'", flush=True)
    else:
        methods["pyOMA2 (SSI)"] = peer
    actions: dict[str, Callable[[], object]] = {name: partial(method, run) for name, method in methods.items()}
    actions["spectra"] = lambda: random_spectra(run.excitation, run.measured, RATE_HZ, segment_length=SEGMENT)
    for action in actions.values():
        action()
    times = best_in_turn(actions, 5)
    ours = times["H₁ of all sensors"]
    figures = {FIT_LABEL: ours, "modal fit over its spectra alone": ours / times["spectra"]}
    if peer is not None:
        figures["modal fit: pyOMA2's time over ours"] = times["pyOMA2 (SSI)"] / ours
    runs = [random_run(seed) for seed in range(1, 1 + N_DRAWS)]
    for name, method in methods.items():
        errors = [method(each)[0] / DAMPING_RATIOS[0] - 1 for each in runs]
        figures[f"modal fit: {name}, RMS error of ζ₁ [%]"] = 100 * float(np.sqrt(np.mean(np.square(errors))))
    return figures


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Without the warnings and the progress of the peer, and with the handling of numerical errors as it was."""
    before = np.geterr()
    with warnings.catch_warnings(), contextlib.redirect_stderr(io.StringIO()):
        warnings.simplefilter("ignore")
        yield
    np.seterr(**before)

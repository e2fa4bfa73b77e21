"""How exact a simulation with contacts can be: by how much motions differ that are as likely.

Bounces and other contacts magnify from one to the next what two motions differ by: the noise of the accelerometers
that drive, and numbers that are known to a hundredth at best. They part for seconds and may meet again. No
simulation follows a rig where this happens, and what it leaves there is not missing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.errors import SloshlabError
from sloshlab.identification.case import CaseRun
from sloshlab.identification.diagnosed_model import EXACT, DiagnosedModel, Readings
from sloshlab.identification.drive_noise import NoiseSpectrum, noise_spectrum
from sloshlab.identification.observations import Observation
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics.candidate import Candidate, extension_of

FloatArray = NDArray[np.float64]
_N_DRAWS: Final = 8
"""Motions part at other times in every draw."""


class DivergingMotions:
    """Draws of motions that are as likely as a simulated one.

    Parameters
    ----------
    model : DiagnosedModel
        Nothing is known of the drives of a user's own twin, whose simulations are taken as exact.
    tests : sequence of sequences of str, optional
        Names of the runs of every test: repeats tell the spectrum of the noise of drives.
    """

    def __init__(self, model: DiagnosedModel, tests: Sequence[Sequence[str]] = ()) -> None:
        self._model, self._tests = model, tests

    @cached_property
    def _noisy(self) -> list[tuple[RigModel, dict[str, CaseRun]]]:
        """Models whose drives have as much noise once more, with their runs: the recorded ones have theirs."""
        if not isinstance(self._model, RigModel):
            return []
        found = []
        by_name = {run.name: run for run in self._model.runs}
        tests = [[by_name[name] for name in test if name in by_name] for test in self._tests]
        driving = dict.fromkeys(name for run in self._model.runs for name in self._model.driving(run))
        spectra = {name: noise_spectrum(tests, name) for name in driving}
        # Fixed seeds: the same case gives the same answer.
        for seed in range(_N_DRAWS):
            generator = np.random.default_rng(seed)
            runs = [_with_noise(run, self._model.driving(run), spectra, generator) for run in self._model.runs]
            # A model of its own, as drives are kept by the name of a run; no motion is asked for twice.
            model = RigModel(
                self._model.rig, self._model.folder, runs, executor=self._model.executor, most_kept_bytes=0.0
            )
            found.append((model, {run.name: run for run in runs}))
        return found

    def differences(
        self, observed: Sequence[Observation], candidates: Sequence[Candidate], values: Mapping[str, float]
    ) -> list[FloatArray]:
        """By what draws differ from the simulation, in standard deviations of the noise of the channels.

        Shape (n_channels, n_blocks, n_bands) each; none where no effect meets or sticks, and of simulations that
        do not reach their end. A channel that drives reads its own noise, which is no motion: it does not differ.

        Parameters
        ----------
        observed : sequence of Observation
            Of one run.
        candidates : sequence of Candidate
        values : mapping
        """
        run = observed[0].run
        rough = [
            f"{candidate.key}.{parameter.name}"
            for candidate in candidates
            if any(term.jumps for term in extension_of([candidate], values).terms_in(run.name))
            for parameter in candidate.effect.parameters
            if f"{candidate.key}.{parameter.name}" in values
        ]
        driving = () if run.is_free else self._model.driving(run)
        names = [each.channel for each in observed if each.channel not in driving]
        if not rough or not names or not self._noisy:
            return []
        found: list[FloatArray] = []
        with suppress(SloshlabError):
            plain = self._model.simulate(run, values, extension_of(candidates, values), names)
            for seed, (model, runs) in enumerate(self._noisy):
                scatter = EXACT * np.random.default_rng(seed).standard_normal(len(rough))
                numbers = {name: values[name] * (1.0 + z) for name, z in zip(rough, scatter, strict=True)}
                with suppress(SloshlabError):
                    extension = extension_of(candidates, {**values, **numbers})
                    drawn = model.simulate(runs[run.name], values, extension, names)
                    found.append(np.stack([_difference(each, plain, drawn) for each in observed]))
        return found


def _difference(observation: Observation, plain: Readings, drawn: Readings) -> FloatArray:
    if observation.channel not in plain:
        return np.zeros(observation.spectra.shape)
    difference = observation.of(drawn[observation.channel]) - observation.of(plain[observation.channel])
    return np.asarray(difference / np.sqrt(observation.variance))


def _with_noise(
    run: CaseRun, driving: Sequence[str], spectra: Mapping[str, NoiseSpectrum], generator: np.random.Generator
) -> CaseRun:
    if run.is_free:
        return run
    noisy = {}
    for name in driving:
        channel = run.recording[name]
        noise = spectra[name].drawn(run, name, generator)
        noisy[name] = channel.copy(data=np.asarray(channel.values, np.float64) + noise)
    return replace(run, recording=run.recording.assign(noisy))

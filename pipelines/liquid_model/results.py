"""What the report of a model is made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from pipelines.sweep.results import RigResult, RunResult
from sloshlab.consistency.finding import ConsistencyExamination
from sloshlab.maps.map_error import MapError
from sloshlab.reduced_order_model.fit_quality import FitQuality, fit_quality
from sloshlab.reduced_order_model.liquid_signals import LiquidSignals
from sloshlab.reduced_order_model.model import ReducedOrderModel
from sloshlab.reduced_order_model.repeat_ceiling import MatchedRepeats
from sloshlab.reduced_order_model.residual_tests import CorrelationTest
from sloshlab.reduced_order_model.training import TrainingRecord, TrainingSettings
from sloshlab.reduced_order_model.validity_domain import Excursion, MotionCycles, ValidityDomain
from sloshlab.rig import Rig

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class ComparedRun:
    """A run and what the model says of it, at the rate of the model.

    Attributes
    ----------
    role : {"training", "validation", "test"}
    signals : LiquidSignals
        Measured.
    free, one_step : ndarray, shape (n,)
        Δf of the free run and one step ahead [N].
    cycles : MotionCycles
    excursions : tuple of Excursion
        Where the motion leaves what the training covered.
    measured, predicted : RunResult or None
        The run analysed with the measured and with the simulated force; None where no sweep was found, and for
        runs of the training.
    """

    role: str
    signals: LiquidSignals
    free: FloatArray
    one_step: FloatArray
    cycles: MotionCycles
    excursions: tuple[Excursion, ...]
    measured: RunResult | None = None
    predicted: RunResult | None = None

    @property
    def name(self) -> str:
        """Identifier of the run."""
        return self.signals.name

    @property
    def residual(self) -> FloatArray:
        """Measured − simulated force of the free run [N]."""
        return self.signals.dynamic_force_n - self.free

    def fit(self, *, free: bool = True) -> FitQuality:
        """How well the free run, or one step ahead, fits."""
        return fit_quality(self.signals.dynamic_force_n, self.free if free else self.one_step)


@dataclass(frozen=True)
class CeilingPair:
    """One run, the force of a repeat of it, and that of the model.

    Attributes
    ----------
    repeats : MatchedRepeats
    model : FitQuality
        Of the model on the samples at which the repeats are compared.
    rms_of_force, rms_of_repeat, rms_of_model : ndarray, shape (n_cycles,)
        By cycle: of the force, of its difference from the other repeat, and from the model [N].
    """

    repeats: MatchedRepeats
    model: FitQuality
    rms_of_force: FloatArray
    rms_of_repeat: FloatArray
    rms_of_model: FloatArray


@dataclass(frozen=True)
class ComparedMaps:
    """Maps of the measured and of the simulated force, from windows of the same cycles.

    Attributes
    ----------
    measured, predicted : RigResult
    runs, predicted_runs : tuple of RunResult
    errors : dict
        ``w_bar`` and ``beta``.
    source : str
        Which runs the maps are made of, in words.
    """

    measured: RigResult
    predicted: RigResult
    runs: tuple[RunResult, ...]
    predicted_runs: tuple[RunResult, ...]
    errors: Mapping[str, MapError]
    source: str

    def difference(self, name: str) -> xr.DataArray:
        """Predicted − measured."""
        return self.predicted.maps.dataset[name] - self.measured.maps.dataset[name]


@dataclass(frozen=True)
class Training:
    """How the model came about; there is none for a model that was read from a file."""

    record: TrainingRecord
    settings: TrainingSettings
    rate_reason: str


@dataclass(frozen=True)
class ValidatedModel:
    """A model with everything that the report shows.

    Attributes
    ----------
    model : ReducedOrderModel
    rig, rig_name : Rig, str
    runs : tuple of ComparedRun
        Training, validation, test.
    domain : ValidityDomain
    tests : dict
        Residual tests by run name; of the validation runs.
    ceiling : tuple of CeilingPair
    maps : ComparedMaps or None
    training : Training or None
    skipped : dict
        Why a part is missing, by the part.
    examinations : tuple of ConsistencyExamination
        Of all recordings.
    flags : tuple of str
    provenance : dict
    """

    model: ReducedOrderModel
    rig: Rig
    rig_name: str
    runs: tuple[ComparedRun, ...]
    domain: ValidityDomain
    tests: Mapping[str, list[CorrelationTest]]
    ceiling: tuple[CeilingPair, ...]
    maps: ComparedMaps | None
    training: Training | None
    skipped: Mapping[str, str]
    examinations: tuple[ConsistencyExamination, ...] = ()
    flags: tuple[str, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def of_role(self, role: str) -> tuple[ComparedRun, ...]:
        """Runs of a role."""
        return tuple(run for run in self.runs if run.role == role)

    @property
    def judged(self) -> tuple[ComparedRun, ...]:
        """Runs that the model was not trained on."""
        return tuple(run for run in self.runs if run.role != "training")

"""Models that the comparisons train, each kept in a file under what it was made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from sloshlab.reduced_order_model.agitation import Agitation
from sloshlab.reduced_order_model.ensemble import Ensemble, fit_ensemble
from sloshlab.reduced_order_model.ensemble_storage import load_ensemble, save_ensemble
from sloshlab.reduced_order_model.liquid_signals import LiquidSignals
from sloshlab.reduced_order_model.model import ReducedOrderModel
from sloshlab.reduced_order_model.regressors import Delays
from sloshlab.reduced_order_model.storage import load_model, save_model
from sloshlab.reduced_order_model.training import TrainingSettings, fit

RATE_HZ: Final = 128.0
N_REGRESSORS: Final = 20
N_NEURONS: Final = 15
KIND: Final = "normalised_rbf"


@dataclass(frozen=True)
class Workshop:
    """Trains models of one size, or takes them from the folder where it keeps them.

    Attributes
    ----------
    folder : Path
    n_epochs : int
    """

    folder: Path
    n_epochs: int = 30

    def model(
        self,
        name: str,
        training: Sequence[LiquidSignals],
        validation: Sequence[LiquidSignals],
        *,
        agitation: Agitation | None = None,
        seed: int = 0,
    ) -> ReducedOrderModel:
        """Return a model; one with memory has as many delays less as it has states.

        Parameters
        ----------
        name : str
            Of the training data and the memory; part of the file's name.
        training, validation : sequence of LiquidSignals
        agitation : Agitation, optional
        seed : int
        """
        path = self.folder / f"{name}_{self.n_epochs}epochs_start{seed}.nc"
        if path.is_file():
            return load_model(path)
        model, record = fit(
            KIND,
            {"n_neurons": N_NEURONS},
            self._delays(agitation),
            [signals.run() for signals in training],
            [signals.run() for signals in validation],
            sampling_rate_hz=RATE_HZ,
            settings=TrainingSettings(n_epochs=self.n_epochs, seed=seed),
            agitation=agitation,
        )
        model.facts.update(
            training=[signals.name for signals in training], validation_mse_n2=record.best.validation_mse
        )
        save_model(model, path)
        return model

    def ensemble(
        self,
        name: str,
        training: Sequence[LiquidSignals],
        validation: Sequence[LiquidSignals],
        *,
        n_members: int,
        agitation: Agitation | None = None,
    ) -> Ensemble:
        """Return an ensemble of such models; parameters as for `model`."""
        path = self.folder / f"{name}_{self.n_epochs}epochs_{n_members}members.nc"
        if path.is_file():
            return load_ensemble(path)
        ensemble, _ = fit_ensemble(
            KIND,
            {"n_neurons": N_NEURONS},
            self._delays(agitation),
            [signals.run() for signals in training],
            [signals.run() for signals in validation],
            sampling_rate_hz=RATE_HZ,
            settings=TrainingSettings(n_epochs=self.n_epochs),
            n_members=n_members,
            agitation=agitation,
        )
        ensemble.facts.update(training=[signals.name for signals in training])
        save_ensemble(ensemble, path)
        return ensemble

    @staticmethod
    def _delays(agitation: Agitation | None) -> Delays:
        return Delays.tapped(N_REGRESSORS - (0 if agitation is None else agitation.n_states))

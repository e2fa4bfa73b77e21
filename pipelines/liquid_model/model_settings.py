"""What model of the liquid is to be trained."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any

from pipelines.inputs.recordings import RunSource
from sloshlab.errors import InputError
from sloshlab.reduced_order_model.agitation import Agitation
from sloshlab.reduced_order_model.amplitude_weights import weighted_runs
from sloshlab.reduced_order_model.liquid_signals import LiquidSignals
from sloshlab.reduced_order_model.network_list import NETWORKS
from sloshlab.reduced_order_model.regressors import Delays, Run


@dataclass(frozen=True)
class ModelSettings:
    """What is to be trained.

    Attributes
    ----------
    structure : {"nfir", "noe"}
        Without feedback, or with its own outputs fed back.
    delays, output_delays : int
        Length of the delay lines; output delays of NOE only.
    neurons : int
    network : str
        One of `NETWORKS`.
    rate_hz : float, optional
        By default chosen from the data.
    memory_s : float, optional
        Time constant of a slow state of the speed that the network sees, too.
    sudden_starts : tuple of Path or RecordingInMemory
        Recordings from rest, to which a break-up of the liquid is fitted.
    n_members : int
        Of an ensemble trained besides; 0 for none.
    weighs_small_motion : bool
        Whether errors count by the inverse square of the local amplitude (`amplitude_weights`).
    """

    structure: str
    delays: int
    output_delays: int
    neurons: int
    _: KW_ONLY
    network: str = "normalised_rbf"
    rate_hz: float | None = None
    memory_s: float | None = None
    sudden_starts: tuple[RunSource, ...] = ()
    n_members: int = 0
    weighs_small_motion: bool = False

    def checked(self) -> ModelSettings:
        """Return self if nothing is impossible.

        Raises
        ------
        InputError
            If something is.
        """
        if self.structure not in ("nfir", "noe"):
            raise InputError("--model", got=repr(self.structure), allowed="nfir, noe")
        if self.network not in NETWORKS:
            raise InputError("--network", got=repr(self.network), allowed=", ".join(NETWORKS.names))
        if self.structure == "noe" and self.network == "multilayer":
            raise InputError("--network with feedback", got="multilayer", allowed="normalised_rbf, rbf")
        if self.structure == "noe" and (self.memory_s is not None or self.sudden_starts):
            raise InputError("memory of the liquid", got="--model noe", allowed="--model nfir")
        # past forces are fed back, which weighted runs have where they count only
        if self.structure == "noe" and self.weighs_small_motion:
            raise InputError("--weigh-small-motion", got="--model noe", allowed="--model nfir")
        if self.n_members == 1:
            raise InputError("--ensemble", got="1", allowed="0, or at least 2")
        self.delay_lines(), self.agitation()
        return self

    def agitation(self) -> Agitation | None:
        """Return the slow state, if there shall be one."""
        return None if self.memory_s is None else Agitation("speed", (self.memory_s,))

    def runs(self, signals: Sequence[LiquidSignals]) -> list[Run]:
        """Return runs that a training takes, in which small motion counts more where that is wanted.

        Parameters
        ----------
        signals : sequence of LiquidSignals

        Raises
        ------
        AnalysisError
            See `amplitude_weights`.
        """
        if self.weighs_small_motion:
            return [run for each in signals for run in weighted_runs(each)]
        return [each.run() for each in signals]

    def delay_lines(self) -> Delays:
        """Return the delays of the model."""
        return Delays.tapped(self.delays, self.output_delays if self.structure == "noe" else 0)

    def network_settings(self) -> dict[str, Any]:
        """Return what the network is made of beside its inputs."""
        if self.network == "multilayer":
            return {"layers": str(self.neurons)}
        return {"n_neurons": self.neurons}

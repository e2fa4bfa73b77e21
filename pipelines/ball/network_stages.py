"""From a ball to a network that was taught by it, and back into the guided tank (Appendix C)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pipelines.ball.decay_stages import MAP_AMPLITUDE_M, MAP_FREQUENCY_RAD_PER_S
from pipelines.ball.decays import Decays, are_decays, read_decays, simulated_trace
from pipelines.ball.network_results import BallNetwork, BallNetworkSettings, LossMap, OpenLoop, Released
from pipelines.report.progress import amounts
from sloshlab.bouncing_ball.ball import BouncingBall
from sloshlab.bouncing_ball.free_decay import natural_frequency_hz, simulated_curve
from sloshlab.bouncing_ball.harmonic_model import model_loss_factor
from sloshlab.bouncing_ball.harmonic_response import HarmonicRun, response_map
from sloshlab.bouncing_ball.pseudo_harmonic import PseudoHarmonic, run_of_ball
from sloshlab.errors import AnalysisError
from sloshlab.recording import read_attributes
from sloshlab.reduced_order_model.fit_quality import fit_quality
from sloshlab.reduced_order_model.gradient_training import fit_by_gradients
from sloshlab.reduced_order_model.model import ReducedOrderModel
from sloshlab.reduced_order_model.regressors import Delays, Run
from sloshlab.reduced_order_model.tank_scaling import tank_facts
from sloshlab.reduced_order_model.training import Epoch, TrainingRecord
from sloshlab.reduced_order_model.validity_domain import ValidityDomain, motion_cycles
from sloshlab.rig import Rig
from sloshlab.twin.excitation import free
from sloshlab.twin.reduced_order_model_force import term_of
from sloshlab.twin.terms import Term
from sloshlab.twin.twin import Twin

FloatArray = npt.NDArray[np.float64]

_MARGIN = 1.1
"""Largest acceleration of the run of the ball, over that of the release."""
_VALIDATION_SHARE = 0.25
_SWINGS = (100.0, 7.3), (50.0, 5.9)
"""Periods of frequency and amplitude [s], of training and validation run: one motion is no part of the other."""
_STRETCH_S = 1.5


def network_of_ball(
    paths: Sequence[Path], rig_path: Path, ball_path: Path, settings: BallNetworkSettings
) -> BallNetwork:
    """Teach a network by a ball, and put both in place of the liquid of recorded decays.

    Parameters
    ----------
    paths : sequence of Path
        Free decays of a guided tank (`sdof_free`), frozen ones for what its guide does.
    rig_path, ball_path : Path
        Its rig, and the ``ball.toml`` of `sloshlab ball`.
    settings : BallNetworkSettings

    Raises
    ------
    InputError
        If runs are of another experiment, a file is bad, or the ball leaves its tank.
    """
    rig = Rig.from_toml(rig_path)
    ball = BouncingBall.from_toml(ball_path, rig)
    described = [(path, read_attributes(path)) for path in paths]
    if not are_decays(described):
        got = ", ".join(sorted({run.experiment for _, run in described}))
        raise AnalysisError("runs for a network of a ball", got=got, allowed="sdof_free alone")
    decays = read_decays(described, rig, settings.lowest_acceleration_g)
    motions = _motions(decays, settings)
    training, validation = (
        run_of_ball(ball, decays.rig, motion, name)
        for motion, name in zip(motions, ("training", "validation"), strict=True)
    )
    model, record = _trained(training, validation, settings)
    domain = ValidityDomain.of([motion_cycles(training.x, settings.rate_hz)])
    model.facts.update({**tank_facts(decays.rig), "training": {"bouncing ball": ""}, "domain": domain.facts()})
    simulated = model.simulate(validation.x)
    interrupted = ("training was interrupted; the best network so far is kept",) if record.interrupted else ()
    return BallNetwork(
        decays=decays,
        ball=ball,
        model=model,
        record=record,
        motions=motions,
        fit_percent=fit_quality(validation.y, simulated).fit_percent,
        stretch=_stretch(validation, simulated, motions[1]),
        with_ball=_released(decays, ball.term(decays.rig)),
        with_network=_released(decays, term_of(model, decays.rig)),
        loss=_loss_map(ball, model, decays.rig, settings.n_map),
        settings=settings,
        rig_name=rig_path.name,
        inputs=(*paths, rig_path, ball_path),
        flags=(*decays.flags, *interrupted),
    )


def _motions(decays: Decays, settings: BallNetworkSettings) -> tuple[PseudoHarmonic, PseudoHarmonic]:
    """Of training and validation, over the source's ranges up to the acceleration of the release."""
    omega = 2 * np.pi * natural_frequency_hz(decays.rig)
    most = _MARGIN * omega**2 * abs(decays.release_m)
    durations = settings.duration_s, max(_VALIDATION_SHARE * settings.duration_s, 1.0)
    first, second = (
        PseudoHarmonic(
            MAP_AMPLITUDE_M, MAP_FREQUENCY_RAD_PER_S, most, duration, settings.rate_hz,
            # a shorter run still goes through all frequencies
            frequency_period_s=min(slow, duration), amplitude_period_s=fast,
        )
        for duration, (slow, fast) in zip(durations, _SWINGS, strict=True)
    )  # fmt: skip
    return first, second


def _trained(
    training: Run, validation: Run, settings: BallNetworkSettings
) -> tuple[ReducedOrderModel, TrainingRecord]:
    with amounts("train") as advance:

        def show_epoch(epoch: Epoch) -> None:
            errors = f"error {epoch.training_mse**0.5:.4g} N, validation {epoch.validation_mse**0.5:.4g} N"
            advance(epoch.number, settings.training.n_steps, f"step {epoch.number}, {errors}")

        layers = " ".join([str(settings.n_neurons)] * settings.n_layers)
        return fit_by_gradients(
            "multilayer",
            {"layers": layers, "activation": "radial"},
            Delays.tapped(settings.n_delays),
            [training],
            [validation],
            sampling_rate_hz=settings.rate_hz,
            settings=settings.training,
            on_epoch=show_epoch,
        )


def _released(decays: Decays, term: Term) -> Released:
    """The recorded release with a force in place of the liquid, read as the recording is."""
    twin = Twin.from_rig(decays.rig.model_copy(update={"twin": None})).with_term(term)
    motion = free(decays.duration_s, decays.sampling_rate_hz)
    decay = twin.simulate(motion, initial_displacement_m=decays.release_m).require_done()
    return Released(simulated_curve(decay, decays.measured.frequency_hz), simulated_trace(decay, decays.rig))


def _stretch(run: Run, simulated: FloatArray, motion: PseudoHarmonic) -> OpenLoop:
    """Of the validation run, around its largest force of the ball."""
    n = round(_STRETCH_S * motion.sampling_rate_hz)
    first = int(np.clip(np.argmax(np.abs(run.y)) - n // 2, 0, max(run.x.size - n, 0)))
    part = slice(first, first + n)
    time = np.arange(run.x.size)[part] / motion.sampling_rate_hz
    return OpenLoop(time, run.x[part], run.y[part], simulated[part])


def _loss_map(ball: BouncingBall, model: ReducedOrderModel, rig: Rig, n_map: int) -> LossMap:
    """Over the source's ranges."""
    amplitude = np.geomspace(*MAP_AMPLITUDE_M, n_map)
    frequency = np.linspace(*MAP_FREQUENCY_RAD_PER_S, n_map) / (2 * np.pi)
    with amounts("maps of the ball") as advance:
        # fewer cycles than for the maps of the ball: errors of a network are larger than what more would change
        response = response_map(ball, rig, amplitude, frequency, HarmonicRun(15, 10), progress=advance)
    of_network = model_loss_factor(model, rig, amplitude, frequency)
    return LossMap(amplitude, frequency, response["loss_factor"].values, of_network)

"""Latent forces: those that would make a simulation follow its recording, at structure and tank.

The residuals of all motion channels are the response to one force at the tank's place (`force_inversion`),
whatever made it. A force measured between structure and tank separates the liquid's part: Δf = M ü − F. The rest
acts on the structure. Without a measured force the place stays undetermined.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from sloshlab.identification.case import CaseRun
from sloshlab.identification.diagnosed_model import DiagnosedModel, ModelOfBlocks, Request
from sloshlab.identification.observations import Observation
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_force.force_inversion import (
    InvertedForce,
    frequencies_hz,
    in_frequency,
    in_time,
    inverted_force,
    modal_weights,
    response,
    sample_variance,
    wiener_gain,
)
from sloshlab.missing_force.probed_transfers import ProbedTransfers, probed_transfers
from sloshlab.missing_force.residual_series import missed_series, noise_power, order_of, taper, untapered
from sloshlab.missing_physics.extension import NOTHING, Extension
from sloshlab.rig import Rig
from sloshlab.twin.blocks import Blocks
from sloshlab.twin.excitation import Excitation, recorded
from sloshlab.twin.simulation import Simulation
from sloshlab.twin.structure import Structure
from sloshlab.twin.terms import Term
from sloshlab.twin.twin import Twin

FloatArray = NDArray[np.float64]
Found = tuple[tuple["LatentForce", ...], "LatentForce | None", dict[str, FloatArray]]
STRUCTURE, TANK, EITHER = "structure", "tank", "structure or tank"


@dataclass(frozen=True, eq=False)
class LatentForce:
    """A force that the baseline lacks in one run, at one place.

    Attributes
    ----------
    run : CaseRun
    place : {"structure", "tank", "structure or tank"}
    force_n : ndarray, shape (n,)
        Upward positive, away from the ends of the run.
    standard_error_n : float
        Of one sample, by the noise of the sensors.
    time_s : ndarray, shape (n,)
    motion : ndarray, shape (n, 3)
        Displacement, velocity, acceleration there: relative to the base for the structure, absolute for the tank.
    motion_before : ndarray, shape (m, 3)
        The same from the start of the run to the first sample of the force.
    kept_share : ndarray, shape (n_samples_of_the_run + 1,)
        What the regularisation kept of every frequency of the padded run (`in_frequency`), 0 … 1.
    noise_power : ndarray, shape (n_samples_of_the_run + 1,)
        Expected noise of every frequency of the padded run before the regularisation [N²].
    """

    run: CaseRun
    place: str
    force_n: FloatArray
    standard_error_n: float
    time_s: FloatArray
    motion: FloatArray
    motion_before: FloatArray = field(default_factory=lambda: np.empty((0, 3)))
    kept_share: FloatArray = field(default_factory=lambda: np.empty(0))
    noise_power: FloatArray = field(default_factory=lambda: np.empty(0))

    @property
    def power_n2(self) -> float:
        """Mean square beyond noise, not below zero [N²]."""
        return max(float(np.mean(self.force_n**2)) - self.standard_error_n**2, 0.0)


@dataclass(frozen=True, eq=False)
class RunForces:
    """Latent forces of one run, and the residuals that they were computed from.

    Attributes
    ----------
    forces : tuple of LatentForce
        At structure and tank, or at either of them; at the tank alone on a shaker.
    missed : dict of str to ndarray, shape (n,)
        Residual of each channel in true units, tapered at the ends.
    left : dict of str to ndarray, shape (n,)
        What each motion channel shows beyond the response to the latent force, in true units; of force cells the
        difference from an equal share of their sum.
    structure : Structure or None
        As retuned.
    carried_mass_kg : float
    probed : ProbedTransfers or None
        Of a twin of a user's own.
    undivided : LatentForce or None
        Where a force between structure and tank was measured, what both lack together: the motion tells it at a
        resonance far better than the measured force divides it.
    """

    forces: tuple[LatentForce, ...]
    missed: dict[str, FloatArray]
    left: dict[str, FloatArray]
    structure: Structure | None
    carried_mass_kg: float
    probed: ProbedTransfers | None = None
    undivided: LatentForce | None = None

    def at(self, place: str) -> LatentForce | None:
        """The force at a place, if it can be told there."""
        return next((force for force in self.forces if force.place == place), None)


def run_forces(
    model: DiagnosedModel,
    observed: Sequence[Observation],
    values: Mapping[str, float],
    without: Collection[str] = (),
    extension: Extension = NOTHING,
) -> RunForces:
    """Latent forces of one run.

    Parameters
    ----------
    model : DiagnosedModel
        Transfers of a twin of a user's own are probed; all that it lacks is one force then.
    observed : sequence of Observation
        Of one run.
    values : mapping
        Of the baseline's parameters.
    without : collection of str
        Channels that are left out of the inversion.
    extension : Extension, optional
        Effects that the simulation has beyond the baseline.

    Raises
    ------
    AnalysisError
        If the baseline does not reach the end of the run.
    """
    run = observed[0].run
    readings = model.simulate(run, values, extension)
    missed = {
        observation.channel: missed_series(observation, readings[observation.channel], values, run.is_free)
        for observation in observed
    }
    believed = [observation for observation in observed if observation.channel not in without]
    if isinstance(model, ModelOfBlocks):
        # what its blocks lack is no force along one motion
        return RunForces((), missed, {}, None, 0.0)
    if not isinstance(model, RigModel):
        return _on_probed(model, values, extension, observed, believed, missed)
    simulation = model.whole_simulation(Request(run, values, extension))
    if simulation.twin.structure is None:
        forces, undivided, left = _on_shaker(simulation, run, observed, believed, missed)
    else:
        forces, undivided, left = _on_structure(simulation, model.rig, observed, believed, missed)
    left |= _cell_disagreements(observed, believed, missed)
    structure, carried_mass_kg = simulation.twin.structure, simulation.twin.carried_mass_kg
    return RunForces(forces, missed, left, structure, carried_mass_kg, undivided=undivided)


def channel_responses(
    forces: RunForces, observed: Sequence[Observation], rig: Rig | None, force: LatentForce
) -> dict[str, FloatArray]:
    """What a force at its place adds to every channel of the run, in true units, shape (n,) each.

    Parameters
    ----------
    forces : RunForces
    observed : sequence of Observation
        Of the same run.
    rig : Rig or None
        None of a twin of a user's own.
    force : LatentForce
    """
    run = force.run
    rate, n = run.attributes.sampling_rate_hz, int(run.recording.sizes["time"])
    first = round((force.time_s[0] - float(run.recording["time"].values[0])) * rate)
    series = np.zeros(n)
    series[first : first + force.force_n.size] = force.force_n
    frequency = frequencies_hz(n, rate)
    spectrum = in_frequency(series)
    if forces.probed is not None:
        of_channels = forces.probed.readings
        return {each.channel: in_time(of_channels[each.channel] * spectrum, n) for each in observed}
    structure = forces.structure
    n_cells = max(1, sum(observation.channel.startswith("force_cell") for observation in observed))
    moved = np.zeros(frequency.size, complex)
    if structure is not None:
        moved = forces.carried_mass_kg * response(structure, structure.mode_shape, 2, frequency)
    # F = M ü − f between structure and tank: a force on the tank moves it and is itself seen by the cell, one on
    # the structure only moves it.
    of_force = moved - (1.0 if force.place == TANK else 0.0)
    shown = {}
    for observation in observed:
        attributes = run.recording[observation.channel].attrs
        transfer = np.zeros(frequency.size, complex)
        if observation.channel.startswith("force"):
            transfer = (
                _sign(observation) * of_force / (n_cells if observation.channel.startswith("force_cell") else 1)
            )
        elif structure is not None and rig is not None:
            weights = modal_weights(structure, rig, observation.channel, attributes.get("x_m"))
            if weights is not None:
                transfer = response(structure, weights, order_of(observation.channel), frequency)
        shown[observation.channel] = in_time(transfer * spectrum, n)
    return shown


def _on_structure(
    simulation: Simulation,
    rig: Rig,
    observed: Sequence[Observation],
    believed: Sequence[Observation],
    missed: Mapping[str, FloatArray],
) -> Found:
    inverted, at_release, left = _inverted_force_at_tank(simulation, rig, observed, believed, missed)
    run, structure = observed[0].run, simulation.twin.structure
    assert structure is not None
    rate, n = run.attributes.sampling_rate_hz, int(run.recording.sizes["time"])
    frequency = inverted.frequency_hz
    sampled = min(n, simulation.places.shape[0])
    orders = [response(structure, structure.mode_shape, order, frequency) for order in range(3)]
    moved = np.stack([in_time(transfer * inverted.spectrum, n) for transfer in orders], axis=-1)[:sampled]
    started = np.stack([_release(structure, structure.mode_shape, order, n, rate) for order in range(3)], axis=-1)
    # The force acts along the motion that was recorded, not along the one that was simulated without it.
    moved = moved + at_release * started[:sampled]
    relative, absolute = simulation.places[:sampled, 0] + moved, simulation.places[:sampled, 1] + moved
    force = in_time(inverted.spectrum, n)[:sampled]
    # The baseline's own springs and dampers are other forces along another motion. What they change by is not
    # missing.
    on_structure = _change_of_baseline_force(simulation, simulation.twin, STRUCTURE, relative, rate)
    in_tank = _change_of_baseline_force(simulation, simulation.twin, TANK, absolute, rate)
    kept = untapered(n, run.is_free)
    kept = slice(kept.start, min(kept.stop, sampled))
    time = np.asarray(run.recording["time"].values, np.float64)

    def latent(
        place: str, series: FloatArray, expected: FloatArray, motion: FloatArray, share: FloatArray
    ) -> LatentForce:
        error = float(np.sqrt(sample_variance(expected, n)))
        noise = expected / np.maximum(share, 1e-300)
        before = motion[: kept.start]
        return LatentForce(run, place, series[kept], error, time[kept], motion[kept], before, share, noise)

    measured = _measured(observed, believed, missed)
    either = latent(EITHER, force - on_structure - in_tank, inverted.noise, relative, inverted.kept_share)
    # Simulation alone tells the sum of both forces only.
    if measured is None:
        return (either,), None, left
    missed_force, force_noise = measured
    inertia = simulation.twin.carried_mass_kg * orders[2]
    # What a wrong release adds to the force between structure and tank is inertia, no missing force of the
    # liquid.
    of_release = at_release * simulation.twin.carried_mass_kg * started[:, 2] * taper(n, run.is_free)
    liquid = (
        inertia * inverted.spectrum - in_frequency(missed_force - of_release) - in_frequency(_padded(in_tank, n))
    )
    noise = np.abs(inertia) ** 2 * inverted.noise + np.interp(frequency, *force_noise)
    # The division between structure and liquid is regularised once more: a difference of two large forces is
    # noisy.
    kept_share = wiener_gain(np.abs(liquid) ** 2, noise, frequency, rate)
    in_liquid = in_time(kept_share * liquid, n)[:sampled]
    # The remainder, so that both parts add up to the inverted force whatever the regularisation took.
    of_structure = force - in_tank - in_liquid - on_structure
    return (
        (
            latent(STRUCTURE, of_structure, inverted.noise + kept_share * noise, relative, inverted.kept_share),
            latent(TANK, in_liquid, kept_share * noise, absolute, kept_share),
        ),
        either,
        left,
    )


def _on_probed(
    model: DiagnosedModel,
    values: Mapping[str, float],
    extension: Extension,
    observed: Sequence[Observation],
    believed: Sequence[Observation],
    missed: Mapping[str, FloatArray],
) -> RunForces:
    """The force that a twin of a user's own lacks, by inversion of what a pulse of force does to its channels."""
    run, n = observed[0].run, int(observed[0].run.recording.sizes["time"])
    rate = run.attributes.sampling_rate_hz
    probed = probed_transfers(model, run, values, extension)
    frequency = frequencies_hz(n, rate)
    spectra = {name: in_frequency(series) for name, series in missed.items()}
    seen = {
        each.channel: (probed.readings[each.channel], noise_power(each, frequency, integrates_driven=False))
        for each in believed
        if probed.readings[each.channel].any()
    }
    inverted, _ = inverted_force(seen, spectra, frequency, rate)
    left = {
        name: in_time(spectrum - probed.readings[name] * inverted.spectrum, n)
        for name, spectrum in spectra.items()
    }
    motion = model.motion(run, values, extension)
    motion = motion + np.stack([in_time(transfer * inverted.spectrum, n) for transfer in probed.motion], axis=-1)
    kept = untapered(n, run.is_free)
    share = inverted.kept_share
    force = LatentForce(
        run,
        STRUCTURE,
        in_time(inverted.spectrum, n)[kept],
        float(np.sqrt(sample_variance(inverted.noise, n))),
        np.asarray(run.recording["time"].values, np.float64)[kept],
        motion[kept],
        motion[: kept.start],
        share,
        inverted.noise / np.maximum(share, 1e-300),
    )
    return RunForces((force,) if seen else (), dict(missed), left, None, 0.0, probed)


def _inverted_force_at_tank(
    simulation: Simulation,
    rig: Rig,
    observed: Sequence[Observation],
    believed: Sequence[Observation],
    missed: Mapping[str, FloatArray],
) -> tuple[InvertedForce, float, dict[str, FloatArray]]:
    """The force at the tank by inversion of the trusted motion channels, the error of the release, and what every
    channel has left.
    """
    run, structure = observed[0].run, simulation.twin.structure
    assert structure is not None
    rate, n = run.attributes.sampling_rate_hz, int(run.recording.sizes["time"])
    frequency = frequencies_hz(n, rate)
    receptances, released = {}, {}
    for observation in observed:
        weights = modal_weights(
            structure, rig, observation.channel, run.recording[observation.channel].attrs.get("x_m")
        )
        if weights is not None:
            receptances[observation.channel] = response(
                structure, weights, order_of(observation.channel), frequency
            )
            if run.is_free:
                released[observation.channel] = in_frequency(
                    _release(structure, weights, order_of(observation.channel), n, rate) * taper(n, True)
                )
    # All channels have a residual after the inversion, also those that were left out of it: that is what tests
    # them.
    spectra = {name: in_frequency(missed[name]) for name in receptances}
    seen = {
        observation.channel: (receptances[observation.channel], noise_power(observation, frequency))
        for observation in believed
        if observation.channel in receptances
    }
    inverted, at_release = inverted_force(seen, spectra, frequency, rate, released or None)
    left = {}
    for name, spectrum in spectra.items():
        start = at_release * released[name] if released else 0.0
        left[name] = in_time(spectrum - receptances[name] * inverted.spectrum - start, n)
    return inverted, at_release, left


def _release(structure: Structure, weights: FloatArray, order: int, n: int, rate_hz: float) -> FloatArray:
    """Free decay of a channel after a release of the tank from one metre."""
    omega = np.sqrt(structure.stiffnesses_n_per_m / structure.masses_kg)
    decay = 0.5 * structure.dampings_kg_per_s / structure.masses_kg
    pole = -decay + 1j * np.sqrt(np.maximum(omega**2 - decay**2, 0.0))
    start = structure.static_deflection(1.0)
    turning = np.where(pole.imag > 0, pole.imag, np.inf)
    # Released from rest: with this factor the velocity at the start is zero. A mode that does not turn has none.
    factor = start * (1 - 1j * decay / turning) * weights
    time = np.arange(n) / rate_hz
    return np.asarray((np.exp(np.outer(time, pole)) * pole**order @ factor).real)


def _padded(series: FloatArray, n: int) -> FloatArray:
    return np.concatenate([series, np.zeros(n - series.size)])


def _on_shaker(
    simulation: Simulation,
    run: CaseRun,
    observed: Sequence[Observation],
    believed: Sequence[Observation],
    missed: Mapping[str, FloatArray],
) -> Found:
    rate, n = run.attributes.sampling_rate_hz, int(run.recording.sizes["time"])
    frequency = frequencies_hz(n, rate)
    sampled = min(n, simulation.places.shape[0])
    motions = [observation for observation in observed if order_of(observation.channel) == 2]
    # The tank's own motion is measured: the mean of the accelerometers that are believed is the input, and their
    # differences from it are left to the sensors.
    good = [motion for motion in motions if motion in believed] or motions
    mean = np.mean([missed[observation.channel] for observation in good], axis=0) if good else np.zeros(n)
    left = {motion.channel: missed[motion.channel] - mean for motion in motions}
    measured = _measured(observed, believed, missed)
    if measured is None:
        return (), None, left
    missed_force, force_noise = measured
    carried = simulation.twin.carried_mass_kg
    of_noise = np.interp(frequency, *force_noise)
    # The mean of n accelerometers has 1/n² of the sum of their noise powers.
    for observation in good:
        of_noise = of_noise + (carried / len(good)) ** 2 * noise_power(observation, frequency)
    wanted = in_frequency(carried * mean - missed_force)
    share = wiener_gain(np.abs(wanted) ** 2, of_noise, frequency, rate)
    force = in_time(share * wanted, n)[:sampled]
    motion = simulation.places[:sampled, 1].copy()
    motion[:, 2] += mean[:sampled]
    kept = untapered(n, run.is_free)
    kept = slice(kept.start, min(kept.stop, sampled))
    time = np.asarray(run.recording["time"].values, np.float64)
    error = float(np.sqrt(sample_variance(share * of_noise, n)))
    before = motion[: kept.start]
    lacking = LatentForce(run, TANK, force[kept], error, time[kept], motion[kept], before, share, of_noise)
    return (lacking,), None, left


def _measured(
    observed: Sequence[Observation], believed: Sequence[Observation], missed: Mapping[str, FloatArray]
) -> tuple[FloatArray, tuple[FloatArray, FloatArray]] | None:
    """Residual of the force of the structure on the tank, and the power of its noise over frequency."""
    forces = [force for force in believed if force.channel.startswith("force")]
    cells = [force for force in forces if force.channel.startswith("force_cell")]
    chosen = cells or forces[:1]
    if not chosen:
        return None
    n_cells = sum(observation.channel.startswith("force_cell") for observation in observed)
    # Cells that are left out are taken to carry as much as the others do.
    scale = n_cells / len(cells) if cells else 1.0
    total = scale * np.sum([_sign(observation) * missed[observation.channel] for observation in chosen], axis=0)
    frequency = chosen[0].frequencies_hz
    noise = scale**2 * np.sum([noise_power(observation, frequency) for observation in chosen], axis=0)
    return total, (frequency, noise)


def _sign(observation: Observation) -> float:
    return -1.0 if observation.run.recording[observation.channel].attrs.get("block_from") == "tank" else 1.0


def _cell_disagreements(
    observed: Sequence[Observation], believed: Sequence[Observation], missed: Mapping[str, FloatArray]
) -> dict[str, FloatArray]:
    cells = [observation.channel for observation in observed if observation.channel.startswith("force_cell")]
    good = [observation.channel for observation in believed if observation.channel in cells]
    if len(cells) < 2 or not good:
        return {}
    mean = np.mean([missed[name] for name in good], axis=0)
    return {name: missed[name] - mean for name in cells}


def _change_of_baseline_force(
    simulation: Simulation, twin: Blocks, place: str, motion: FloatArray, rate_hz: float
) -> FloatArray:
    """Baseline forces of a place along the measured motion, less those of the simulation."""
    chosen = [i for i, term in enumerate(twin.terms) if term.place == place]
    if not chosen:
        return np.zeros(motion.shape[0])
    simulated = simulation.forces_n[: motion.shape[0], chosen].sum(axis=1)
    # Contacts and forces with memory are integrated by the same engine.
    alone = forces_alone([twin.terms[i] for i in chosen])
    forces = alone.simulate(along(motion, rate_hz)).require_done().forces_n.sum(axis=1)
    return np.asarray(forces - simulated)


def forces_alone(terms: Sequence[Term]) -> Twin:
    """Forces on a motion that is prescribed, where it no longer matters at which place they act."""
    return Twin(None, tuple(replace(term, place=TANK) for term in terms))


def along(motion: FloatArray, rate_hz: float) -> Excitation:
    """A prescribed motion: displacement, velocity, acceleration, shape (n, 3)."""
    return recorded(rate_hz, displacement=motion[:, 0], velocity=motion[:, 1], acceleration=motion[:, 2])

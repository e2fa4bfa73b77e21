"""Decoupling at measured interfaces: each block is driven by its measured input, its output compared alone.

excitation → structure → tank → sensors. The structure is fed the measured motion of its base and the measured
force between it and the tank, the tank its measured acceleration; what each lacks beyond the retuned baseline is a
`latent_force`. Sensors are compared with the other sensors of the same motion. What a block's own parameters could
still explain within their tolerances is charged to no block.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.errors import SloshlabError
from sloshlab.identification.diagnosed_model import DiagnosedModel
from sloshlab.identification.observations import Observation
from sloshlab.missing_force.latent_force import (
    EITHER,
    STRUCTURE,
    TANK,
    LatentForce,
    RunForces,
    channel_responses,
    run_forces,
)

FloatArray = NDArray[np.float64]
SENSOR: Final = "sensor"
_N_PARTS: Final = 6
"""Stretches of a run that are resampled as wholes (block bootstrap)."""
N_DRAWS: Final = 400
"""Of shares of blocks, for their intervals."""
_CONSISTENT: Final = 1.4
"""RMS over noise up to which channels of one motion agree."""
_EXPLAINED: Final = 0.35
"""Share of a disagreement that may remain once the channel that causes it is left out."""
_RUNNER_UP: Final = 1.5
"""Ratio of what the second best choice leaves, from which the best one is certain."""
_RESOLVED: Final = 0.25
"""Mean square beyond noise, over that of the noise, from which a force is there."""
_FEWER_FORCES: Final = 4.0
"""Of two channels, ratio of the latent forces that remain without each, from which one of them is suspect."""
_LARGEST_RATIO: Final = 1e3


@dataclass(frozen=True)
class BlockCut:
    """One block on its measured input.

    Attributes
    ----------
    block : str
    input, output : str
        What it was fed, what was compared.
    share, low, high : float
        Of the mismatch of all channels, with its 90 % interval; NaN where the recordings cannot tell.
    size, noise : float
        RMS of what it lacks and of its noise; a force [N], or for sensors in standard deviations.
    remark : str
        What cannot be told, and why.
    """

    block: str
    input: str
    output: str
    share: float
    low: float
    high: float
    size: float
    noise: float
    remark: str = ""


@dataclass(frozen=True)
class SensorCheck:
    """One channel beside what the others of the same motion say.

    Attributes
    ----------
    channel : str
    ratio : float
        RMS of the difference over noise.
    disagreement_without : float
        RMS over noise of the other channels when this one is left out.
    missing_force_without_n2 : float
        Mean square of the forces that the blocks then lack beyond noise and their own parameters [N²].
    """

    channel: str
    ratio: float
    disagreement_without: float
    missing_force_without_n2: float = float("nan")


@dataclass(frozen=True, eq=False)
class InterfaceCut:
    """Which block owns how much of the mismatch.

    Attributes
    ----------
    blocks : tuple of BlockCut
        In the order of the chain.
    sensors : tuple of SensorCheck
    suspect : str
        The channel that contradicts all others; empty where there is none.
    remark : str
        What of the sensors cannot be told.
    runs : tuple of RunForces
        With the doubted channel left out.
    """

    blocks: tuple[BlockCut, ...]
    sensors: tuple[SensorCheck, ...]
    suspect: str
    remark: str
    runs: tuple[RunForces, ...]

    def forces(self, place: str) -> list[LatentForce]:
        """Latent forces of all runs at a place."""
        return [force for run in self.runs if (force := run.at(place)) is not None]

    @property
    def places(self) -> tuple[str, ...]:
        """Where forces can be told."""
        return tuple(dict.fromkeys(force.place for run in self.runs for force in run.forces))


def interface_cut(
    model: DiagnosedModel, runs: Sequence[Sequence[Observation]], values: Mapping[str, float], seed: int = 0
) -> InterfaceCut:
    """Cut the system open in every run.

    Parameters
    ----------
    model : DiagnosedModel
    runs : sequence of sequences of Observation
        Per run.
    values : mapping
        Of the retuned baseline.
    seed : int
        Of the draws for intervals.
    """
    usable = [run for run in runs if run]
    together = [_forces(model, run, values) for run in usable]
    # A run in which the retuned baseline does not reach its end cannot be cut, the others can.
    kept = [(run, found) for run, found in zip(usable, together, strict=True) if found is not None]
    usable, found = [run for run, _ in kept], [forces for _, forces in kept]
    sensors = _sensor_checks(model, usable, found, values)
    suspect, remark = _suspect_channel(sensors)
    # Its fault would be inverted into a force, and the blocks charged with what one sensor invents.
    if suspect:
        found = [run_forces(model, run, values, {suspect}) for run in usable]
    blocks = _blocks(model, usable, found, suspect, seed)
    return InterfaceCut(blocks, sensors, suspect, remark, tuple(found))


def _forces(model: DiagnosedModel, run: Sequence[Observation], values: Mapping[str, float]) -> RunForces | None:
    try:
        return run_forces(model, run, values)
    except SloshlabError:
        return None


def _weighted(observation: Observation, series: FloatArray, values: Mapping[str, float]) -> FloatArray:
    """Spectra in standard deviations of a series in true units."""
    spectra = observation.of(series) * values.get(f"gain of {observation.channel}", 1.0)
    # Clipped, as coefficients without noise would outweigh all others.
    return np.asarray(np.clip(spectra / np.sqrt(observation.variance), -_LARGEST_RATIO, _LARGEST_RATIO))


def _disagreements(
    runs: Sequence[Sequence[Observation]], found: Sequence[RunForces], values: Mapping[str, float]
) -> dict[str, float]:
    """RMS over noise, per channel, of the disagreement of channels of one motion, in the bands of the motion."""
    sums: dict[str, list[float]] = {}
    for observed, forces in zip(runs, found, strict=True):
        for observation in observed:
            if observation.channel in forces.left:
                spectra = _weighted(observation, forces.left[observation.channel], values)
                part = spectra[:, : int(0.6 * observation.n_bands)]
                total = sums.setdefault(observation.channel, [0.0, 0.0])
                total[0] += float((part**2).sum())
                total[1] += part.size
    return {name: float(np.sqrt(total / n)) for name, (total, n) in sums.items()}


def _sensor_checks(
    model: DiagnosedModel,
    runs: Sequence[Sequence[Observation]],
    found: Sequence[RunForces],
    values: Mapping[str, float],
) -> tuple[SensorCheck, ...]:
    together = _disagreements(runs, found, values)
    checks = []
    for name, ratio in together.items():
        without, missing_force_n2 = ratio, float("nan")
        alike = [other for other in together if other.startswith("force") == name.startswith("force")]
        # Leave one out: without the faulty channel the others agree. Each costs an inversion of all runs, so
        # that this is done only where channels disagree.
        if max(together.values()) > _CONSISTENT and len(alike) > 1:
            again = [run_forces(model, run, values, {name}) for run in runs]
            others = _disagreements(runs, again, values)
            alone = others.pop(name)
            # A faulty channel pulls the common force towards itself and hides a part of its fault, but not where
            # it is left out.
            ratio = max(ratio, alone)
            without = max((others[other] for other in alike if other != name), default=ratio)
            missing_force_n2 = float(np.mean([_missing_force_power_n2(model, forces) for forces in again]))
        checks.append(SensorCheck(name, ratio, without, missing_force_n2))
    return tuple(checks)


def _suspect_channel(sensors: Sequence[SensorCheck]) -> tuple[str, str]:
    """The channel without which the others agree, or why none can be named."""
    groups = [
        [sensor for sensor in sensors if sensor.channel.startswith("force") is of_force]
        for of_force in (False, True)
    ]
    for group in groups:
        worst = max((sensor.ratio for sensor in group), default=0.0)
        # One channel alone has no other that it could contradict.
        if worst <= _CONSISTENT or len(group) < 2:
            continue
        # Two channels that contradict each other are symmetric. What breaks the tie is that a false reading asks
        # the blocks for forces, and the true one does not.
        if len(group) == 2:
            best, second = sorted(group, key=lambda sensor: sensor.missing_force_without_n2)
            if second.missing_force_without_n2 > _FEWER_FORCES * best.missing_force_without_n2:
                return best.channel, (
                    f"{best.channel} and {second.channel} contradict each other; {best.channel} is doubted, since "
                    "without it the blocks need hardly any missing force"
                )
            names = " and ".join(sensor.channel for sensor in group)
            return "", f"{names} contradict each other; with two of them alone nothing says which is wrong"
        best, second = sorted(group, key=lambda sensor: _excess(sensor.disagreement_without))[:2]
        left, next_left = _excess(best.disagreement_without), _excess(second.disagreement_without)
        # Both are needed: leaving it out must help much, and leaving out any other must help less.
        if left < _EXPLAINED * _excess(worst) and next_left > _RUNNER_UP * left:
            return best.channel, ""
        return "", "channels of one motion contradict each other, and leaving out one does not make them agree"
    return "", ""


def _missing_force_power_n2(model: DiagnosedModel, forces: RunForces) -> float:
    """Mean square of what the blocks lack beyond noise and their own parameters; never zero."""
    sizes = [
        # Never zero, since sizes are compared by their ratio.
        max(own.power_n2, _RESOLVED * own.standard_error_n**2)
        for own in (beyond_own_parameters(model, forces, force) for force in forces.forces)
    ]
    return float(sum(sizes))


def _excess(ratio: float) -> float:
    # Mean square beyond noise; the floor keeps ratios of two channels without excess finite.
    return max(ratio**2 - 1.0, 0.02)


def _blocks(
    model: DiagnosedModel,
    runs: Sequence[Sequence[Observation]],
    found: Sequence[RunForces],
    suspect: str,
    seed: int,
) -> tuple[BlockCut, ...]:
    places = tuple(dict.fromkeys(force.place for forces in found for force in forces.forces))
    parts = _parts(model, runs, found, places, suspect)
    shares = _shares(parts, seed)
    if any(run.probed is not None for run in found):
        return (*_of_own_twin(found, shares), _sensors(parts, suspect, shares))
    cuts = [_excitation(runs, found)]
    for place in (STRUCTURE, TANK, EITHER):
        if place in places:
            own = [beyond_own_parameters(model, run, force) for run in found if (force := run.at(place))]
            cuts.append(_of_place(place, own, shares))
        elif place == STRUCTURE and EITHER not in places and any(run.structure is not None for run in found):
            cuts.append(_undetermined(place, "no motion of the structure was recorded"))
    if not any(run.structure is not None for run in found):
        cuts.insert(1, _undetermined(STRUCTURE, "there is none: the tank follows its measured motion"))
    if TANK not in places and EITHER not in places:
        cuts.append(_undetermined(TANK, "no force on the tank was recorded"))
    cuts.append(_sensors(parts, suspect, shares))
    return tuple(cuts)


def _of_own_twin(
    found: Sequence[RunForces], shares: Mapping[str, tuple[float, float, float]]
) -> tuple[BlockCut, BlockCut]:
    """A twin of a user's own is one block between what drives it and what is read of it."""
    own = [force for run in found if (force := run.at(STRUCTURE)) is not None]
    driven = _undetermined("excitation", "what drives is taken as it was recorded")
    if not own:
        return driven, _undetermined(STRUCTURE, "an added force shows in no compared channel")
    cut = _of_place(STRUCTURE, own, shares)
    return driven, replace(cut, input="what drives it, as recorded", output="what is read of it")


def _sensors(
    parts: Sequence[Mapping[str, FloatArray]], suspect: str, shares: Mapping[str, tuple[float, float, float]]
) -> BlockCut:
    share, low, high = shares.get(SENSOR, (float("nan"),) * 3)
    remark = "" if SENSOR in shares else "no two sensors saw the same motion"
    size = float(np.sqrt(max((part[SENSOR].max() for part in parts if SENSOR in part), default=0.0)))
    compared = suspect or "channels of the same motion"
    return BlockCut(SENSOR, "what the other sensors say", compared, share, low, high, size, 1.0, remark)


def _undetermined(block: str, remark: str) -> BlockCut:
    nan = float("nan")
    return BlockCut(block, "–", "–", nan, nan, nan, nan, nan, remark)


def _excitation(runs: Sequence[Sequence[Observation]], found: Sequence[RunForces]) -> BlockCut:
    if all(observation.run.is_free for run in runs for observation in run[:1]):
        return _undetermined("excitation", "free decays: nothing drives")
    if not any(run.structure is not None for run in found):
        return _undetermined("excitation", "the tank's own motion is measured, whatever made it")
    return _undetermined("excitation", "one sensor at the base: nothing to compare it with")


_INPUT_AND_OUTPUT: Final = {
    STRUCTURE: ("measured base motion and measured force between structure and tank", "motion"),
    TANK: ("measured motion of the tank", "force between structure and tank"),
    EITHER: ("measured base motion", "motion"),
}


def _of_place(
    place: str, forces: Sequence[LatentForce], shares: Mapping[str, tuple[float, float, float]]
) -> BlockCut:
    size = float(np.sqrt(np.mean(np.concatenate([force.force_n for force in forces]) ** 2)))
    noise = float(np.sqrt(np.mean([force.standard_error_n**2 for force in forces])))
    remark = "no force was measured between them: the two cannot be told apart by this" if place == EITHER else ""
    nan = float("nan")
    share, low, high = shares.get(place, (nan, nan, nan))
    fed_with, compared = _INPUT_AND_OUTPUT[place]
    return BlockCut(place, fed_with, compared, share, low, high, size, noise, remark)


def _parts(
    model: DiagnosedModel,
    runs: Sequence[Sequence[Observation]],
    found: Sequence[RunForces],
    places: Sequence[str],
    suspect: str,
) -> list[dict[str, FloatArray]]:
    """Per run, what each block explains of the weighted mismatch in each of some stretches of time."""
    parts = []
    for observed, forces in zip(runs, found, strict=True):
        series: dict[str, dict[str, FloatArray]] = {}
        for place in places:
            force = forces.at(place)
            if force is not None:
                own = beyond_own_parameters(model, forces, force)
                # A force within its own noise explains mismatch only by fitting that noise.
                if own.power_n2 < _RESOLVED * own.standard_error_n**2:
                    continue
                series[place] = channel_responses(forces, observed, getattr(model, "rig", None), own)
        part = {force.place: np.zeros(_N_PARTS) for force in forces.forces}
        comparable = [observation for observation in observed if observation.channel in forces.left]
        if len(comparable) > 1:
            part[SENSOR] = np.zeros(_N_PARTS)
        for observation in observed:
            missed = _weighted(observation, forces.missed[observation.channel], {})
            for place, shown in series.items():
                if observation.channel != suspect:
                    part[place] += _per_part(
                        # The inner product of mismatch and response: a response that does not look like the
                        # mismatch counts for nothing, and one against it is subtracted. A sum of squares would
                        # count both.
                        (missed * _weighted(observation, shown[observation.channel], {})).sum(axis=1)
                    )
            # Where a suspect is known the disagreement of the others with it is its own, and counts once.
            if SENSOR in part and observation in comparable and (not suspect or observation.channel == suspect):
                left = _weighted(observation, forces.left[observation.channel], {})
                power = (left**2).mean(axis=1)
                # Less one for each coefficient: that much is noise.
                beyond = np.where(power.mean() > _CONSISTENT**2, (left**2 - 1.0).sum(axis=1), 0.0)
                part[SENSOR] += _per_part(beyond)
        parts.append(part)
    return parts


def _per_part(blocks: FloatArray) -> FloatArray:
    return np.array([piece.sum() for piece in np.array_split(blocks, _N_PARTS)])


def _shares(parts: Sequence[Mapping[str, FloatArray]], seed: int) -> dict[str, tuple[float, float, float]]:
    """Share of each block with its 90 % interval, by drawing stretches of runs with replacement."""
    names = list(dict.fromkeys(name for part in parts for name in part))
    if not names:
        return {}
    table = np.concatenate(
        [np.stack([part.get(name, np.zeros(_N_PARTS)) for name in names]) for part in parts], axis=1
    )

    def share(columns: NDArray[Any]) -> FloatArray:
        # Shares are of sums, not means of shares: a stretch in which nothing moves says nothing about them.
        size = np.maximum(table[:, columns].sum(axis=1), 0.0)
        return size / size.sum() if size.sum() > 0 else np.full(len(names), np.nan)

    best = share(np.arange(table.shape[1]))
    generator = np.random.default_rng(seed)
    # Block bootstrap: whole stretches of all runs are drawn, as residuals within one are not independent.
    draws = [share(np.asarray(generator.integers(0, table.shape[1], table.shape[1]))) for _ in range(N_DRAWS)]
    low, high = np.nanquantile(np.array(draws), (0.05, 0.95), axis=0) if np.isfinite(best).all() else (best, best)
    return {
        name: (float(estimate), min(float(a), float(estimate)), max(float(b), float(estimate)))
        for name, estimate, a, b in zip(names, best, low, high, strict=True)
    }


def own_tolerances(model: DiagnosedModel, forces: RunForces, place: str) -> FloatArray:
    """Standard deviations of what a block's own parameters may be off, per displacement, velocity, acceleration.

    Parameters
    ----------
    model : DiagnosedModel
    forces : RunForces
    place : str
    """
    known = {parameter.name: parameter for parameter in model.parameters}

    def tolerance(name: str) -> float:
        return known[name].tolerance / max(abs(known[name].believed), 1e-300) if name in known else 0.0

    own = np.zeros(3)
    structure = forces.structure
    if structure is not None and place in (STRUCTURE, EITHER):
        # Modal numbers as seen from the tank, where the force acts: divided by the square of the deflection
        # there.
        scale = 1.0 / structure.mode_shape[0] ** 2
        # Twice, as a stiffness goes with the square of the frequency.
        own[0] = 2 * tolerance("frequency of mode 1") * structure.stiffnesses_n_per_m[0] * scale
        own[1] = tolerance("damping of mode 1") * structure.dampings_kg_per_s[0] * scale
        own[2] = tolerance("modal mass of mode 1") * structure.masses_kg[0] * scale
    if place in (TANK, EITHER):
        own[2] = np.hypot(own[2], tolerance("carried mass") * forces.carried_mass_kg)
        for term in model.twin.terms:
            if term.place == "tank" and "damping_n_s_per_m" in term.values:
                own[1] = np.hypot(
                    own[1], tolerance(f"{term.name}.damping_n_s_per_m") * term.values["damping_n_s_per_m"]
                )
    return own


def beyond_own_parameters(model: DiagnosedModel, forces: RunForces, force: LatentForce) -> LatentForce:
    """A force less what the block's own parameters explain of it within their tolerances.

    Parameters
    ----------
    model : DiagnosedModel
    forces : RunForces
        Of the same run.
    force : LatentForce
    """
    tolerances = own_tolerances(model, forces, force.place)
    free = tolerances > 0
    if not free.any():
        return force
    scaled = force.motion[:, free] * tolerances[free]
    # RMS of acceleration over that of velocity is the angular frequency of the motion. Samples are far closer
    # than independent readings; about as many as the motion has radians are taken for those.
    spread = force.motion[:, 2].std() / max(force.motion[:, 1].std(), 1e-300)
    duration = force.time_s[-1] - force.time_s[0]
    independent = max(4.0, duration * spread)
    squares = scaled.T @ scaled
    # Ridge regression: the prior of a number in tolerances is a unit normal one. All of the force is taken for
    # noise, so that little of it goes to the block's own numbers unless the motion says so.
    ridge = force.force_n.size / independent * float(np.var(force.force_n))
    ridge = max(ridge, 1e-9 * float(np.trace(squares)), 1e-30)
    numbers = np.linalg.solve(squares + ridge * np.eye(scaled.shape[1]), scaled.T @ force.force_n)
    rest = force.force_n - scaled @ numbers
    return replace(force, force_n=rest)

"""Effects that may be missing, and candidates: one effect at one place, with prior, start values and bounds."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.errors import InputError, SloshlabError
from sloshlab.missing_physics.extension import Extension
from sloshlab.missing_physics.prior import ParameterPrior, Range, about, drawn, prior_of, unit_scale
from sloshlab.missing_physics.units import named_and_units
from sloshlab.registry import Registry
from sloshlab.rig import Rig
from sloshlab.twin.twin import Twin

BLOCKS: Final = ("excitation", "structure", "tank", "aerodynamics", "control", "sensor")
"""Air and control are those of a wing in flight."""
BLOCKS_OF_A_RIG: Final = ("excitation", "structure", "tank", "sensor")


@dataclass(frozen=True, eq=False)
class MissingForce:
    """Force that the baseline lacks in a run.

    Attributes
    ----------
    force_n : ndarray, shape (n,)
        At every sample, upward positive.
    noise_power : ndarray, shape (n + 1,), optional
        Of every frequency of the run padded to twice its length, as E|rfft|² [N²]; of one newton at every sample
        if not given.
    """

    force_n: NDArray[np.float64]
    noise_power: NDArray[np.float64] | None = None

    def along(self, shape: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
        """Matched filter: the force along a shape that begins at each sample, and the power of the shape alone.

        A shape of size A adds A times its power where it begins; the noise of the force along it has this power
        as its variance.

        Parameters
        ----------
        shape : ndarray, shape (m,)
        """
        n = self.force_n.size
        weights = 1.0 if self.noise_power is None else n / self.noise_power
        of_shape = np.fft.rfft(shape, 2 * n)
        along = np.fft.irfft(weights * np.fft.rfft(self.force_n, 2 * n) * of_shape.conj(), 2 * n)
        power = np.fft.irfft(weights * np.abs(of_shape) ** 2, 2 * n)[0]
        return along[: n - shape.size + 1], float(power)


MissingForces = Mapping[str, MissingForce]
"""By run."""


@dataclass(frozen=True)
class Surroundings:
    """What an effect may know of rig and motion to choose start values.

    Attributes
    ----------
    rig : Rig
    twin : Twin
        The baseline.
    displacement_m, velocity_m_per_s, acceleration_m_per_s2 : float
        Largest of the tank in the runs that are fitted.
    frequency_hz : float
        Of most of the motion.
    force_n : float
        The mass that moves times the largest acceleration.
    channels : mapping of str to float
        Compared and driving channels with their RMS.
    driving : tuple of str
        Channels that drive the simulation.
    sampling_rate_hz : float
    longest_run_s : float
    blocks : tuple of str
        That the twin has; effects of others are not offered.
    peaks : mapping of str to float
        The same channels with their largest reading.
    channel : str
        Where an effect of a sensor acts, while its starts are asked for; several of one device are joined by `+`.
    has_one_frequency : bool
        Whether the tank moves at one frequency, the same in all runs.
    missed_hz : tuple of float
        Frequencies of the largest residuals of the retuned baseline: there a mode may be missing.
    n_modes : int
        Of the structure.
    incoherent_with_base : frozenset of str
        Channels that are not coherent with the base: not its motion times a gain, with a delay.
    runs : tuple of str
        Names of the runs that are fitted, each of which may have numbers of its own.
    update_rates_hz : mapping of str to tuple of float
        Channels whose readings change at some instants only, and rates [Hz] of these, the likeliest first.
    own_effects : tuple of Effect
        Of a twin that says itself what may be missing, in the place of all known effects but those of sensors.
    """

    rig: Rig
    twin: Twin
    displacement_m: float
    velocity_m_per_s: float
    acceleration_m_per_s2: float
    frequency_hz: float
    force_n: float
    channels: Mapping[str, float]
    driving: tuple[str, ...]
    sampling_rate_hz: float
    longest_run_s: float
    blocks: tuple[str, ...] = BLOCKS_OF_A_RIG
    peaks: Mapping[str, float] = field(default_factory=dict)
    channel: str = ""
    has_one_frequency: bool = False
    missed_hz: tuple[float, ...] = ()
    n_modes: int = 1
    incoherent_with_base: frozenset[str] = frozenset()
    runs: tuple[str, ...] = ()
    update_rates_hz: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    own_effects: tuple[Effect, ...] = ()

    @property
    def reading(self) -> float:
        """RMS of the channel on which an effect acts, in its unit."""
        return max(*(self.channels.get(name, 0.0) for name in channels_of(self.channel)), 1e-300)

    @property
    def moving_mass_kg(self) -> float:
        """Force over acceleration."""
        return self.force_n / max(self.acceleration_m_per_s2, 1e-300)

    @property
    def omega(self) -> float:
        """2π times the frequency [rad/s]."""
        return 2 * 3.141592653589793 * self.frequency_hz


@dataclass(frozen=True)
class EffectParameter:
    """One number of an effect.

    Attributes
    ----------
    name : str
        With its unit, as in the vocabulary.
    low, high : float
    range : Range or None
        What is believed of it; without one, two decades about its largest start.
    each_run : bool
        Whether every run has one of its own, as the phase of a machine that runs by itself: ``NAME in RUN``.
    run : str
        The only one to which it belongs, once `Effect.of_runs` has made one for each; else empty.
    tolerance : callable or None
        (surroundings) → scale of its steps in a fit, where that is not its size.
    """

    name: str
    low: float
    high: float
    range: Range | None = None
    each_run: bool = False
    run: str = ""
    tolerance: Callable[[Surroundings], float] | None = None


Numbers = Mapping[str, float]


def in_run(name: str, run: str) -> str:
    """Name of a number that belongs to one run.

    Examples
    --------
    >>> in_run("phase", "run_02")
    'phase in run_02'
    """
    return f"{name} in {run}"


def without_run(name: str) -> str:
    """Name of a number without the run to which it belongs.

    Examples
    --------
    >>> without_run("phase in run_02"), without_run("size_n")
    ('phase', 'size_n')
    """
    return name.partition(in_run("", ""))[0]


def multiples(
    parameters: Sequence[EffectParameter], *sets: Numbers
) -> Callable[[Surroundings], Iterable[Numbers]]:
    """Starts that are stated in multiples of the scales of the parameters' ranges."""
    scales = {known.name: known.range.scale if known.range else unit_scale for known in parameters}
    return lambda at: [{name: share * scales[name](at) for name, share in numbers.items()} for numbers in sets]


_JOINED: Final = "+"
_FROM: Final = "<"


def joined_channels(names: Sequence[str]) -> str:
    """Name of a place that is several channels of one device.

    Examples
    --------
    >>> joined_channels(["force_cell_1", "force_cell_2"])
    'force_cell_1+force_cell_2'
    """
    return _JOINED.join(names)


def channels_of(place: str) -> tuple[str, ...]:
    """Channels on which an effect acts at a place; a source after `<` is none of them.

    Examples
    --------
    >>> channels_of("force_cell_1+force_cell_2"), channels_of("acceleration_tip<displacement_tank")
    (('force_cell_1', 'force_cell_2'), ('acceleration_tip',))
    """
    return tuple(place.partition(_FROM)[0].split(_JOINED))


def _always_possible(surroundings: Surroundings) -> bool:
    """Acts in any twin."""
    del surroundings
    return True


def _no_channel(surroundings: Surroundings) -> Sequence[str]:
    """Acts on a block as a whole."""
    del surroundings
    return [""]


def _no_other_limits(surroundings: Surroundings) -> Mapping[str, tuple[float, float]]:
    """Has the same bounds at every place."""
    del surroundings
    return {}


def _no_further_starts(surroundings: Surroundings) -> Sequence[Numbers]:
    """Has a smooth force: its starts are enough."""
    del surroundings
    return []


def _no_proposals(surroundings: Surroundings, missing: MissingForces, known: Numbers) -> Sequence[Numbers]:
    """Reads nothing from the missing force."""
    del surroundings, missing, known
    return []


@dataclass(frozen=True)
class Effect:
    """One kind of missing physics.

    Attributes
    ----------
    name, block, equation : str
    parameters : tuple of EffectParameter
    starts : callable
        (surroundings) → sets of numbers to start from, each small enough to leave the simulation running.
    extension : callable
        (numbers, surroundings, channel) → what it adds to the simulation.
    separated_by : str
        An experiment that tells it from others like it.
    needs : callable
        (surroundings) → whether it can act there.
    places : callable
        (surroundings) → channels on which it may act; one empty name where it acts on none.
    limits : callable
        (surroundings) → bounds of parameters that depend on the place, in place of their own.
    spoken_for_by : tuple of str
        Terms of `evidence.TERMS` that hold for the latent force, or the sensor, where it is missing.
    variant_of : str
        Name of the effect of which this is another form; answers have that name.
    reduces_to : tuple of str
        Names of the effects of its block that it becomes with numbers of its own range: nested models.
    corrects : str
        What the twin has already and it changes by a number: its being there refutes what is believed of that.
    size : tuple of str
        Numbers that grow with it and without which it is nothing; if none, the first and all of its unit.
    sought_at : callable
        (surroundings) → more sets of start values, matched to the latent force along the measured motion: many,
        for a multimodal effect.
    proposes : callable
        (surroundings, missing force of every run, numbers that all runs share or none) → sets of start values that
        the missing force itself shows, for forces whose instants or frequency no other place would meet.
    """

    name: str
    block: str
    equation: str
    parameters: tuple[EffectParameter, ...]
    starts: Callable[[Surroundings], Iterable[Numbers]]
    extension: Callable[[Numbers, Surroundings, str], Extension]
    separated_by: str = ""
    needs: Callable[[Surroundings], bool] = _always_possible
    places: Callable[[Surroundings], Sequence[str]] = _no_channel
    spoken_for_by: tuple[str, ...] = ()
    limits: Callable[[Surroundings], Mapping[str, tuple[float, float]]] = _no_other_limits
    variant_of: str = ""
    reduces_to: tuple[str, ...] = ()
    corrects: str = ""
    size: tuple[str, ...] = ()
    sought_at: Callable[[Surroundings], Iterable[Numbers]] = _no_further_starts
    proposes: Callable[[Surroundings, MissingForces, Numbers], Iterable[Numbers]] = _no_proposals

    @property
    def key(self) -> str:
        """Block and name."""
        return f"{self.block}.{self.name}"

    @property
    def known_as(self) -> str:
        """The name that an answer has."""
        return self.variant_of or self.name

    @property
    def kinds_of_numbers(self) -> tuple[str, ...]:
        """Names of its numbers, those that each run has of its own once."""
        return tuple(dict.fromkeys(without_run(known.name) for known in self.parameters))

    def prior(self, surroundings: Surroundings) -> tuple[ParameterPrior, ...]:
        """What is believed of its numbers there, in their order."""
        limits = self.limits(surroundings)
        starts = [] if all(known.range for known in self.parameters) else list(self.starts(surroundings))
        found = []
        for known in self.parameters:
            bounds = limits.get(known.name, (known.low, known.high))
            if known.range is not None:
                found.append(prior_of(known.name, known.range, bounds, surroundings))
            else:
                size = max((abs(start[known.name]) for start in starts), default=1.0)
                found.append(about(known.name, size, bounds))
        return tuple(found)

    def of_runs(self, runs: Sequence[str]) -> Effect:
        """The effect with a number for every run in place of those that each run has of its own."""
        own = {known.name for known in self.parameters if known.each_run}
        if not own:
            return self
        parameters = [known for known in self.parameters if not known.each_run]
        parameters += [
            replace(known, name=in_run(known.name, run), each_run=False, run=run)
            for known in self.parameters
            if known.each_run
            for run in runs
        ]

        def spread(numbers: Numbers) -> Numbers:
            shared = {name: value for name, value in numbers.items() if name not in own}
            # a set may state numbers of some runs; the others have what it states for all
            return {**{in_run(name, run): numbers[name] for name in own & set(numbers) for run in runs}, **shared}

        return replace(
            self,
            parameters=tuple(parameters),
            starts=lambda at: [spread(numbers) for numbers in self.starts(at)],
            proposes=lambda at, missing, known: [spread(found) for found in self.proposes(at, missing, known)],
        )


@dataclass(frozen=True)
class Candidate:
    """An effect at a place.

    Attributes
    ----------
    effect : Effect
    surroundings : Surroundings
    channel : str
        Of sensor effects; empty otherwise.
    """

    effect: Effect
    surroundings: Surroundings
    channel: str = ""

    @property
    def key(self) -> str:
        """Name that tells candidates of one case apart."""
        return ".".join(part for part in (self.effect.block, self.effect.name, self.channel) if part)

    @property
    def names(self) -> dict[str, EffectParameter]:
        """Its numbers by the names that they have in a fit."""
        return {f"{self.key}.{known.name}": known for known in self.effect.parameters}

    def reduces_to(self, other: Candidate) -> bool:
        """Whether another effect at the same place is nested in this one."""
        here, there = (self.effect.block, self.channel), (other.effect.block, other.channel)
        return here == there and other.effect.name in self.effect.reduces_to

    def starts(self) -> list[dict[str, float]]:
        """Sets of numbers to start from, named as in a fit."""
        return self._named(self.effect.starts)

    def sought_at(self) -> list[dict[str, float]]:
        """More sets of numbers, named as in a fit, to match to the latent force."""
        return self._named(self.effect.sought_at)

    def proposed(
        self, missing: MissingForces, values: Mapping[str, float] = MappingProxyType({})
    ) -> list[dict[str, float]]:
        """Sets of numbers, named as in a fit, that a missing force itself shows.

        Parameters
        ----------
        missing : mapping of run to MissingForce
        values : mapping, optional
            Of a fit with this effect: only what it has of its own in each run is sought.
        """
        shared = {
            known.name: values[name] for name, known in self.names.items() if not known.run and name in values
        }
        return self._named(lambda at: self.effect.proposes(at, missing, shared))

    @property
    def prior(self) -> tuple[ParameterPrior, ...]:
        """What is believed of its numbers, named as in a fit."""
        found = self.effect.prior(replace(self.surroundings, channel=self.channel))
        return tuple(replace(known, name=f"{self.key}.{known.name}") for known in found)

    def drawn(self, n: int) -> list[dict[str, float]]:
        """Its first start and n − 1 sets of numbers that fill its prior evenly, named as in a fit."""
        return [self.starts()[0], *drawn(self.prior, max(n - 1, 0))][:n]

    def _named(self, sets: Callable[[Surroundings], Iterable[Numbers]]) -> list[dict[str, float]]:
        return [
            {f"{self.key}.{name}": value for name, value in numbers.items()}
            for numbers in sets(replace(self.surroundings, channel=self.channel))
        ]

    @property
    def sizes(self) -> tuple[str, ...]:
        """Numbers that grow with the effect, as the effect says or the first and all of its unit.

        None where the first is a place, which has steps of its own: a place that follows a linear step is lost.
        """
        if self.effect.parameters[0].tolerance is not None:
            return self.effect.size
        names = [parameter.name for parameter in self.effect.parameters]
        unit = named_and_units(names[0])[1]
        return self.effect.size or tuple(name for name in names if named_and_units(name)[1] == unit)

    def sized(self, start: Numbers, factor: float) -> dict[str, float]:
        """Numbers, named as in a fit, of the same effect larger by a factor."""
        grown = {f"{self.key}.{name}" for name in self.sizes}
        return {name: value * (factor if name in grown else 1.0) for name, value in start.items()}

    def bounds(self, parameter: EffectParameter) -> tuple[float, float]:
        """Smallest and largest value of a parameter here."""
        limits = self.effect.limits(replace(self.surroundings, channel=self.channel))
        return limits.get(parameter.name, (parameter.low, parameter.high))

    def scale(self, parameter: str) -> float:
        """Scale of a parameter, for its steps in a fit."""
        known = next(known for known in self.effect.parameters if known.name == parameter)
        if known.tolerance is not None:
            return known.tolerance(replace(self.surroundings, channel=self.channel))
        # The largest start, as sizes have no tolerance to be scaled by.
        sizes = [abs(start[f"{self.key}.{parameter}"]) for start in self.starts()]
        return max(max(sizes, default=1.0), 1e-12)

    def extension(self, numbers: Numbers) -> Extension:
        """What it adds, with these numbers."""
        added = self.effect.extension(numbers, self.surroundings, self.channel)
        # Functions cannot be compared; names and numbers tell the caches of a model which simulation it is.
        key = ((self.key, *sorted(numbers.items())),)
        return replace(added, key=key)


def extension_of(candidates: Sequence[Candidate], values: Mapping[str, float]) -> Extension:
    """What candidates add together.

    Parameters
    ----------
    candidates : sequence of Candidate
    values : mapping
        Their numbers, named as in a fit.
    """
    total = Extension()
    for candidate in candidates:
        numbers = {
            parameter.name: values[f"{candidate.key}.{parameter.name}"]
            for parameter in candidate.effect.parameters
        }
        total = total + candidate.extension(numbers)
    return total


EFFECTS: Final = Registry[Effect]("effect", group="sloshlab.effects")
"""By block and name; other packages add theirs as entry points."""


def register(effect: Effect) -> Effect:
    """Make an effect known; returns it.

    Raises
    ------
    InputError
        If its block is none, or another effect has its name.
    """
    if effect.block not in BLOCKS:
        raise InputError(f"effect {effect.name}: block", got=repr(effect.block), allowed=", ".join(BLOCKS))
    # an entry point that is being loaded registers the very effect that it offers
    if effect.key in EFFECTS.added and EFFECTS[effect.key] is not effect:
        raise InputError(f"effect {effect.name}", got="a name that is taken", remedy="choose another name")
    return EFFECTS.add(effect.key, effect)


def withdraw(effect: Effect) -> None:
    """Make an effect unknown again; nothing happens where it is not known."""
    if effect.key in EFFECTS.added and EFFECTS[effect.key] is effect:
        EFFECTS.withdraw(effect.key)


def known_effects() -> list[Effect]:
    """All effects, in the order in which they were registered; then those that other packages offer.

    Raises
    ------
    InputError
        If what a package offers cannot be loaded, or is no effect.
    """
    found: dict[str, Effect] = {}
    for name in EFFECTS.names:
        effect: object = EFFECTS[name]
        if not isinstance(effect, Effect):
            raise InputError(f"effect {name}", got=type(effect).__name__, allowed="Effect")
        found.setdefault(effect.key, effect)
    return list(found.values())


def candidates(surroundings: Surroundings) -> list[Candidate]:
    """Every effect at every place where it can act.

    Parameters
    ----------
    surroundings : Surroundings

    Raises
    ------
    InputError
        If an effect cannot say where it starts, or what it adds there.
    """
    found: list[Candidate] = []
    known = known_effects()
    if surroundings.own_effects:
        known = [*surroundings.own_effects, *(effect for effect in known if effect.block == "sensor")]
    for effect in known:
        # A twin of a user's own has no tank, whatever its module registers.
        if effect.block not in surroundings.blocks:
            continue
        try:
            # What cannot act here is neither tried nor listed as failed.
            if not effect.needs(surroundings):
                continue
            own = effect.of_runs(surroundings.runs)
            made = [Candidate(own, surroundings, place) for place in effect.places(surroundings)]
            for candidate in made:
                _require_sound(candidate)
        except Exception as error:
            raise InputError(
                f"effect {effect.block}.{effect.name}",
                got=f"{type(error).__name__}: {error}"[:300],
                remedy="correct its starts and extension",
            ) from error
        found += made
    return found


def _require_sound(candidate: Candidate) -> None:
    """Starts that name every parameter, within its bounds, and an extension for each."""
    names = {parameter.name for parameter in candidate.effect.parameters}
    starts = [
        dict(start)
        for start in candidate.effect.starts(replace(candidate.surroundings, channel=candidate.channel))
    ]
    if not names or not starts:
        raise InputError(
            "parameters and starts", got=f"{len(names)} and {len(starts)}", allowed="one or more of both"
        )
    # Before the search, which would find it out after minutes.
    for numbers in starts:
        if set(numbers) != names:
            raise InputError("a start", got=", ".join(sorted(numbers)), allowed=", ".join(sorted(names)))
        with suppress(SloshlabError):  # numbers that cannot be simulated here; its fit will fail and say so
            candidate.extension(numbers)

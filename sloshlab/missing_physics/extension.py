"""What an effect adds to a simulation: forces, changed drive, liquid and structure, faults of sensors."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from sloshlab.recording import with_values
from sloshlab.twin.structure import Structure
from sloshlab.twin.terms import Term

FloatArray = NDArray[np.float64]
Reading = Callable[[FloatArray, float, Mapping[str, FloatArray], FloatArray], FloatArray]
"""(values, sampling rate, other channels of the run, what was recorded) → values."""


@dataclass(frozen=True)
class SensorFault:
    """What a channel makes of what it should show.

    Attributes
    ----------
    channel : str
    reading : callable
        From the truth to what is recorded.
    undone : callable or None
        From what is recorded to the truth, for channels that drive the simulation; None where that is impossible.
    key : tuple
        Identifies the fault, for caches.
    run : str
        In which alone it acts; empty where it acts in all.
    reads_others : bool
        Whether readings of other channels are part of it.
    """

    channel: str
    reading: Reading
    undone: Reading | None
    key: tuple[Any, ...]
    run: str = ""
    reads_others: bool = False

    @property
    def leaves_drive(self) -> bool:
        """Whether the channel is left out where others can drive: what it should show is lost, or would be
        known only with the noise of channels that the simulation is compared with.
        """
        return self.undone is None or self.reads_others

    def acts_on(self, channel: str, run: str) -> bool:
        """Whether it changes a channel of a run."""
        return self.channel == channel and self.run in ("", run)


def _as_it_is(
    shown: FloatArray, rate_hz: float, others: Mapping[str, FloatArray], recorded: FloatArray
) -> FloatArray:
    del rate_hz, others, recorded
    return shown


def left_out_of_drives(channels: Iterable[str]) -> tuple[SensorFault, ...]:
    """Faults that change no reading, by which channels leave the drive to others beside them.

    Parameters
    ----------
    channels : iterable of str
    """
    return tuple(SensorFault(name, _as_it_is, None, ("left out", name)) for name in sorted(channels))


@dataclass(frozen=True)
class ActingDrive:
    """What acts in place of what a driving channel holds: the channel is a command, and something obeys it badly.

    Attributes
    ----------
    channel : str
    acting : callable
        From the command to what acts.
    key : tuple
        Identifies it, for caches.
    """

    channel: str
    acting: Callable[[FloatArray], FloatArray]
    key: tuple[Any, ...]


def with_acting(recording: xr.Dataset, drives: tuple[ActingDrive, ...]) -> xr.Dataset:
    """A copy of a recording whose driving channels hold what acts; channels that it has not are left out."""
    for drive in drives:
        if drive.channel in recording.data_vars:
            commanded = np.asarray(recording[drive.channel].values, np.float64)
            recording = with_values(recording, drive.channel, drive.acting(commanded))
    return recording


@dataclass(frozen=True)
class Extension:
    """Everything that a simulation has beyond its baseline.

    Attributes
    ----------
    terms : tuple of Term
        Forces that are added.
    liquid : callable or None
        Changes the baseline's forces of the liquid.
    faults : tuple of SensorFault
    key : tuple
        Identifies the extension, for caches: names and numbers of all effects; by default of all that it adds.
    structure : callable or None
        Changes the baseline's structure, after its own numbers were retuned.
    drives : tuple of ActingDrive
    run_terms : mapping of str to tuple of Term
        Forces that are added in one run alone.
    numbers : mapping of str to float
        Numbers of a twin that has the effect itself and believes that it is not there, by their names.
    """

    terms: tuple[Term, ...] = ()
    liquid: Callable[[tuple[Term, ...]], tuple[Term, ...]] | None = None
    faults: tuple[SensorFault, ...] = ()
    key: tuple[Any, ...] = field(default=())
    structure: Callable[[Structure], Structure] | None = None
    drives: tuple[ActingDrive, ...] = ()
    run_terms: Mapping[str, tuple[Term, ...]] = field(default_factory=dict)
    numbers: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.key:
            of_runs = [(run, term) for run, terms in self.run_terms.items() for term in terms]
            own = [_identity(term) for term in self.terms] + [(run, *_identity(term)) for run, term in of_runs]
            others = [fault.key for fault in self.faults] + [drive.key for drive in self.drives]
            # by the functions themselves, which a cache that keeps the key keeps alive
            changes = [("changes", part) for part in (self.liquid, self.structure) if part is not None]
            numbers = [("number", *item) for item in sorted(self.numbers.items())]
            object.__setattr__(self, "key", (*own, *others, *changes, *numbers))

    def terms_in(self, run: str) -> tuple[Term, ...]:
        """Forces that are added in a run."""
        return self.terms + self.run_terms.get(run, ())

    def __add__(self, other: Extension) -> Extension:
        """Both together; the other's changes of liquid and structure come after this one's."""
        return Extension(
            self.terms + other.terms,
            _composed(self.liquid, other.liquid),
            self.faults + other.faults,
            self.key + other.key,
            _composed(self.structure, other.structure),
            self.drives + other.drives,
            {
                run: self.run_terms.get(run, ()) + other.run_terms.get(run, ())
                for run in {**self.run_terms, **other.run_terms}
            },
            {**self.numbers, **other.numbers},
        )


def _identity(term: Term) -> tuple[Any, ...]:
    return (term.name, term.place, *sorted(term.values.items()), hash(term.table.tobytes()))


_Changed = TypeVar("_Changed")


def _composed(
    first: Callable[[_Changed], _Changed] | None, second: Callable[[_Changed], _Changed] | None
) -> Callable[[_Changed], _Changed] | None:
    if first is None or second is None:
        return first or second
    # In the order of the effects: the second changes terms that the first may have replaced.
    return lambda unchanged: second(first(unchanged))


NOTHING = Extension()

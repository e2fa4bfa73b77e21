"""What a benchmark is made of: records, their split, models with names, and errors that others published."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.user_twin.description import UserTwin

FloatArray = NDArray[np.float64]
BASELINE: Final = "baseline"
NAMED: Final = "named"
PUBLISHED_NUMBERS: Final = "published numbers"
LINEAR, PHYSICAL, BLACK_BOX = "linear", "physical", "black box"


@dataclass(frozen=True, eq=False)
class Record:
    """Inputs and outputs over a stretch of time.

    Attributes
    ----------
    name : str
    channels : mapping of str to ndarray, shape (n,)
        In SI units; the quantity is the first word of a channel's name.
    sampling_rate_hz : float
    n_initial : int
        Outputs at the beginning that a model may see for its initial state, and that are not scored.
    noise_std : mapping of str to float
        White noise of a channel, where it is documented.
    """

    name: str
    channels: Mapping[str, FloatArray]
    sampling_rate_hz: float
    n_initial: int = 0
    noise_std: Mapping[str, float] = field(default_factory=dict)

    @property
    def n_samples(self) -> int:
        """Length."""
        return int(next(iter(self.channels.values())).size)


@dataclass(frozen=True, eq=False)
class BenchmarkData:
    """Records split as the benchmark asks.

    Attributes
    ----------
    training, tests : tuple of Record
        Tests choose nothing: they are simulated once a model is fitted.
    is_published_test : bool
        Whether errors on the tests can be compared with published ones.
    note : str
        What a reader must know of the split, if anything.
    """

    training: tuple[Record, ...]
    tests: tuple[Record, ...]
    is_published_test: bool = True
    note: str = ""
    linear: tuple[Record, ...] = ()


@dataclass(frozen=True, eq=False)
class NamedModel:
    """A twin, and effects of the vocabulary that are added to it.

    Attributes
    ----------
    name : str
        In the words of the field.
    twin : UserTwin
    effects : tuple of str
        Effects of the structure, by their names.
    role : str
        `BASELINE`, `NAMED` or `PUBLISHED_NUMBERS`.
    numbers : mapping of str to float
        Of a model that somebody published: it is not fitted. Effects' numbers as ``structure.EFFECT.NUMBER``.
    """

    name: str
    twin: UserTwin
    effects: tuple[str, ...] = ()
    role: str = NAMED
    numbers: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Published:
    """A free-run error that somebody published.

    Attributes
    ----------
    model : str
    kind : str
        `LINEAR`, `PHYSICAL` (structure and numbers mean something) or `BLACK_BOX`.
    test : str
        Name of the test record.
    error : float
        In the unit of the benchmark.
    reference, doi : str
        The DOI is empty where none is known.
    """

    model: str
    kind: str
    test: str
    error: float
    reference: str
    doi: str = ""


@dataclass(frozen=True, eq=False)
class Benchmark:
    """One benchmark.

    Attributes
    ----------
    name : str
        As on the command line.
    title : str
    files : tuple of str
        Names of the files without which it cannot be run.
    source : str
        Where they are to be had.
    read : callable
        (data folder) → `BenchmarkData`.
    models : callable
        (`BenchmarkData`) → models, the baseline first; of its records the training ones count.
    scored : str
        Output whose error counts.
    unit : str
        Of errors.
    per_si_unit : float
        Errors in `unit` per error in SI units.
    published : tuple of Published
    reference, doi : str
        Of the benchmark itself.
    twin_file : Path, optional
        Module of the baseline, with which the search for missing physics is run.
    """

    name: str
    title: str
    files: tuple[str, ...]
    source: str
    read: Callable[[Path | None], BenchmarkData]
    models: Callable[[BenchmarkData], tuple[NamedModel, ...]]
    scored: str
    unit: str
    per_si_unit: float
    published: tuple[Published, ...]
    reference: str
    doi: str = ""
    twin_file: Path | None = None

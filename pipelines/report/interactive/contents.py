"""What a figure that can be touched shows, as the page carries it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Final, Literal, Protocol

import numpy as np
import numpy.typing as npt

from pipelines.report.interactive.envelope import envelope_samples
from pipelines.report.interactive.packed import packed, packed_steps

FloatArray = npt.NDArray[np.float64]
Role = Literal["recorded", "believed", "before", "after", "other"]
_SMALLEST_POWER_RATIO: Final = 1e-12
"""Of the largest in a spectrum: what is below is rounding, and would squash the axis."""

_MOST_SEEN_FIRST: Final = 2500
"""Samples of a close-up, which is as many as any screen has columns."""


class Touchable(Protocol):
    """Content of a figure that can be touched."""

    @property
    def caption(self) -> str:
        """What is seen on a screen, instead of the caption of the image."""
        ...

    def plain(self) -> dict[str, Any]:
        """As JSON has it."""
        ...


@dataclass(frozen=True, eq=False)
class Line:
    """One line of a time history or of a spectrum.

    Attributes
    ----------
    label : str
    role : str
        Decides its colour, and which switch shows and hides it.
    values : ndarray, shape (n,)
    begins_hidden : bool
        Whether it has to be switched on first.
    """

    label: str
    role: Role
    values: FloatArray
    begins_hidden: bool = False


@dataclass(frozen=True, eq=False)
class Channel:
    """A channel of one run.

    Attributes
    ----------
    name, unit : str
    time_s : ndarray, shape (n,)
        Evenly spaced.
    lines : tuple of Line
        With equally many values.
    difference_to : str
        Label of the line that others are subtracted from, which is then drawn; empty for none.
    frequency_hz : ndarray, shape (m,)
    spectra : tuple of Line
        Amplitudes or densities at these frequencies; empty for none.
    spectrum_label : str
    view_s : tuple of float, optional
        Stretch to begin with.
    """

    name: str
    unit: str
    time_s: FloatArray
    lines: tuple[Line, ...]
    difference_to: str = ""
    frequency_hz: FloatArray = field(default_factory=lambda: np.empty(0))
    spectra: tuple[Line, ...] = ()
    spectrum_label: str = ""
    view_s: tuple[float, float] | None = None

    def _seen_first(self) -> npt.NDArray[np.intp]:
        """All samples of the stretch to begin with, unless they are many."""
        if self.view_s is None:
            return np.empty(0, np.intp)
        inside = np.flatnonzero((self.time_s >= self.view_s[0]) & (self.time_s <= self.view_s[1]))
        return inside if inside.size <= _MOST_SEEN_FIRST else np.empty(0, np.intp)

    def plain(self, most_samples: int) -> dict[str, Any]:
        """As JSON has it, with about so many samples."""
        values = np.array([line.values for line in self.lines], np.float64).reshape(len(self.lines), -1)
        differences = [
            reference.values - line.values
            for reference in self.lines
            if reference.label == self.difference_to
            for line in self.lines
            if line is not reference
        ]
        kept = envelope_samples(np.vstack([values, *differences]), most_samples)
        kept = np.union1d(kept, self._seen_first())
        n, rate_s = self.time_s.size, 0.0
        if n > 1:
            rate_s = float(self.time_s[-1] - self.time_s[0]) / (n - 1)
        return {
            "name": self.name,
            "unit": self.unit,
            "start": float(self.time_s[0]) if n else 0.0,
            "interval": rate_s,
            "samples": packed_steps(kept),
            "of": n,
            "lines": [_plain_line(line, line.values[kept]) for line in self.lines],
            "difference_to": self.difference_to,
            "frequency": packed(self.frequency_hz),
            "spectra": [_plain_line(line, _decades(line.values)) for line in self.spectra],
            "spectrum_label": self.spectrum_label,
            "view": None if self.view_s is None else list(self.view_s),
        }


@dataclass(frozen=True, eq=False)
class Run:
    """Channels of one run; `group` is what it was used for."""

    name: str
    group: str
    channels: tuple[Channel, ...]


@dataclass(frozen=True, eq=False)
class Histories:
    """Time histories of chosen runs and channels, lines switched on and off, with their spectra.

    Attributes
    ----------
    title : str
    runs : tuple of Run
        The first is shown first, with its first channel.
    caption : str
    most_samples : int
        All channels of all runs together.
    """

    title: str
    runs: tuple[Run, ...]
    caption: str
    most_samples: int = 260_000

    def plain(self) -> dict[str, Any]:
        """As JSON has it."""
        n_lines = sum(len(channel.lines) + 1 for run in self.runs for channel in run.channels)
        each = max(200, self.most_samples // max(n_lines, 1))
        return {
            "kind": "histories",
            "title": self.title,
            "runs": [
                {
                    "name": run.name,
                    "group": run.group,
                    "channels": [channel.plain(each * len(channel.lines)) for channel in run.channels],
                }
                for run in self.runs
            ],
        }


def _plain_line(line: Line, values: FloatArray) -> dict[str, Any]:
    return {"label": line.label, "role": line.role, "hidden": line.begins_hidden, "values": packed(values)}


def _decades(values: FloatArray) -> FloatArray:
    """Logarithm to the base 10; NaN for zero and rounding."""
    values = np.asarray(values, np.float64)
    largest = float(np.nanmax(values, initial=0.0))
    shown = np.where(values > _SMALLEST_POWER_RATIO * largest, values, np.nan)
    return np.asarray(np.log10(shown))


@dataclass(frozen=True, eq=False)
class Quantity:
    """What the points of a map are coloured by, and the map behind them.

    Attributes
    ----------
    label : str
    values : ndarray, shape (n_points,)
    image : ndarray, shape (n_y, n_x), optional
        Over the extent of the map; NaN where nothing was measured.
    colours : tuple of str
        From the lowest to the highest.
    low, high : float
        What the first and the last colour mean.
    """

    label: str
    values: FloatArray
    image: FloatArray | None
    colours: tuple[str, ...]
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class Window:
    """What is seen of one point of a map.

    Attributes
    ----------
    run, words : str
        Which run it is of; frequency and level.
    time_s, force, displacement : ndarray, shape (n,)
        As many samples as are drawn.
    order, amplitude : ndarray, shape (m,)
        Spectrum of the force over multiples of the frequency of the motion.
    """

    run: str
    words: str
    time_s: FloatArray
    force: FloatArray
    displacement: FloatArray
    order: FloatArray
    amplitude: FloatArray

    def plain(self) -> dict[str, Any]:
        """As JSON has it."""
        return {
            "run": self.run,
            "words": self.words,
            "time": _even_or_packed(self.time_s),
            "force": packed(self.force),
            "displacement": packed(self.displacement),
            "order": packed(self.order),
            "amplitude": packed(_decades(self.amplitude)),
        }


def _even_or_packed(time_s: FloatArray) -> dict[str, Any]:
    """Times of samples; of evenly spaced ones their interval and count."""
    if time_s.size > 1:
        steps = np.diff(time_s)
        interval_s = float(steps.mean())
        if np.allclose(steps, interval_s, rtol=1e-3, atol=0.0):
            return {"interval": interval_s, "count": int(time_s.size)}
    return packed(time_s)


@dataclass(frozen=True, eq=False)
class WindowMap:
    """Points on a plane; each has its loop, its window of signals and its spectrum.

    Attributes
    ----------
    title, caption, x_label, y_label : str
    x, y : ndarray, shape (n_points,)
    others_x, others_y : ndarray, shape (n_others,)
        Points of which nothing more is shown.
    extent : tuple of float
        x from, x to, y from, y to of the maps.
    quantities : tuple of Quantity
    windows : tuple of Window
        One per point.
    force_label, displacement_label, amplitude_label : str
    first : int
        The point that is shown first.
    """

    title: str
    caption: str
    x_label: str
    y_label: str
    x: FloatArray
    y: FloatArray
    others_x: FloatArray
    others_y: FloatArray
    extent: tuple[float, float, float, float]
    quantities: tuple[Quantity, ...]
    windows: tuple[Window, ...]
    force_label: str
    displacement_label: str
    amplitude_label: str
    first: int = 0

    def plain(self) -> dict[str, Any]:
        """As JSON has it."""
        return {
            "kind": "map",
            "title": self.title,
            "labels": {
                "x": self.x_label,
                "y": self.y_label,
                "force": self.force_label,
                "displacement": self.displacement_label,
                "amplitude": self.amplitude_label,
            },
            "x": packed(self.x),
            "y": packed(self.y),
            "others": {"x": packed(self.others_x), "y": packed(self.others_y)},
            "extent": list(self.extent),
            "quantities": [_plain_quantity(quantity) for quantity in self.quantities],
            "windows": [window.plain() for window in self.windows],
            "first": self.first,
        }


def _plain_quantity(quantity: Quantity) -> dict[str, Any]:
    image = quantity.image
    return {
        "label": quantity.label,
        "values": packed(quantity.values),
        "image": None if image is None else {"rows": int(image.shape[0]), "values": packed(image)},
        "colours": list(quantity.colours),
        "low": quantity.low,
        "high": quantity.high,
    }

"""What an examination finds, and what follows from it."""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import xarray as xr

from sloshlab.consistency.force_response import ForceResponse
from sloshlab.out_of_core import blocks, empty
from sloshlab.recording import with_values

BoolArray = npt.NDArray[np.bool_]

SMALLEST_EFFECT = 0.01
"""Errors of W̄ or β below this are within what an analysis states as its own; they are told and not flagged.

A hundredth of the liquid's inertia: three hundredths of W̄ where the liquid begins to take energy (W̄ ≈ 0.3).
"""


class Action(enum.Enum):
    """What is done about a finding; the text is the explanation."""

    NOTED = "told only: it changes W̄ and β by less than their own errors"
    MASKED = "its samples are left out"
    FLAGGED = "the results are flagged"
    REFUSED = "the run is refused"


@dataclass(frozen=True)
class Finding:
    """One contradiction.

    Attributes
    ----------
    check : str
        What was examined, one of the names in `docs/consistency.md`.
    channels : tuple of str
        Where; empty for the run as a whole.
    what : str
        What is wrong and how much, in words and units.
    action : Action
    start_s, stop_s : float
        When, on the run's time; NaN for the whole run.
    w_bar_error, beta_error : float
        Largest error of W̄ and of β that it makes where it holds, absolute; NaN where it cannot be told.
    """

    check: str
    channels: tuple[str, ...]
    what: str
    action: Action
    start_s: float = math.nan
    stop_s: float = math.nan
    w_bar_error: float = math.nan
    beta_error: float = math.nan

    @property
    def text(self) -> str:
        """One line for a person."""
        where = f"{', '.join(self.channels)}: " if self.channels else ""
        when = "" if math.isnan(self.start_s) else f", {self.start_s:.4g} … {self.stop_s:.4g} s"
        known = [
            f"{symbol} by up to {error:.2g}"
            for symbol, error in (("W̄", self.w_bar_error), ("β", self.beta_error))
            if math.isfinite(error) and error > 0
        ]
        effect = f"; changes {' and '.join(known)}" if known else ""
        return f"{where}{self.what}{when}{effect}"

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers and texts; None for what is not known."""
        plain = {**vars(self), "channels": list(self.channels), "action": self.action.name.lower()}
        return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in plain.items()}


def contradiction(
    check: str,
    what: str,
    channels: tuple[str, ...] = (),
    *,
    effect: tuple[float, float] = (math.nan, math.nan),
    time_s: tuple[float, float] = (math.nan, math.nan),
) -> Finding:
    """A finding that flags the results, or is only told if all that it changes is small.

    Parameters
    ----------
    check, what, channels
        As in `Finding`.
    effect : tuple of float
        Largest errors of W̄ and β; where neither is known it is not known to be small.
    time_s : tuple of float
        When it begins and ends.

    Examples
    --------
    >>> contradiction("gain", "gains differ", ("force_cell_1",), effect=(1e-3, 2e-3)).action.name
    'NOTED'
    >>> contradiction("gain", "gains differ", ("force_cell_1",)).action.name
    'FLAGGED'
    """
    known = [error for error in effect if not math.isnan(error)]
    action = Action.NOTED if known and max(known) < SMALLEST_EFFECT else Action.FLAGGED
    return Finding(check, channels, what, action, *time_s, *effect)


@dataclass(frozen=True)
class OpenPoint:
    """What a run cannot tell.

    Attributes
    ----------
    what, why : str
        What may be wrong unseen, and why it is not seen.
    w_bar_error, beta_error : float
        How much it may change W̄ and β unseen; NaN where that is not known.
    """

    what: str
    why: str
    w_bar_error: float = math.nan
    beta_error: float = math.nan

    @property
    def text(self) -> str:
        """One line for a person."""
        errors = (("W̄", self.w_bar_error), ("β", self.beta_error))
        known = [f"{symbol} by up to {error:.2g}" for symbol, error in errors if math.isfinite(error)]
        effect = f" (it may change {' and '.join(known)})" if known else ""
        return f"{self.what}: {self.why}{effect}"


@dataclass(frozen=True)
class ConsistencyExamination:
    """Everything found in one run.

    Attributes
    ----------
    run_id : str
    findings : tuple of Finding
        In the order of the checks.
    not_checked : tuple of OpenPoint
        What this run cannot tell, and why.
    wrong_samples : mapping of str to ndarray of bool, shape (n_samples,)
        By channel: samples that were not measured although they are numbers.
    start : ForceResponse or None
        Force against acceleration at the quiet start, for comparison with other runs.
    """

    run_id: str
    findings: tuple[Finding, ...] = ()
    not_checked: tuple[OpenPoint, ...] = ()
    wrong_samples: Mapping[str, BoolArray] = field(default_factory=dict)
    start: ForceResponse | None = None

    @property
    def flags(self) -> tuple[str, ...]:
        """Findings that a reader must know before using the numbers."""
        return tuple(
            f"{self.run_id}: {finding.text}" for finding in self.findings if finding.action is not Action.NOTED
        )

    @property
    def refusals(self) -> tuple[str, ...]:
        """Why no result may rest on the run."""
        return tuple(finding.text for finding in self.findings if finding.action is Action.REFUSED)

    def with_findings(
        self, findings: Sequence[Finding], not_checked: Sequence[OpenPoint] = ()
    ) -> ConsistencyExamination:
        """The same with what another check found."""
        return replace(self, findings=(*self.findings, *findings), not_checked=(*self.not_checked, *not_checked))

    def measured_only(self, recording: xr.Dataset) -> xr.Dataset:
        """The recording with NaN, as for lost samples, where nothing was measured; a copy if anything changes."""
        if not self.wrong_samples:
            return recording
        masked = recording
        for name, samples in self.wrong_samples.items():
            values = recording[name].values
            measured = empty(values.size, np.result_type(values, np.float32))
            for part in blocks(values.size, values, measured):
                measured[part] = np.where(samples[part], np.nan, values[part])
            masked = with_values(masked, name, measured)
        return masked


NOT_EXAMINED: Final = ConsistencyExamination(
    "", not_checked=(OpenPoint("consistency", "the run was not examined"),)
)
"""Of a run that no examination has seen."""

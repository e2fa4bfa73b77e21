"""Runs cut to where everything that drives a user's twin is known: a channel may begin late, or end early."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from sloshlab.errors import InputError
from sloshlab.identification.case import Case, CaseRun

_FEWEST_SAMPLES: Final = 50
"""Of a run, that are worth a simulation."""


def with_known_drive(case: Case, driving: Sequence[str]) -> tuple[Case, tuple[str, ...]]:
    """A case whose runs begin and end where their driving channels do, and what was cut in words.

    Repeats of a test are cut alike, as they are compared sample by sample. Samples that are lost in between stay
    and are refused by the twin.

    Parameters
    ----------
    case : Case
    driving : sequence of str
        Channels; those that a run lacks are passed over.

    Raises
    ------
    InputError
        If hardly anything of a test is left.
    """
    cut: dict[str, CaseRun] = {}
    said = []
    for test in case.tests():
        stretches = [_known(run, driving) for run in test]
        first = max(begin for begin, _ in stretches)
        # A repeat that was recorded for longer is not cut for that.
        ends = [end for run, (_, end) in zip(test, stretches, strict=True) if end < run.recording.sizes["time"]]
        stop = min(ends, default=max(end for _, end in stretches))
        for run in test:
            n = int(run.recording.sizes["time"])
            if min(stop, n) - first < _FEWEST_SAMPLES:
                raise InputError(
                    f"run {run.name}",
                    got=f"{max(min(stop, n) - first, 0)} samples in which {', '.join(driving)} are known",
                    allowed=f"≥ {_FEWEST_SAMPLES}, in all repeats of its test together",
                )
            last = min(stop, n)
            if first > 0 or last < n:
                cut[run.name] = replace(run, recording=run.recording.isel(time=slice(first, last)))
                rate = run.attributes.sampling_rate_hz
                said.append(
                    f"{run.name} is cut to {first / rate:.4g} … {last / rate:.4g} s, where what drives is known"
                )
    runs = tuple(cut.get(run.name, run) for run in case.runs)
    return replace(case, runs=runs), tuple(said)


def _known(run: CaseRun, driving: Sequence[str]) -> tuple[int, int]:
    """First sample at which all driving channels are known, and the one after the last."""
    n = int(run.recording.sizes["time"])
    known = np.ones(n, bool)
    for name in driving:
        if name in run.recording.data_vars:
            known &= np.isfinite(np.asarray(run.recording[name].values, np.float64))
    at = np.flatnonzero(known)
    return (int(at[0]), int(at[-1]) + 1) if at.size else (n, 0)

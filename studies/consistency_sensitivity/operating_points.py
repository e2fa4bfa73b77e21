"""How the found share and the false alarms change when all thresholds are multiplied by one factor."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sloshlab.conditioning.calibration import identify_dry_mass
from sloshlab.consistency import (
    between_runs,
    bounds,
    force_over_time,
    like_sensors,
    noise_findings,
    samples,
    statement,
)
from sloshlab.consistency.between_runs import calibration_findings
from sloshlab.consistency.effect import Inertia
from sloshlab.consistency.examination import Reference, examined, like_series
from sloshlab.consistency.finding import Action, Finding
from sloshlab.errors import InputError
from sloshlab.recording import read_recording
from sloshlab.rig import Rig
from studies.consistency_sensitivity.damages import DAMAGES, Case
from studies.consistency_sensitivity.measurement import CaseFiles

FACTORS = (0.3, 0.5, 0.7, 1.0, 1.5, 2.5)
THRESHOLDS: tuple[tuple[Any, str], ...] = (
    (between_runs, "_SIGMA"),
    (bounds, "_SIGMA"),
    (force_over_time, "SIGMA"),
    (noise_findings, "_COMPRESSION_SIGMA"),
    (like_sensors, "SIGMA"),
    (like_sensors, "_MEAN_SIGMA"),
    (samples, "_SPIKE_SIGMA"),
    (samples, "_HOLD_MARGIN"),
    (statement, "_LEVEL_TOLERANCE"),
    (statement, "_FREQUENCY_TOLERANCE"),
)
"""Modules and the names of their thresholds."""


@contextlib.contextmanager
def thresholds_times(factor: float) -> Iterator[None]:
    """All thresholds multiplied, for as long as the context lasts."""
    before = [getattr(module, name) for module, name in THRESHOLDS]
    try:
        for (module, name), value in zip(THRESHOLDS, before, strict=True):
            setattr(module, name, factor * value)
        yield
    finally:
        for (module, name), value in zip(THRESHOLDS, before, strict=True):
            setattr(module, name, value)


def says_something(case: Case, rig: Rig) -> bool:
    """Whether the examination flags or refuses a case; windows are not computed."""
    rig = rig.model_copy(
        update={
            "tank": rig.tank.model_copy(update={"dry_mass_kg": case.dry_mass_kg}),
            "liquid": rig.liquid.model_copy(update={"fill_level": case.fill_level}),
        }
    )
    findings: list[Finding] = []
    reference = Reference(rig)
    try:
        if case.empty is not None and case.frozen is not None:
            dry = identify_dry_mass([case.empty], [case.frozen], liquid_mass_kg=rig.liquid_mass_kg)
            findings += calibration_findings(dry, rig, Inertia.of(rig, 20.0))
            findings += [
                finding for run in (case.empty, case.frozen) for finding in examined(run, reference).findings
            ]
            reference = Reference(rig, dry, like_series(case.frozen))
        findings += examined(case.sloshing, reference).findings
    except InputError:
        return True
    return any(finding.action is not Action.NOTED for finding in findings)


def found_shares(files: Sequence[CaseFiles], moving: set[tuple[str, str, float]]) -> dict[float, float]:
    """By factor, the share found of the damages that move W̄ or β.

    Parameters
    ----------
    files : sequence of CaseFiles
    moving : set of (case, damage, size)
        Those that count.
    """
    found: dict[float, list[bool]] = {factor: [] for factor in FACTORS}
    for one in files:
        case, rig = one.read(), Rig.from_toml(f"{one.folder}/rig_fill_{one.fill_level}.toml")
        for damage in DAMAGES:
            for size in damage.sizes:
                if (one.name, damage.name, size) not in moving:
                    continue
                damaged = damage.apply(case, size, np.random.default_rng(1))
                for factor in FACTORS:
                    with thresholds_times(factor):
                        found[factor].append(says_something(damaged, rig))
    return {factor: float(np.mean(answers)) for factor, answers in found.items()}


def false_alarm_shares(recordings: Sequence[Path]) -> dict[float, float]:
    """By factor, the share of undamaged recordings that the examination flags, each with the rig beside it."""
    alarms: dict[float, list[bool]] = {factor: [] for factor in FACTORS}
    for path in recordings:
        recording = read_recording(path)
        rig = Rig.from_toml(path.parent / str(recording.attrs["rig"]))
        for factor in FACTORS:
            with thresholds_times(factor):
                found = examined(recording, Reference(rig)).findings
            alarms[factor].append(any(finding.action is not Action.NOTED for finding in found))
    return {factor: float(np.mean(answers)) for factor, answers in alarms.items()}


def write_points(path: Path, found: dict[float, float], alarms: dict[float, float]) -> None:
    """Both curves as JSON."""
    points = [{"factor": factor, "found": found[factor], "false_alarms": alarms[factor]} for factor in FACTORS]
    path.write_text(json.dumps(points, indent=1) + "\n", encoding="utf-8")

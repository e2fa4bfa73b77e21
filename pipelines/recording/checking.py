"""The command `check`: whether recordings can be used, and what to know about them."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import xarray as xr

from pipelines.sweep.stages import examined_recording, naming
from sloshlab.conditioning.calibration import check_signs
from sloshlab.conditioning.quality import ChannelQuality, RunQuality, quality_of
from sloshlab.conditioning.redundancy import PairAgreement
from sloshlab.consistency.examination import Reference
from sloshlab.consistency.finding import ConsistencyExamination
from sloshlab.errors import InputError, RecordingError, RigError
from sloshlab.experiments import EXPERIMENTS
from sloshlab.recording import read_recording
from sloshlab.rig import Rig


def check_runs(paths: Sequence[Path]) -> dict[str, Any]:
    """Check recordings one after the other.

    Returns
    -------
    dict
        ``lines`` with a table per run, ``flags`` with losses and remarks, ``runs`` for machines.

    Raises
    ------
    RecordingError
        If a recording breaks the format or is unusable.
    """
    lines: list[str] = []
    flags: list[str] = []
    summaries = []
    refused: list[InputError] = []
    for path in paths:
        try:
            quality, examination = _examined(path)
        except InputError as error:
            refused.append(error)
            continue
        lines += _table(path, quality) + _consistency_lines(examination)
        flags += [f"{quality.run_id}: {remark}" for remark in quality.remarks] + list(examination.flags)
        findings = [finding.to_dict() for finding in examination.findings]
        summaries.append(
            {"path": str(path), **asdict(quality), "n_lost": quality.n_lost, "findings": findings,
             "not_checked": [point.text for point in examination.not_checked]}
        )  # fmt: skip
    if refused:
        more = (
            f" (and {len(refused) - 1} more of {len(paths)} recordings cannot be used)" if len(refused) > 1 else ""
        )
        first = refused[0]
        raise RecordingError(first.what, got=first.got + more, allowed=first.allowed, remedy=first.remedy)
    return {"lines": lines, "flags": flags, "runs": summaries}


def _examined(path: Path) -> tuple[RunQuality, ConsistencyExamination]:
    """Quality of a recording that keeps the format, has working sensors and right signs, and its examination."""
    recording = read_recording(path)
    quality = quality_of(recording)
    if not quality.usable:
        raise RecordingError(
            f"recording {path}",
            got="; ".join(quality.reasons),
            allowed="a run that an analysis may rest on",
            remedy="record again, or mend it with `sloshlab import`",
        )
    if "signs" in EXPERIMENTS[recording.attrs["experiment"]].stages:
        with naming(path):
            check_signs(recording)
    _, examination = examined_recording(recording, path, Reference(_rig_beside(path, recording)))
    return quality, examination


def _rig_beside(path: Path, recording: xr.Dataset) -> Rig | None:
    """The rig that a recording names, if it lies beside it and can be read: a recording may be good without."""
    name = str(recording.attrs.get("rig", ""))
    file = path.parent / name
    if not name or name != Path(name).name or not file.is_file():
        return None
    with contextlib.suppress(RigError):
        return Rig.from_toml(file)
    return None


def _consistency_lines(examination: ConsistencyExamination) -> list[str]:
    found = [f"{finding.check}: {finding.text} ({finding.action.value})" for finding in examination.findings]
    return [
        *(found or ["consistency: no contradiction"]),
        *(f"not checked: {point.text}" for point in examination.not_checked),
    ]


def _table(path: Path, quality: RunQuality) -> list[str]:
    header = f"{'channel':<24}{'quantity':<14}{'minimum':>12}{'maximum':>12}{'std':>12}"
    header += f" {'units':<8}{'lost':>8}{'clipped':>9}"
    lines = [
        f"{path}: {quality.run_id}, {quality.n_samples} samples at {quality.sampling_rate_hz:g} Hz, "
        f"{quality.duration_s:.6g} s",
        header,
        *(_row(channel) for channel in quality.channels),
        f"gaps: {len(quality.gaps)} ({quality.n_lost} samples); CRC repaired: {quality.n_crc_repaired}; "
        f"out of order: {quality.n_out_of_order}; stuck: {quality.n_stuck}",
    ]
    lines += [_agreement(pair) for pair in (quality.accelerometers.pairs if quality.accelerometers else ())]
    return lines


def _agreement(pair: PairAgreement) -> str:
    phase_mrad = 1e3 * pair.phase_error_at_20_hz_rad
    return (
        f"{pair.name} against {pair.reference}: gain {pair.gain_ratio:.4f}, delay {1e6 * pair.delay_s:+.1f} µs "
        f"({phase_mrad:+.2f} mrad at 20 Hz), sign {pair.sign:+d}, "
        f"RMS difference {100 * pair.rms_disagreement:.2f} %"
    )


def _row(channel: ChannelQuality) -> str:
    return (
        f"{channel.name:<24}{channel.quantity:<14}{channel.minimum:>12.5g}{channel.maximum:>12.5g}"
        f"{channel.standard_deviation:>12.5g} {channel.units:<8}{channel.n_lost:>8}{channel.clipping.n_clipped:>9}"
    )

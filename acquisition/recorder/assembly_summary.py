"""What happened to the samples between the devices and the recording: for people and for programs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from acquisition.recorder.journal import Journal
from acquisition.recorder.placement import Loss, Stream
from acquisition.recorder.recording_plan import Part
from acquisition.recorder.source_alignment import AlignmentMethod, described
from acquisition.samples.delivery import TroubleKind
from sloshlab.conditioning.device_clock import ClockStatus

# a line that loses every other frame has hundreds of thousands of gaps; beyond these there is a number
MOST_LOSSES_NAMED: Final = 1000
MOST_TROUBLES_NAMED: Final = 100
_MOST_MESSAGES_NAMED: Final = 8

_GRAVE = frozenset(
    kind.name
    for kind in TroubleKind
    if kind
    not in (TroubleKind.RECONNECTED, TroubleKind.GARBAGE, TroubleKind.CORRUPT_FRAME, TroubleKind.LINE_ERROR)
)
"""Troubles that flag a recording by themselves; the others do so if samples are missing for it."""


@dataclass(frozen=True)
class AssemblySummary:
    """What became of a journal.

    Attributes
    ----------
    output : Path
        The recording.
    n_samples : int
        On the time base.
    sampling_rate_hz : float
    n_lost : dict of str to int
        Samples without a value on the time base, by channel.
    lines : tuple of str
        For a person.
    flags : tuple of str
        What makes the recording less than complete and sound; empty if nothing does.
    record : dict
        As in the attribute `acquisition`: devices, clocks, alignment, losses, troubles.
    """

    output: Path
    n_samples: int
    sampling_rate_hz: float
    n_lost: dict[str, int]
    lines: tuple[str, ...]
    flags: tuple[str, ...]
    record: dict[str, Any]

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers and texts."""
        return {
            "output": str(self.output),
            "n_samples": self.n_samples,
            "sampling_rate_hz": self.sampling_rate_hz,
            "duration_s": self.n_samples / self.sampling_rate_hz,
            "n_lost": dict(self.n_lost),
            "flags": list(self.flags),
            **self.record,
        }


def acquisition_record(journal: Journal, parts: Sequence[Part], losses: Sequence[Loss]) -> dict[str, Any]:
    """What the attribute `acquisition` says, as JSON."""
    named = losses[:MOST_LOSSES_NAMED]
    return {
        "devices": [_device(part) for part in parts],
        "clocks": {part.label: [_clock(stream) for stream in part.placement.streams] for part in parts},
        "alignment": {part.label: part.alignment.to_dict() for part in parts},
        "losses": {
            "columns": ["source", "group", "first_counter", "n_samples", "index"],
            "rows": [[loss.source, loss.group, loss.counter, loss.n_samples, loss.index] for loss in named],
            "n_gaps": len(losses),
            "n_samples": sum(loss.n_samples for loss in losses),
        },
        "troubles": _troubles(journal),
        "failures": [{"source": source, "message": message} for source, message in journal.failures],
        "journal": {
            "closed_by_recorder": journal.closed_cleanly,
            "n_bytes": journal.n_bytes,
            "n_bytes_left_out": journal.n_bytes_left_out,
        },
    }


def summarised(
    journal: Journal,
    parts: Sequence[Part],
    losses: Sequence[Loss],
    *,
    output: Path,
    n_samples: int,
    n_lost: dict[str, int],
    record: dict[str, Any],
    doubts: Sequence[str],
) -> AssemblySummary:
    """Lines and flags of an assembly that was written."""
    lines = [*_trigger_lines(record), *(line for part in parts for line in _part_lines(part))]
    lines += described({part.label: part.alignment for part in parts})
    lines += [f"{count} × {TroubleKind[kind].value}" for kind, count in record["troubles"]["counts"].items()]
    flags = [*_trigger_flags(record), *(flag for part in parts for flag in _part_flags(part, losses))]
    flags += [flag for part in parts for flag in _damage_flags(journal, part)]
    flags += [
        f"{count} × {TroubleKind[kind].value}"
        for kind, count in record["troubles"]["counts"].items()
        if kind in _GRAVE
    ]
    flags += [f"source {source}: {message}" for source, message in journal.failures]
    flags += [*_journal_flags(journal), *doubts]
    return AssemblySummary(
        output=output,
        n_samples=n_samples,
        sampling_rate_hz=parts[0].placement.info.sampling_rate_hz,
        n_lost=n_lost,
        lines=tuple([*lines, f"recording: {output}"]),
        flags=tuple(flags),
        record=record,
    )


def _trigger_lines(record: dict[str, Any]) -> Iterator[str]:
    if "trigger" in record:
        trigger = record["trigger"]
        yield f"trigger {trigger['condition']}: time 0, with {trigger['n_samples_before']} samples before it"


def _trigger_flags(record: dict[str, Any]) -> Iterator[str]:
    if "trigger" in record and record["trigger"]["n_samples_before"] < record["trigger"]["n_asked"]:
        yield (
            f"only {record['trigger']['n_samples_before']} samples before the trigger, of "
            f"{record['trigger']['n_asked']} asked for: it came too soon after the start"
        )


def _device(part: Part) -> dict[str, Any]:
    info, survey = part.placement.info, part.survey
    return {
        "source": part.placement.source,
        "device": info.device,
        "url": info.url,
        "sampling_rate_hz": info.sampling_rate_hz,
        "clock_hz": info.clock_hz,
        "channels": list(part.names),
        "n_samples": part.placement.n_samples,
        "n_lost": [channel.n_lost for channel in survey.channels],
        "n_missing": [channel.n_missing for channel in survey.channels],
        "n_clipped": [channel.n_clipped for channel in survey.channels],
        "n_stuck": [sum(stop - start for start, stop in channel.stuck) for channel in survey.channels],
        "n_out_of_order": survey.n_late,
        "n_repeated": survey.repeats.n_samples,
        "n_repeated_differently": survey.repeats.n_conflicting,
        "repeated_differently": [list(conflict) for conflict in survey.repeats.conflicts],
        "sensor_serials": {
            name: channel.sensor_serial
            for name, channel in zip(part.names, part.channels, strict=True)
            if channel.sensor_serial
        },
    }


def _clock(stream: Stream) -> dict[str, Any]:
    return {
        "stream": stream.stream,
        "first_counter": stream.first_counter,
        "n_samples": stream.n_samples,
        "first_index": stream.first_index,
        "place_error_s": stream.place_error_s,
        "n_before": stream.n_before,
        "n_after": stream.n_after,
        "n_missing_tail_not_shown": stream.n_missing_tail_not_shown,
        **stream.clock.to_dict(),
    }


def _troubles(journal: Journal) -> dict[str, Any]:
    counts: dict[str, int] = {}
    for (_, kind), count in sorted(journal.trouble_counts.items()):
        counts[kind] = counts.get(kind, 0) + count
    first = [
        {"source": source, "kind": trouble.kind.name, "detail": trouble.detail[:200], "count": trouble.count}
        for source, trouble in journal.troubles[:MOST_TROUBLES_NAMED]
    ]
    return {"counts": counts, "first": first}


def _part_lines(part: Part) -> Iterator[str]:
    placement, survey, label = part.placement, part.survey, part.label
    rate_hz = placement.info.sampling_rate_hz
    yield (
        f"{label}: {placement.n_samples} samples of {len(part.names)} channels at {rate_hz:g} Hz, "
        f"{placement.n_samples / rate_hz:.3f} s"
    )
    clock = placement.main_stream.clock
    if clock.status is ClockStatus.FITTED:
        yield (
            f"{label}: clock {clock.drift_ppm:+.3g} ± {clock.drift_error_ppm:.2g} ppm, "
            f"latency {1e3 * clock.latency_median_s:.3g} ms (median), {1e3 * clock.latency_max_s:.3g} ms (largest)"
        )
    else:
        yield f"{label}: {clock.status.value}"
    for stream in placement.streams:
        if stream.n_before or stream.n_after:
            yield (
                f"{label}: {stream.n_before} samples of single groups before and {stream.n_after} after "
                "the samples that all groups have"
            )
    if survey.n_late:
        yield f"{label}: {survey.n_late} samples arrived out of order and were put in their places"
    if survey.repeats.n_samples:
        yield f"{label}: {survey.repeats.n_samples} samples arrived more than once; the first copy was kept"


def _part_flags(part: Part, losses: Sequence[Loss]) -> Iterator[str]:
    placement, survey, label = part.placement, part.survey, part.label
    rate_hz = placement.info.sampling_rate_hz
    own = [loss for loss in losses if loss.source == placement.source]
    if own:
        yield f"{label}: {_lost(own, len(placement.groups), rate_hz)}"
    for name, channel in zip(part.names, survey.channels, strict=True):
        if channel.n_missing:
            yield f"{name}: {channel.n_missing} samples without a reading, says the device"
        if channel.n_clipped:
            yield f"{name}: {channel.n_clipped} samples clipped"
        if channel.stuck:
            start, stop = channel.stuck[0]
            n_stuck = sum(last - first for first, last in channel.stuck)
            yield (
                f"{name}: stuck for {n_stuck} samples, first {start / rate_hz:.6g} … {stop / rate_hz:.6g} s, "
                "while other channels moved"
            )
    if survey.repeats.n_conflicting:
        yield f"{label}: {survey.repeats.n_conflicting} samples came again with other counts; the first was kept"
    for stream in placement.streams:
        if stream.n_missing_tail_not_shown:
            yield f"{label}: {stream.n_missing_tail_not_shown} more samples were taken, says the device"
    yield from _restart_flags(part)
    if part.alignment.method in (AlignmentMethod.NONE, AlignmentMethod.HOST):
        yield f"{label}: aligned by {part.alignment.method.value}"


def _lost(losses: Sequence[Loss], n_messages: int, rate_hz: float) -> str:
    """What one device lost, for a person: a sample that is lost in several CAN messages is one sample."""
    gaps = _gaps(losses)
    n_samples = sum(gap.n_samples for gap in gaps)
    longest = max(gaps, key=lambda gap: gap.n_samples)
    counter = "between two streams" if longest.counter is None else f"from counter {longest.counter}"
    text = (
        f"{n_samples} samples lost in {len(gaps)} gap{'s' * (len(gaps) > 1)}, the longest "
        f"{longest.n_samples} samples {counter} ({longest.index / rate_hz:.6g} s)"
    )
    if n_messages == 1:
        return text
    # each message of a CAN device has frames of its own, which are lost by themselves
    by_message = [sum(loss.n_samples for loss in losses if loss.group == k) for k in range(n_messages)]
    if all(n == n_samples for n in by_message):
        return f"{text}, in each of its {n_messages} messages"
    named = [f"message {k} lost {n}" for k, n in enumerate(by_message) if n]
    more = (
        [f"{len(named) - _MOST_MESSAGES_NAMED} more messages lost some"]
        if len(named) > _MOST_MESSAGES_NAMED
        else []
    )
    return "; ".join([text, *named[:_MOST_MESSAGES_NAMED], *more])


def _gaps(losses: Sequence[Loss]) -> list[Loss]:
    """Losses by place, with those that overlap, of several messages, as one."""
    gaps: list[Loss] = []
    for loss in sorted(losses, key=lambda loss: loss.index):
        reached = gaps[-1].index + gaps[-1].n_samples if gaps else 0
        # counted once per message, 70 lost samples of three messages would be called 210
        if gaps and loss.index < reached:
            stop = max(reached, loss.index + loss.n_samples)
            gaps[-1] = replace(gaps[-1], n_samples=stop - gaps[-1].index)
        else:
            gaps.append(loss)
    return gaps


def _damage_flags(journal: Journal, part: Part) -> Iterator[str]:
    """Order is all that tells of damage that a short checksum has let through."""
    is_damaged = journal.trouble_counts.get((part.placement.source, TroubleKind.CORRUPT_FRAME.name), 0)
    # a CAN frame has a checksum of 16 bits: of frames with 40 of 64 bits flipped one in 32 768 passes
    if is_damaged and part.survey.n_late:
        yield (
            f"{part.label}: {part.survey.n_late} samples came out of order on a line that damages frames; "
            "some may be damaged themselves"
        )


def _restart_flags(part: Part) -> Iterator[str]:
    rate_hz = part.placement.info.sampling_rate_hz
    for stream in part.placement.streams[1:]:
        at_s = stream.first_index / rate_hz
        if stream.place_error_s is None:
            yield f"{part.label}: restarted at {at_s:.6g} s; how long the gap was is unknown"
        else:
            within_s = stream.place_error_s
            yield f"{part.label}: restarted at {at_s:.6g} s, placed by host time within {within_s:.2g} s"


def _journal_flags(journal: Journal) -> Iterator[str]:
    if not journal.closed_cleanly:
        yield "the recorder did not close the journal"
    if journal.n_bytes_left_out:
        reasons = "; ".join(dict.fromkeys(damage.reason for damage in journal.damage[:20]))
        yield f"{journal.n_bytes_left_out} bytes of the journal were left out: {reasons}"

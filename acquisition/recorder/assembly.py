"""From a journal to one recording: every sample in its place, every loss flagged and named.

The first source is the time base and keeps its counts untouched. Two readings: the first finds what
the counts hold, the second writes them. Memory is bounded by stretches, not by the length of the run.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, Final, Literal

from acquisition.recorder.assembly_summary import AssemblySummary, acquisition_record, summarised
from acquisition.recorder.journal import Journal
from acquisition.recorder.mark_placement import packed_marks, place_of
from acquisition.recorder.placed_samples import PlacedSamples
from acquisition.recorder.placement import Loss, SourcePlacement, placed_source
from acquisition.recorder.pre_trigger import Trigger, trigger_from
from acquisition.recorder.recording_file import require_readable_size, written_recording
from acquisition.recorder.recording_plan import (
    Part,
    channel_names,
    checked_attributes,
    device_labels,
    dimensions_of,
    stored_type,
    variables_of,
)
from acquisition.recorder.sample_writing import samples_at_once, write_samples
from acquisition.recorder.sensor_plausibility import doubtful_sensors
from acquisition.recorder.source_alignment import (
    SourceAlignment,
    aligned_by_counter,
    aligned_by_device_clock,
    aligned_by_host,
    common_motion_pairs,
    first_source,
)
from acquisition.recorder.survey import SourceSurvey, surveyed, thinned_by
from sloshlab.errors import InputError, JournalError
from sloshlab.recording import FORMAT

Align = Literal["host", "device", "counter"]
Watch = Callable[[int, int], None]
"""Called with samples done and samples to do, while a recording is assembled."""

ALIGNMENTS: Final[tuple[Align, ...]] = ("host", "device", "counter")


@dataclass(frozen=True)
class AssemblyOptions:
    """How the devices of a journal become one recording.

    Attributes
    ----------
    align : {"host", "device", "counter"}
        By host arrival times, refined by signals that show the same motion; by device clocks that are
        synchronised; or by counters of a common trigger, which leaves all counts untouched.
    redundant : tuple of (str, str)
        Pairs of channels on different devices that show the same motion. Without any, the accelerometers of
        the tank's roof and the control are taken in the shaker experiments, as the tank is rigid.
    attributes : mapping
        Global attributes of the recording; they take precedence over ``metadata["attributes"]`` of the journal.
    """

    align: Align = "host"
    redundant: tuple[tuple[str, str], ...] = ()
    attributes: Mapping[str, Any] = field(default_factory=dict)


def assemble(
    journal: Journal,
    output: Path,
    options: AssemblyOptions | None = None,
    *,
    watch: Watch = lambda n_done, n_all: None,
) -> AssemblySummary:
    """Write the recording that a journal holds.

    Parameters
    ----------
    journal : Journal
        Complete or not; it is not changed.
    output : Path
        Replaced, atomically, if it is there.
    options : AssemblyOptions, optional
        ``journal.metadata`` if not given: its keys `align`, `redundant` and `attributes`.
    watch : callable
        Called with samples done and samples to do; each is read once and written once.

    Returns
    -------
    AssemblySummary

    Raises
    ------
    JournalError
        If no source delivered at least two samples, or what was delivered is impossible.
    RecordingError
        If the recording would be refused by its readers; nothing is written then.
    InputError
        If the devices cannot be aligned in the way asked for.
    """
    chosen = options or options_of(journal)
    if chosen.align not in ALIGNMENTS:
        raise InputError("align", got=repr(chosen.align), allowed=", ".join(ALIGNMENTS))
    placements, without_samples = _placements(journal)
    base = placements[0]
    rate_hz = base.info.sampling_rate_hz
    trigger = trigger_from(journal.metadata, f"journal {journal.path}")
    n_before = _n_before(trigger, base)
    attributes = _attributes(journal, output, base, n_before, chosen)
    losses = [loss for placement in placements for loss in placement.losses()]
    require_readable_size(
        # before anything of that size is read or written: a wrong counter can span years
        sum((len(placement.info.channels) + 2) * placement.n_samples for placement in placements),
        what=f"recording {output}",
        explanation=_longest(losses, placements),
    )
    # every sample is read once to know it, and once to write it
    advance = _advancing(watch, sum(placement.n_samples for placement in placements) + base.n_samples)
    parts = _parts(journal, placements, chosen, str(attributes["experiment"]), advance)
    n_samples = _n_samples(parts, chosen)
    _require_size(parts, n_samples, output)
    named_channels = [pair for part in parts for pair in part.named_channels]
    attributes = checked_attributes(attributes, named_channels, str(output), rate_hz)
    doubts = doubtful_sensors(parts, str(attributes["experiment"]))
    record = acquisition_record(journal, parts, losses) | _triggered(trigger, n_before)
    variables = variables_of(parts, n_before / rate_hz)
    everything = {**attributes, **_marks(journal, base, n_before)}
    everything["acquisition"] = json.dumps(record, allow_nan=False)
    with written_recording(output, dimensions_of(parts, n_samples), variables, everything) as file:
        n_lost = write_samples(file, parts, n_samples, (rate_hz, -n_before), advance)
    return summarised(
        journal, parts, losses, output=output, n_samples=n_samples, n_lost=n_lost, record=record,
        doubts=[*without_samples, *doubts],
    )  # fmt: skip


def _advancing(watch: Watch, n_all: int) -> Callable[[int], None]:
    """A function that counts the samples that are done."""
    n_done = 0

    def advance(n_samples: int) -> None:
        nonlocal n_done
        n_done += n_samples
        watch(min(n_done, n_all), n_all)

    return advance


def options_of(journal: Journal) -> AssemblyOptions:
    """What the recorder noted in the journal: `align`, `redundant`, `attributes`."""
    metadata = journal.metadata
    pairs = metadata.get("redundant", [])
    attributes = metadata.get("attributes", {})
    is_sound = (
        isinstance(attributes, dict)
        and isinstance(pairs, list)
        and all(isinstance(pair, list) and len(pair) == 2 for pair in pairs)
    )
    if not is_sound:
        raise JournalError(f"journal {journal.path}: metadata", got="no attributes or pairs of channels")
    return AssemblyOptions(
        align=metadata.get("align", "host"),
        redundant=tuple((str(a), str(b)) for a, b in pairs),
        attributes=attributes,
    )


def _placements(journal: Journal) -> tuple[list[SourcePlacement], list[str]]:
    """Placements of the sources that delivered samples, and a remark on each that did not."""
    placements, remarks = [], []
    for source, info in sorted(journal.sources.items()):
        if any(len(journal.entries[source, group]) for group in range(len(info.groups))):
            placements.append(placed_source(journal, source))
        else:
            remarks.append(f"{info.device}: not one sample arrived")
    if not placements or placements[0].n_samples < 2:
        raise JournalError(
            f"journal {journal.path}",
            got="no samples" if not placements else "1 sample",
            allowed="at least two samples of the first device",
            remedy="check that the devices were started",
        )
    return placements, remarks


def _attributes(
    journal: Journal, output: Path, base: SourcePlacement, n_before: int, options: AssemblyOptions
) -> dict[str, Any]:
    noted = journal.metadata.get("attributes", {})
    return {
        "run_id": output.stem,
        "experiment": "other",
        "configuration": "sloshing",
        "rig": "",
        "start_time_utc": _start_time_utc(base, n_before),
        **(noted if isinstance(noted, dict) else {}),
        **options.attributes,
        # last: neither the journal nor an option may say otherwise
        "sloshlab_format": FORMAT,
        "sampling_rate_hz": base.info.sampling_rate_hz,
    }


def _n_before(trigger: Trigger | None, base: SourcePlacement) -> int:
    """Samples of the first device before the trigger, 0 without one: time counts from it."""
    if trigger is None:
        return 0
    for stream in base.streams:
        n_before = stream.first_index + trigger.counter - stream.first_counter
        if stream.stream == trigger.stream and 0 <= n_before < base.n_samples:
            return n_before
    # its samples were lost with a part of the journal
    return 0


def _triggered(trigger: Trigger | None, n_before: int) -> dict[str, Any]:
    """What the attribute `acquisition` says of the trigger."""
    return {"trigger": {**trigger.described(), "n_samples_before": n_before}} if trigger else {}


def _marks(journal: Journal, base: SourcePlacement, n_before: int) -> dict[str, str]:
    """Attribute `marks`, where any were set."""
    places = [(place_of(mark, base), mark.text) for mark in journal.marks]
    rate_hz = base.info.sampling_rate_hz
    inside = [((place - n_before) / rate_hz, text) for place, text in places if place is not None]
    return {"marks": packed_marks(inside)} if inside else {}


def _start_time_utc(base: SourcePlacement, n_before: int) -> str:
    """When the sample at time 0 was taken, as well as arrivals tell: the first one, or that of the trigger."""
    arrivals = []
    for group in base.groups:
        if len(group.entries):
            # a host time belongs to the last sample of its entry, the start to place 0
            last = group.index[0] + group.entries.n_samples[0] - 1
            arrivals.append(int(group.entries.host_utc_ns[0]) * 1e-9 - int(last) / base.info.sampling_rate_hz)
    try:
        start_s = min(arrivals) + n_before / base.info.sampling_rate_hz
        moment = datetime.fromtimestamp(0, UTC) + timedelta(milliseconds=round(1e3 * start_s))
    # a journal may hold any time
    except (OverflowError, ValueError):
        moment = datetime.fromtimestamp(0, UTC)
    return moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")


def _parts(
    journal: Journal,
    placements: Sequence[SourcePlacement],
    options: AssemblyOptions,
    experiment: str,
    advance: Callable[[int], None],
) -> list[Part]:
    base = placements[0]
    pairs = [common_motion_pairs(base, other, options.redundant, experiment) for other in placements[1:]]
    for_alignment = {name for own in pairs for pair in own for name in pair}
    infos = [placement.info for placement in placements]
    labels = device_labels(infos)
    names = channel_names(infos, labels)
    samples = [PlacedSamples(journal, placement) for placement in placements]
    # the survey decides types and finds stuck sensors, so that all counts are read once before any is written
    surveys = [_survey(sample, for_alignment, experiment, advance) for sample in samples]
    alignments = [first_source(base)]
    for other, survey, own in zip(placements[1:], surveys[1:], pairs, strict=True):
        alignments.append(_aligned(base, other, (surveys[0], survey), own, options.align))
    parts = []
    for label, sample, survey, alignment, own_names in zip(
        labels, samples, surveys, alignments, names, strict=True
    ):
        columns = zip(sample.placement.info.channels, survey.channels, strict=True)
        stored = tuple(stored_type(channel, found) for channel, found in columns)
        parts.append(Part(label, sample, survey, alignment, own_names, stored))
    return parts


def _survey(
    samples: PlacedSamples, for_alignment: set[str], experiment: str, advance: Callable[[int], None]
) -> SourceSurvey:
    info = samples.placement.info
    factor = thinned_by(info.sampling_rate_hz)
    # a thinned copy of these alone, to compare the sensors of one tank after the recording
    rigid = [c.name for c in info.channels if c.quantity == "acceleration" and experiment.startswith("shaker_")]
    # whole means of the thinned copy in each stretch
    n_each = max(1, samples_at_once(len(info.channels)) // factor) * factor
    return surveyed(samples, n_each, for_alignment | set(rigid), advance)


def _aligned(
    base: SourcePlacement,
    other: SourcePlacement,
    surveys: tuple[SourceSurvey, SourceSurvey],
    pairs: Sequence[tuple[str, str]],
    align: Align,
) -> SourceAlignment:
    if align == "counter":
        return aligned_by_counter(base, other)
    if align == "device":
        return aligned_by_device_clock(base, other)
    return aligned_by_host(base, other, surveys, pairs)


def _n_samples(parts: Sequence[Part], options: AssemblyOptions) -> int:
    """Length of the time base: the first source's, or with a common trigger that of the longest."""
    if options.align != "counter":
        return parts[0].placement.n_samples
    # with a common trigger any device may have been read longest; otherwise the first is the time base
    return max(part.placement.n_samples + part.shift for part in parts)


def _require_size(parts: Sequence[Part], n_samples: int, output: Path) -> None:
    sizes = dimensions_of(parts, n_samples)
    n_values = sum(sizes[variable.dimension] for variable in variables_of(parts))
    require_readable_size(n_values, what=f"recording {output}")


def _longest(losses: Sequence[Loss], placements: Sequence[SourcePlacement]) -> str:
    if not losses:
        return ""
    longest = max(losses, key=lambda loss: loss.n_samples)
    device = next(placement.info.device for placement in placements if placement.source == longest.source)
    return f"the longest gap is {longest.n_samples} samples of {device} from counter {longest.counter}"

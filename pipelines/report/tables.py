"""Tables of a report, and the one that every report has: what a result was made of."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from pipelines.report.numbers import interval

if TYPE_CHECKING:
    from sloshlab.conditioning.quality import RunQuality
    from sloshlab.consistency.finding import ConsistencyExamination, OpenPoint
    from sloshlab.recording import RunAttributes


@dataclass(frozen=True)
class Table:
    """Text in rows and columns.

    Attributes
    ----------
    title, caption : str
        Above and below the table.
    header : tuple of str
        Names of the columns.
    rows : tuple of tuple of str
        One tuple per row, as long as the header.
    """

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str = ""


class CheckedRun(Protocol):
    """A run of any experiment whose recording was checked."""

    @property
    def attributes(self) -> RunAttributes:
        """Global attributes of the recording."""
        ...

    @property
    def quality(self) -> RunQuality:
        """What the check of the recording found."""
        ...


def provenance_table(provenance: Mapping[str, Any]) -> Table:
    """Command, inputs with hashes, versions.

    Parameters
    ----------
    provenance : mapping
        A value that is a mapping itself gives a row for each of its entries.
    """
    rows: list[tuple[str, ...]] = []
    for key, value in provenance.items():
        if isinstance(value, Mapping):
            rows += [(f"{key}: {name}", str(part)) for name, part in value.items()]
        else:
            rows.append((str(key), str(value)))
    return Table("Provenance", ("what", "value"), tuple(rows), "Hashes are SHA-256 of the files' bytes.")


def channel_table(runs: Sequence[CheckedRun]) -> Table:
    """Channels over all runs: range, losses, clipping."""
    names = sorted({channel.name for run in runs for channel in run.quality.channels})
    rows = []
    for name in names:
        own = [channel for run in runs for channel in run.quality.channels if channel.name == name]
        rows.append(
            (
                name,
                own[0].units,
                str(len(own)),
                interval([part for channel in own for part in (channel.minimum, channel.maximum)]),
                str(sum(channel.n_lost for channel in own)),
                str(sum(channel.clipping.n_clipped for channel in own)),
                "no" if any(not channel.clipping.range_is_stated for channel in own) else "yes",
                str(sum(channel.clipping.is_suspected for channel in own)),
            )
        )
    return Table(
        "Channels, all runs together",
        (
            "channel",
            "unit",
            "runs",
            "values",
            "samples lost",
            "samples clipped",
            "range stated",
            "runs that look cut off",
        ),
        tuple(rows),
    )


def remark_table(runs: Sequence[CheckedRun]) -> Table:
    """What the check of the recordings remarked, run by run."""
    rows = [
        (run.attributes.run_id, remark) for run in runs for remark in (*run.quality.reasons, *run.quality.remarks)
    ]
    note = "" if rows else "The check of the recordings had nothing to remark."
    return Table("Remarks on the recordings", ("run", "remark"), tuple(rows), note)


def consistency_tables(examinations: Sequence[ConsistencyExamination]) -> tuple[Table, Table]:
    """What contradicts itself, other runs or physics, and what could not be examined."""
    found = [(examination.run_id, finding) for examination in examinations for finding in examination.findings]
    rows = tuple((run, finding.check, finding.text, finding.action.value) for run, finding in found)
    note = (
        "Errors are the largest that the finding makes where it holds."
        if rows
        else "Every check agreed: samples, like sensors, force against acceleration, statements about the motion."
    )
    # what many runs cannot tell is said once, with the worst of them
    open_points: dict[tuple[str, str], list[tuple[str, OpenPoint]]] = {}
    for examination in examinations:
        for point in examination.not_checked:
            open_points.setdefault((point.what, point.why), []).append((examination.run_id, point))
    points = tuple(
        (
            runs[0][0] if len(runs) == 1 else f"{len(runs)} runs",
            f"{what}: {why}",
            _largest(point.w_bar_error for _, point in runs),
            _largest(point.beta_error for _, point in runs),
        )
        for (what, why), runs in open_points.items()
    )
    header = ("runs", "what may be wrong unseen", "W̄ by up to", "β by up to")
    left = "Largest of the runs; – is not known." if points else "Nothing was left unexamined."
    return (
        Table("Contradictions", ("run", "check", "what was found", "what follows"), rows, note),
        Table("Not checked", header, points, left),
    )


def _largest(errors: Iterable[float]) -> str:
    known = [error for error in errors if math.isfinite(error)]
    return f"{max(known):.2g}" if known else "–"

"""The kind of an answer and what it gains, at a glance."""

from __future__ import annotations

from typing import Final

from pipelines.diagnosis.results import Diagnosis
from pipelines.report.page import Banner

_KINDS: Final[dict[str, Banner]] = {
    "nothing_missing": Banner("clear", "Nothing missing", ""),
    "named": Banner("found", "Named", ""),
    "indistinguishable": Banner("open", "Several are as good", ""),
    "unknown": Banner("unknown", "Missing, without a name", ""),
}
LAW: Final = Banner("open", "A law without a name", "")


def banner_of(diagnosis: Diagnosis) -> Banner:
    """Kind and gain of a verdict.

    Parameters
    ----------
    diagnosis : Diagnosis
    """
    verdict = diagnosis.verdict
    kind = LAW if verdict.kind == "unknown" and verdict.has_law else _KINDS[verdict.kind]
    return Banner(kind.tone, kind.label, gain_words(diagnosis))


def gain_words(diagnosis: Diagnosis) -> str:
    """Error on unseen runs before and after, in multiples of the noise."""
    found, verdict = diagnosis.findings, diagnosis.verdict
    which = "unseen runs" if found.split.has_held_out else "the fitted run, as there is no other"
    before, after = (
        None if model is None else model.held_out_rms if found.split.has_held_out else model.fitted_rms
        for model in (found.retuned, diagnosis.after)
    )
    assert before is not None
    if verdict.kind == "nothing_missing" or after is None:
        return f"Error on {which}: {before:.2g} times the noise."
    gain = f"Error on {which}: {before:.2g} → {after:.2g} times the noise"
    if verdict.kind == "unknown" and not verdict.has_law:
        return f"{gain} with the nearest known effect, which does not explain it."
    return f"{gain}."

"""Tables of the report on a diagnosis."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pipelines.diagnosis.figures import extended_label
from pipelines.diagnosis.results import Diagnosis
from pipelines.report.numbers import MISSING, signed, text
from pipelines.report.tables import Table
from sloshlab.diagnosis.inference.scored_model import ScoredModel
from sloshlab.diagnosis.wording import form_and_place, named_and_placed
from sloshlab.identification.baseline_parameter import BaselineParameter
from sloshlab.missing_physics.evidence import CANNOT_TELL, SINGLE_CHANNEL
from sloshlab.missing_physics.units import named_and_units

_MOST_EXPLANATIONS: Final = 8
_OF_THE_CHANNEL: Final = ("limit", "amplitude")


def effect_parameter_table(diagnosis: Diagnosis) -> Table | None:
    """Numbers of the effects with their intervals."""
    best = diagnosis.verdict.best
    # of a law its formula says everything
    if best is None or diagnosis.verdict.has_law:
        return None
    rows: list[tuple[str, ...]] = []
    for candidate in best.fit.candidates:
        # Numbers of runs that were not fitted have no interval.
        of_effect = {name: its for (key, name), its in diagnosis.verdict.intervals.items() if key == candidate.key}
        for name, its in of_effect.items():
            words, units = named_and_units(name)
            unit = units or ("of the channel" if name in _OF_THE_CHANNEL else "1")
            bounds = f"{text(its.low, 4)} … {text(its.high, 4)}"
            rows.append((named_and_placed(candidate), words, text(its.estimate, 4), bounds, unit))
    is_named = diagnosis.verdict.kind != "unknown"
    return Table(
        "Numbers of what was left out" if is_named else "Numbers of the nearest known effect",
        ("effect", "parameter", "estimate", "90 % interval", "unit"),
        tuple(rows),
        "Fitted in free-running simulation over all fitting runs, with the baseline's parameters free.",
    )


def baseline_table(diagnosis: Diagnosis) -> Table:
    """What retuning did to the baseline, with and without the effect."""
    found, best = diagnosis.findings, diagnosis.after
    rows = []
    for parameter in found.model.parameters:
        # They belong to single runs and say nothing of the rig.
        if parameter.name.startswith(("release", "offset")):
            continue
        retuned = found.retuned.fit.values.get(parameter.name, parameter.believed)
        row = [parameter.name, text(parameter.believed, 4), text(parameter.tolerance, 2), text(retuned, 4)]
        # In tolerances: how far a number moved means nothing without how well it was known.
        row.append(_moved(parameter, retuned))
        if best is not None:
            row.append(_moved(parameter, best.fit.values.get(parameter.name, parameter.believed)))
        rows.append(tuple(row))
    header: tuple[str, ...] = ("parameter", "believed", "tolerance", "retuned", "moved, in tolerances")
    header += () if best is None else ("moved with the effect, in tolerances",)
    caption = (
        "A number that wants to move by more than its tolerance asks for a second look at the rig file; at four "
        "tolerances, 1.25 of gains and of more loss, it is held. One of a mode that no run excites means nothing."
    )
    return Table("The baseline's own parameters", header, tuple(rows), caption)


def _moved(parameter: BaselineParameter, value: float) -> str:
    """How far a number is from what is believed, and whether it is held there."""
    tolerances = (value - parameter.believed) / parameter.tolerance
    held = " (held)" if not -parameter.most_below + 1e-3 < tolerances < parameter.most_above - 1e-3 else ""
    return signed(tolerances if abs(tolerances) >= 0.005 else 0.0, 2) + held


def left_out_table(diagnosis: Diagnosis) -> Table | None:
    """Models that could not be fitted, and why."""
    rows = tuple(sorted(diagnosis.findings.failed.items()))
    return Table("Models that could not be fitted", ("model", "why"), rows) if rows else None


def cut_table(diagnosis: Diagnosis) -> Table:
    """Each block on its measured input."""
    cut = diagnosis.examination.cut
    header = ("block", "fed with", "compared", "share of the mismatch", "lacks (RMS)", "noise (RMS)", "remark")
    if cut is None:
        caption = "A twin of the user's own has no blocks that can be fed one by one."
        return Table("Cut at the measured interfaces", header, ((MISSING,) * 7,), caption)
    rows = []
    for block in cut.blocks:
        share = f"{100 * block.share:.0f} % ({100 * block.low:.0f} … {100 * block.high:.0f})"
        unit = " σ" if block.block == "sensor" else " N"
        rows.append(
            (
                block.block,
                block.input,
                block.output,
                share if math.isfinite(block.share) else "cannot tell",
                text(block.size, 3) + (unit if math.isfinite(block.size) else ""),
                text(block.noise, 2) + (unit if math.isfinite(block.noise) else ""),
                block.remark or (MISSING if math.isfinite(block.share) else "within noise"),
            )
        )
    caption = (
        "Shares with 90 % intervals. A block lacks the force that would make its output follow the recording; "
        "of sensors, what they contradict each other by in standard deviations. "
    )
    return Table("Cut at the measured interfaces", header, tuple(rows), caption + _sentence(cut.remark))


def sensor_table(diagnosis: Diagnosis) -> Table | None:
    """Channels beside what the others of the same motion say."""
    cut = diagnosis.examination.cut
    if cut is None or not cut.sensors:
        return None
    rows = [
        (
            sensor.channel,
            text(sensor.ratio, 3),
            text(sensor.disagreement_without, 3),
            text(sensor.missing_force_without_n2**0.5, 3),
        )
        for sensor in sorted(cut.sensors, key=lambda sensor: -sensor.ratio)
    ]
    header = ("channel", "difference from the others / noise", "others among themselves without it / noise",
              "force that blocks then lack [N]")  # fmt: skip
    return Table(
        "Sensors beside each other",
        header,
        tuple(rows),
        "Every motion channel is compared with the motion that all of them agree on, force cells with each other. "
        "A channel is doubted when the others agree without it.",
    )


def sensor_error_table(diagnosis: Diagnosis) -> Table | None:
    """What the error of a doubted channel is a function of."""
    cut, answers = diagnosis.examination.cut, diagnosis.examination.sensor
    if cut is None or not answers:
        return None
    rows = [
        (
            answer.term,
            f"{_share(answer.share)} ({_share(answer.low)} … {_share(answer.high)})",
            _holds(answer.holds),
        )
        for answer in answers
        if answer.term != SINGLE_CHANNEL
    ]
    caption = "Share of the variance of its error that each form explains alone, with 90 % intervals."
    return Table(f"What {cut.suspect} reads wrong", ("form", "share", "holds"), tuple(rows), caption)


def answers_table(diagnosis: Diagnosis, place: str) -> Table:
    """Answers to the physical questions on the force at one place."""
    character = diagnosis.examination.characters[place]
    rows = []
    for answer in character.answers:
        shown = _share if answer.quantity.startswith("share") else text
        low_high = f"{shown(answer.low)} … {shown(answer.high)}" if math.isfinite(answer.low) else MISSING
        quantity = answer.quantity + (f" [{answer.units}]" if answer.units != "1" else "")
        rows.append(
            (answer.question, answer.finding, quantity, shown(answer.value), low_high, answer.remark or MISSING)
        )
    caption = (
        f"The force is {text(character.size_n, 3)} N RMS beyond the block's own parameters, its noise "
        f"{text(character.noise_n, 2)} N."
    )
    if len(rows) > 1:
        caption += (
            " Intervals are by drawing stretches of the runs; what the block's own damping may be off is in that "
            f"of the energy. “The first” is the {'acceleration' if place == 'tank' else 'displacement'}."
        )
    title = f"Physical questions to the force missing at the {place}"
    return Table(title, ("question", "finding", "by", "value", "90 % interval", "remark"), tuple(rows), caption)


def _share(value: float) -> str:
    """A share to a thousandth; what is less is nothing."""
    return MISSING if not math.isfinite(value) else "0" if abs(value) < 5e-4 else f"{value:.3f}".replace("-", "−")


def evidence_table(diagnosis: Diagnosis) -> Table | None:
    """For and against the models that come first, the largest evidence first; nothing missing among them."""
    found, examination = diagnosis.findings, diagnosis.examination
    if not found.explanations:
        return None
    everything = sorted((found.retuned, *found.explanations), key=lambda model: -model.evidence)
    chosen = everything[:_MOST_EXPLANATIONS]
    if found.retuned not in chosen:
        chosen[-1] = found.retuned
    rows = []
    for model in chosen:
        for_: list[str] = []
        against: list[str] = []
        for candidate in model.fit.candidates:
            on = examination.evidence_on(candidate.effect)
            for_ += on.speaks_for
            against += on.speaks_against
            suspect = examination.cut.suspect if examination.cut else ""
            if candidate.effect.block == "sensor" and suspect:
                own = candidate.channel.partition("<")[0]
                # A fault of one channel while another one contradicts all the rest is unlikely.
                (for_ if own == suspect else against).append(f"{suspect} contradicts the others")
        rows.append(
            (
                _named(model) or "nothing missing",
                _standing(diagnosis, model),
                _beside(model, everything[0]),
                text(model.held_out_rms, 2),
                "; ".join(dict.fromkeys(for_)) or MISSING,
                "; ".join(dict.fromkeys(against)) or MISSING,
                _what_remains(model),
            )
        )
    header = ("explanation", "standing", "beside the best", "unseen runs / noise", "speaks for it",
              "speaks against it", "what remains")  # fmt: skip
    caption = (
        f"The {len(rows)} of {len(everything)} models that come first. Differences of the logarithm of the "
        "evidence below 1 are no difference, below 3 slight, below 5 clear, above decisive (Kass and Raftery "
        "1995, doi:10.1080/01621459.1995.10476572). What speaks for and against are tests on the missing force "
        "and on the sensors that know of no candidate: one that contradicts what is named is a reason to doubt "
        "it. What remains is any force of a block or any error of a sensor that describes the rest better than "
        "noise does."
    )
    return Table("For and against", header, tuple(rows), caption)


def _beside(model: ScoredModel, best: ScoredModel) -> str:
    """How far a model is behind the best, in words."""
    if model is best:
        return "best"
    behind = best.evidence - model.evidence
    for most, words in ((1.0, "as good"), (3.0, "slightly worse"), (5.0, "clearly worse")):
        if behind < most:
            return words
    return "decisively worse"


def _what_remains(model: ScoredModel) -> str:
    """The place at which something remains beside a model."""
    place = max(model.remainder.places, key=model.remainder.gain, default="")
    return place if place and model.remainder.gain(place) > 0 else "nothing"


def remains_table(diagnosis: Diagnosis) -> Table:
    """What is left of every channel on held-out runs."""
    found = diagnosis.findings
    steps = [("believed", found.believed), ("retuned", found.retuned)]
    if diagnosis.after is not None:
        steps.append((extended_label(diagnosis), diagnosis.after))
    readings = [found.readings(step) for _, step in steps]
    names = dict.fromkeys(observation.channel for run in found.held_out for observation in run)
    rows = []
    for name in names:
        shown = []
        for reading in readings:
            squares = [
                observed.residual(reading[observed.run.name][name])[observed.informative] ** 2
                for run in found.held_out
                for observed in run
                if observed.channel == name
            ]
            joined = np.concatenate(squares)
            shown.append(text(float(np.sqrt(joined.mean())), 3) if joined.size else MISSING)
        rows.append((name, *shown))
    return Table(
        "What remains per channel",
        ("channel", *[label for label, _ in steps]),
        tuple(rows),
        "RMS of the weighted residual on held-out runs where the recording stands out of the noise; one is the "
        "noise floor.",
    )


def limits_table(diagnosis: Diagnosis) -> Table:
    """What this case cannot decide."""
    limits = list(diagnosis.findings.split.limits)
    cut = diagnosis.examination.cut
    if cut is not None:
        limits += [f"{block.block}: {block.remark}" for block in cut.blocks if block.remark]
        limits += [cut.remark] if cut.remark else []
    for place, character in diagnosis.examination.characters.items():
        undecided = [answer.question for answer in character.answers if answer.finding == CANNOT_TELL]
        if undecided:
            limits.append(f"force at the {place}: no answer on {', '.join(undecided)}")
    rows = tuple((limit,) for limit in dict.fromkeys(limits)) or ((MISSING,),)
    return Table("Limits", ("what these recordings cannot tell",), rows)


def _named(model: ScoredModel) -> str:
    """Effects of a model and where they act."""
    return " + ".join(form_and_place(candidate) for candidate in model.fit.candidates)


def _standing(diagnosis: Diagnosis, model: ScoredModel) -> str:
    verdict = diagnosis.verdict
    if verdict.best is not None and model.keys == verdict.best.keys:
        return verdict.kind if verdict.kind != "unknown" else "nearest, not adequate"
    return "as good" if model.names in verdict.alternatives else "worse"


def _holds(holds: bool | None) -> str:
    return CANNOT_TELL if holds is None else "yes" if holds else "no"


def _sentence(words: str) -> str:
    return f"{words[0].upper()}{words[1:]}." if words else ""

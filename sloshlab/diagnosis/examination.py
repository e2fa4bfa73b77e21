"""Localisation and character of what is missing: interface cut, residual maps, questions to the latent force."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sloshlab.diagnosis.block_cut import block_cut
from sloshlab.diagnosis.findings import Findings
from sloshlab.diagnosis.inference.scored_model import ScoredModel
from sloshlab.identification.diagnosed_model import DiagnosedModel, ModelOfBlocks
from sloshlab.identification.mismatch import mismatches, summary
from sloshlab.missing_force.force_character import Answer, ForceCharacter, force_character
from sloshlab.missing_force.interface_cut import InterfaceCut, interface_cut, own_tolerances
from sloshlab.missing_force.latent_force import EITHER, RunForces
from sloshlab.missing_force.residual_maps import ResidualMaps, residual_maps
from sloshlab.missing_force.sensor_character import SensorAnswer, decided_terms, sensor_character
from sloshlab.missing_physics.candidate import Effect
from sloshlab.missing_physics.evidence import CANNOT_TELL, Evidence, evidence

FloatArray = NDArray[np.float64]
_LEAST_RATIO_WITHIN_CYCLE = 1.5
"""Of the mean squares in the parts of a cycle, from which one of them is told."""


@dataclass(frozen=True, eq=False)
class Examination:
    """Everything that is known before a candidate is named.

    Attributes
    ----------
    cut : InterfaceCut or None
        None for a twin that has no measured interfaces.
    characters : dict of place to ForceCharacter
    sensor : tuple of SensorAnswer
        On the doubted channel; empty where none is doubted.
    maps : list of ResidualMaps
        Of the retuned baseline, per channel.
    where : dict
        Channels, times, frequencies, levels that hold most of the mismatch.
    """

    cut: InterfaceCut | None
    characters: dict[str, ForceCharacter]
    sensor: tuple[SensorAnswer, ...]
    maps: list[ResidualMaps]
    where: dict[str, Any]

    def says(self, block: str) -> dict[str, bool]:
        """Terms that tests on a block found to hold, and not to hold."""
        if block == "sensor":
            return decided_terms(self.sensor)
        # What a base does beyond its measured motion is asked for as a force on the structure.
        for place in (block, EITHER) if block != "excitation" else ("structure", EITHER):
            character = self.characters.get(place)
            if character is not None:
                return character.says
        return {}

    def evidence_on(self, effect: Effect) -> Evidence:
        """What the tests say for and against an effect."""
        return evidence(effect.spoken_for_by, self.says(effect.block))


def examined(found: Findings, seed: int = 0) -> Examination:
    """Ask where the retuned baseline misses the fitted runs, and how.

    Parameters
    ----------
    found : Findings
    seed : int
        Of the draws for intervals.
    """
    values = found.retuned.fit.values
    readings = found.readings(found.retuned)
    rig = getattr(found.model, "rig", None)
    maps = residual_maps(found.fitting, readings, rig)
    where = summary(mismatches(found.fitting, readings))
    if isinstance(found.model, ModelOfBlocks):
        return Examination(block_cut(found.model, found.fitting, values, seed), {}, (), maps, where)
    cut = interface_cut(found.model, found.fitting, values, seed)
    characters = {}
    for place in cut.places:
        with_place = next(run for run in cut.runs if run.at(place) is not None)
        characters[place] = force_character(
            cut.forces(place),
            own_tolerances(found.model, with_place, place),
            damping_shift=_damping_shift(found.model, with_place, place, values),
            seed=seed,
        )
    sensor: tuple[SensorAnswer, ...] = ()
    if cut.suspect:
        usable = [run for run in found.fitting if run]
        sensor = sensor_character(usable, cut.runs, cut.suspect, seed)
    return Examination(cut, characters, sensor, maps, where)


def _damping_shift(model: DiagnosedModel, run: RunForces, place: str, values: Mapping[str, float]) -> float:
    """How much more damping the retuned baseline has at a place than is believed [N s/m]."""
    shift = 0.0
    if run.structure is not None and place != "tank":
        factor = values.get("damping of mode 1", 1.0)
        # Of the first mode as seen from the tank, where the latent force acts.
        retuned = float(run.structure.dampings_kg_per_s[0] / run.structure.mode_shape[0] ** 2)
        shift += retuned * (1.0 - 1.0 / max(factor, 1e-6))
    if place != "structure":
        for term in model.twin.terms:
            name = f"{term.name}.damping_n_s_per_m"
            if term.place == "tank" and name in values:
                shift += values[name] - term.values["damping_n_s_per_m"]
    return shift


def seen_at(examination: Examination, best: ScoredModel | None, block: str = "") -> str:
    """Where in the cycle, and at which levels, what is missing shows; empty where it shows everywhere.

    Parameters
    ----------
    examination : Examination
    best : ScoredModel or None
        What was named.
    block : str
        Of what has no name.
    """
    faulty = best.channels if best is not None else ()
    worst = (faulty or examination.where.get("channels") or [""])[0]
    if faulty:
        cycle = [
            _cycle_of_channel(residual_map) for residual_map in examination.maps if residual_map.channel == worst
        ]
    else:
        place = best.fit.candidates[0].effect.block if best is not None else block
        cycle = [_cycle_of_force(examination, place)]
    words = " ".join(part for part in (*cycle, _levels(examination, worst)) if part)
    return f"seen {words}" if words else ""


def _cycle_of_channel(residual_map: ResidualMaps) -> str:
    """Words for the part of the cycle in which a faulty channel reads most of its error."""
    if residual_map.phase is None or not np.isfinite(residual_map.phase.excess).all():
        return ""
    return _in_the_cycle(residual_map.phase.middles, np.maximum(residual_map.phase.excess, 0.0))


def _cycle_of_force(examination: Examination, place: str) -> str:
    """The same for the force that a block lacks beyond its own spring, damper and mass.

    A motion that lags behind says nothing on what made it lag.
    """
    character = examination.characters.get(place)
    if examination.cut is None or character is None or not character.exceeds_noise:
        return ""
    phases, squares = [], []
    for force in examination.cut.forces(place):
        velocity, acceleration = force.motion[:, 1], force.motion[:, 2]
        scale = float(acceleration.std()) / max(float(velocity.std()), 1e-300)
        own, *_ = np.linalg.lstsq(force.motion, force.force_n)
        phases.append(np.arctan2(scale * velocity, acceleration))
        squares.append((force.force_n - force.motion @ own) ** 2)
    return _in_the_cycle(np.concatenate(phases), np.concatenate(squares))


def _in_the_cycle(phase: FloatArray, excess: FloatArray) -> str:
    """Words for the part of the cycle with most of something, if one stands out; a = a₀ cos φ."""
    mean = max(float(excess.mean()), 1e-300)
    near = {
        "at velocity reversals": np.abs(np.sin(phase)) < 0.5,
        "at the largest velocities": np.abs(np.cos(phase)) < 0.5,
        "about the lowest point": np.cos(phase) > 0.5,
        "about the highest point": np.cos(phase) < -0.5,
    }
    sizes = {words: float(excess[chosen].mean()) / mean for words, chosen in near.items() if chosen.any()}
    if len(sizes) < len(near):
        return ""
    best = max(sizes, key=lambda words: sizes[words])
    if best in ("about the lowest point", "about the highest point"):
        # The force of a symmetric reversal is as large at both ends of the stroke.
        other = min(sizes["about the lowest point"], sizes["about the highest point"])
        if sizes[best] < 2 * other:
            best = "at velocity reversals"
    return best if sizes[best] > _LEAST_RATIO_WITHIN_CYCLE * min(sizes.values()) and sizes[best] > 1.1 else ""


def _levels(examination: Examination, worst: str) -> str:
    """Levels that hold most of the mismatch, if they are not all."""
    levels = examination.where.get("acceleration_g")
    profile = next(
        (residual_map.level for residual_map in examination.maps if residual_map.channel == worst), None
    )
    if not levels or profile is None:
        return ""
    low, high = levels
    largest = float(profile.edges[-1])
    if high < 0.7 * largest and low < 0.3 * high:
        return f"below {high:.2g} g"
    is_above = low > 0.3 * largest and high >= 0.7 * largest
    return f"above {low:.2g} g" if is_above else f"from {low:.2g} to {high:.2g} g"


def examination_facts(examination: Examination, found: Findings) -> dict[str, Any]:
    """What ``verdict.json`` tells of it.

    Parameters
    ----------
    examination : Examination
    found : Findings
    """
    facts: dict[str, Any] = {"interface_cut": None, "characters": {}, "evidence": _evidence(examination, found)}
    cut = examination.cut
    if cut is not None:
        facts["interface_cut"] = {
            "blocks": [
                {
                    "block": block.block,
                    "input": block.input,
                    "output": block.output,
                    "share": _estimate(block.share, block.low, block.high),
                    "size": _number(block.size),
                    "noise": _number(block.noise),
                    "remark": block.remark,
                }
                for block in cut.blocks
            ],
            "doubted_channel": cut.suspect,
            "remark": cut.remark,
        }
    for place, character in examination.characters.items():
        facts["characters"][place] = {
            "force_rms_n": _number(character.size_n),
            "noise_rms_n": _number(character.noise_n),
            "answers": [_answer(answer) for answer in character.answers],
        }
    if examination.sensor:
        facts["characters"]["sensor"] = {
            "channel": cut.suspect if cut else "",
            "answers": [
                {
                    "question": "share of its error",
                    "finding": answer.term
                    if answer.holds
                    else CANNOT_TELL
                    if answer.holds is None
                    else f"not: {answer.term}",
                    **(_estimate(answer.share, answer.low, answer.high) or {}),
                }
                for answer in examination.sensor
            ],
        }
    return facts


def _answer(answer: Answer) -> dict[str, Any]:
    facts = {
        "question": answer.question,
        "finding": answer.finding,
        "quantity": answer.quantity,
        "units": answer.units,
    }
    return {**facts, **(_estimate(answer.value, answer.low, answer.high) or {}), "remark": answer.remark}


def _estimate(value: float, low: float, high: float) -> dict[str, float] | None:
    if not all(math.isfinite(bound) for bound in (value, low, high)):
        return None
    return {"estimate": value, "low": low, "high": high, "level": 0.90}


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _evidence(examination: Examination, found: Findings) -> dict[str, Any]:
    effects = {
        candidate.effect.known_as: candidate
        for explanation in found.explanations
        for candidate in explanation.fit.candidates
    }
    facts = {}
    for candidate in effects.values():
        on = examination.evidence_on(candidate.effect)
        facts[f"{candidate.effect.block}.{candidate.effect.known_as}"] = {
            "for": list(on.speaks_for),
            "against": list(on.speaks_against),
            "open": list(on.still_open),
        }
    return facts

"""Cases drawn from seeds: first what the laboratory does, then what it hides.

Rig and plan come from a generator that never sees the class, so that nothing but its signals can tell it.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from sealed_trial.case_signals import Laboratory, scales_of
from sealed_trial.composition import SINGLES, class_sizes, possible
from sealed_trial.hidden_physics.effect import Change, DrawnEffect, HiddenEffect, Scales, Signals
from sealed_trial.hidden_physics.unknown_physics import UNKNOWN_PHYSICS
from sealed_trial.laboratory.hidden_rig import HiddenRig, drawn_rig, wrongly_believed
from sealed_trial.laboratory.recorder import drawn_recorder
from sealed_trial.laboratory.sensors import Sensor, drawn_sensor
from sealed_trial.laboratory.test_plan import PLANS, TestPlan, drawn_plan
from sealed_trial.look_alikes import possible_look_alikes
from sealed_trial.strength import (
    LEAST_STRENGTH,
    ONLY_DAMPING,
    QUICK,
    STRENGTH_TOLERANCE,
    NoiseFloor,
    magnitude_for,
)

WEAKEST_CLEAR, STRONGEST_CLEAR = 3.5, 30.0
WEAKEST_MASKED, STRONGEST_MASKED = 0.3, 3.0
_HIDDEN_DRAWS = 8
_LEFT_OPEN = 1.2
_MOST_SEARCHES = 3
"""For the magnitude of an effect, each with baselines about the one that was found before."""
_LEAST_MOTION = 0.2
"""Of the motion without anything hidden; what is stuck is stuck by any friction, damper or spring alike."""


@dataclass(frozen=True)
class HiddenTruth:
    """What is true of a case.

    Attributes
    ----------
    case, kind : str
        Name of the case; its class.
    effects : list of dict
        Name, block, parameters, strength, channel.
    accepted : list of list of str
        Every set of names that is right; the empty one where nothing is missing.
    details : dict
        Rig, plan, seeds, and how reality differs from belief.
    """

    case: str
    kind: str
    effects: list[dict[str, Any]]
    accepted: list[list[str]]
    details: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class DrawnCase:
    """A case ready to be recorded."""

    laboratory: Laboratory
    sensors: dict[str, Sensor]
    signals: list[Signals]
    late: tuple[Change, ...]
    truth: HiddenTruth


def class_order(n_cases: int, generator: np.random.Generator) -> list[str]:
    """The class of every case, in random order."""
    order = [name for name, size in class_sizes(n_cases).items() for _ in range(size)]
    return [order[k] for k in generator.permutation(len(order))]


@dataclass(frozen=True, eq=False)
class _Prepared:
    """A laboratory before anything is hidden in it."""

    laboratory: Laboratory
    plain: list[Signals]
    scales: Scales
    sensors: dict[str, Sensor]

    @cached_property
    def floor(self) -> NoiseFloor:
        return NoiseFloor(self.laboratory, self.plain, self.sensors)


class CaseDrawing:
    """Draws one case after the other, covering the vocabulary evenly.

    Parameters
    ----------
    seed : sequence of int
        Separates trials, and development from sealed ones.
    plans : sequence of str
        Those that may be measured; all by default.
    effects : sequence of HiddenEffect
        The vocabulary from which effects are drawn; all of it by default.
    n_rigs : int
        Rigs that are tried with each plan.
    """

    def __init__(
        self,
        seed: Sequence[int],
        *,
        plans: Sequence[str] = PLANS,
        effects: Sequence[HiddenEffect] = SINGLES,
        n_rigs: int = 3,
    ) -> None:
        self._seed = [int(value) for value in seed]
        self._possible_plans, self._vocabulary = tuple(plans), tuple(effects)
        self._n_attempts = n_rigs * _HIDDEN_DRAWS
        self._used: Counter[str] = Counter()
        # an effect that a plan cannot show strongly enough comes last in its case, then another plan is tried
        self._failed: Counter[str] = Counter()
        self._plans: list[str] = []
        self._prepared: dict[tuple[int, int, str], _Prepared] = {}

    def _generator(self, *more: int) -> np.random.Generator:
        return np.random.default_rng([*self._seed, *more])

    def _next_plan(self, number: int) -> str:
        """Plans in random order, each as often as any other."""
        if not self._plans:
            self._plans = self._shuffled_plans(number, 1)
        return self._plans.pop()

    def _shuffled_plans(self, number: int, purpose: int) -> list[str]:
        plans = self._possible_plans
        return [plans[k] for k in self._generator(number, purpose).permutation(len(plans))]

    def case(self, number: int, name: str, kind: str) -> DrawnCase:
        """Draw a case of a class; with another plan where nothing of the class fits the one whose turn it is.

        Raises
        ------
        ArithmeticError
            If no draw of any plan gives a motion that can be measured.
        """
        first = self._next_plan(number)
        others = [plan for plan in self._shuffled_plans(number, 5) if plan != first]
        self._failed.clear()
        for plan_name in (first, *others):
            for attempt in range(self._n_attempts):
                try:
                    return self._attempted(number, attempt, name, kind, plan_name)
                except (ArithmeticError, LookupError):
                    continue
        raise ArithmeticError(f"no draw of class {kind} in {self._n_attempts} attempts with each plan")

    def _laboratory(self, number: int, redrawn: int, plan_name: str) -> _Prepared:
        """Rig, plan and sensors, the same for every hidden draw."""
        key = (number, redrawn, plan_name)
        if key not in self._prepared:
            generator = self._generator(number, 2, redrawn)
            rig = drawn_rig(plan_name.partition("_")[0], generator)
            plan = drawn_plan(plan_name, rig, generator)
            seed = int(generator.integers(2**31))
            # from a generator of its own: rigs and plans are those of trials without recorders
            laboratory = Laboratory(rig, plan, seed, drawn_recorder(self._generator(number, 6, redrawn)))
            plain = laboratory.signals()
            scales = scales_of(laboratory, plain)
            sensors = {
                channel: drawn_sensor(
                    max(scales.rms[channel], _least_rms(scales, channel)), scales.peak[channel], generator
                )
                for channel in plain[0]
            }
            self._prepared = {key: _Prepared(laboratory, plain, scales, sensors)}
        return self._prepared[key]

    def _attempted(self, number: int, attempt: int, name: str, kind: str, plan_name: str) -> DrawnCase:
        # what the laboratory does is drawn again only when no hidden draw fits it: it must not tell the class
        prepared = self._laboratory(number, attempt // _HIDDEN_DRAWS, plan_name)
        laboratory, plain, sensors = prepared.laboratory, prepared.plain, prepared.sensors
        hidden = self._generator(number, 3, attempt)
        drawn, accepted, wanted = self._drawn_effects(
            kind, laboratory.plan, laboratory.rig, prepared.scales, hidden
        )
        changes, described = [], []
        for effect, strength in zip(drawn, wanted, strict=True):
            change, reached = _scaled(effect, strength, laboratory, prepared.floor, plain)
            least, most = _strengths_of(kind)
            if not least <= reached <= most:  # NaN is neither
                self._failed[effect.name] += 1
                raise LookupError(f"{effect.name} cannot be made as strong as its class is")
            changes.append(change)
            described.append(_description(effect, change, reached))
            if not all(map(math.isfinite, (reached, *change.parameters.values()))):
                raise ArithmeticError(f"{effect.name} has no finite size")
        if kind == "retunable":
            laboratory = replace(laboratory, rig=wrongly_believed(laboratory.rig, hidden))
        signals = laboratory.signals(changes) if changes or kind == "retunable" else plain
        # what is stuck tells nothing of what holds it
        if _motion(signals) < _LEAST_MOTION * _motion(plain):
            raise LookupError("what is hidden leaves no motion to speak of")
        nuisance: dict[str, Any] = {}
        if kind == "nothing":
            signals, nuisance, extra = _with_nuisance(signals, sensors, laboratory, hidden)
            accepted = accepted + extra
        for description in described:
            self._used[description["name"]] += 1
        truth = HiddenTruth(
            name,
            kind,
            described,
            accepted,
            {
                "plan": plan_name,
                "rig_factors": laboratory.rig.factors,
                "recorder": asdict(laboratory.recorder),
                **nuisance,
            },
        )
        late = tuple(change for change in changes if change.late_distortion is not None)
        return DrawnCase(laboratory, sensors, signals, late, truth)

    def _drawn_effects(
        self, kind: str, plan: TestPlan, rig: HiddenRig, scales: Scales, generator: np.random.Generator
    ) -> tuple[list[DrawnEffect], list[list[str]], list[float]]:
        """Effects, the answers that are right, and the strengths wanted."""
        if kind in ("nothing", "retunable"):
            return [], [[]], []
        if kind == "look_alike":
            choices = possible_look_alikes(plan, rig)
            if not choices:
                raise LookupError("no look-alike for this plan")
            chosen = choices[int(generator.integers(len(choices)))]
            effect = chosen.truth.draw(scales, generator)
            return [effect], [list(names) for names in chosen.equals], [_clear(generator)]
        vocabulary = UNKNOWN_PHYSICS if kind == "outside" else self._vocabulary
        effects = self._chosen(possible(vocabulary, plan, rig), 2 if kind == "pair" else 1, generator)
        drawn = [effect.draw(scales, generator) for effect in effects]
        if kind == "masked":
            span = math.log(STRONGEST_MASKED / WEAKEST_MASKED)
            return drawn, [[drawn[0].name]], [WEAKEST_MASKED * math.exp(span * generator.random())]
        accepted = [["unknown"]] if kind == "outside" else [[effect.name for effect in drawn]]
        return drawn, accepted, [_clear(generator) for _ in drawn]

    def _chosen(
        self, effects: Sequence[HiddenEffect], n: int, generator: np.random.Generator
    ) -> list[HiddenEffect]:
        """Those that failed least in this case and are least used so far, of different blocks, ties by lot."""
        if len(effects) < n:
            raise LookupError("too few effects for this plan")
        order = sorted(
            (effects[k] for k in generator.permutation(len(effects))),
            key=lambda effect: (self._failed[effect.name], self._used[effect.name]),
        )
        first = order[0]
        others = [effect for effect in order[1:] if effect.block != first.block]
        if n == 1:
            return [first]
        if not others:
            raise LookupError("no second block for this plan")
        return [first, others[0]]


def _motion(signals: Sequence[Signals]) -> float:
    """RMS acceleration of the tank relative to the base, where there is a structure between them."""
    runs = [run["acceleration_tip"] - run["acceleration_root"] for run in signals if "acceleration_tip" in run]
    return float(np.sqrt(np.mean(np.concatenate(runs) ** 2))) if runs else 1.0


def _strengths_of(kind: str) -> tuple[float, float]:
    """Weakest and strongest that a class allows, with what the search for a magnitude leaves open."""
    if kind == "masked":
        return WEAKEST_MASKED, STRONGEST_MASKED * _LEFT_OPEN
    return 3.0, STRONGEST_CLEAR * _LEFT_OPEN


def _clear(generator: np.random.Generator) -> float:
    return WEAKEST_CLEAR * math.exp(math.log(STRONGEST_CLEAR / WEAKEST_CLEAR) * generator.random())


def _least_rms(scales: Scales, channel: str) -> float:
    """A channel that shows nothing has the noise of its neighbours of the same quantity."""
    quantity = channel.partition("_")[0]
    return 0.05 * max(rms for name, rms in scales.rms.items() if name.startswith(quantity))


def _scaled(
    effect: DrawnEffect, wanted: float, laboratory: Laboratory, floor: NoiseFloor, plain: list[Signals]
) -> tuple[Change, float]:
    """The effect with the magnitude that shows as strongly as wanted."""
    floor.start_anew()
    rate = laboratory.plan.sampling_rate_hz

    def strength_of(magnitude: float) -> float:
        return strength_of_change(effect.change(magnitude))

    def strength_of_change(change: Change) -> float:
        try:
            changed = laboratory.signals([change], relative_tolerance=QUICK) if effect.block != "sensor" else plain
        except ArithmeticError:
            return 1e6
        if effect.block == "sensor":
            changed = change.distorted(changed, rate)
        changed = change.distorted(changed, rate, late=True)
        return floor.strength(changed, damping_is_known=effect.name in ONLY_DAMPING)

    magnitude, reached = 1.0, math.nan
    for _ in range(_MOST_SEARCHES):
        magnitude, seemed = magnitude_for(strength_of, wanted, effect.least, effect.most, first=magnitude)
        # Baselines are few, and the search has spent them on the magnitudes that it came by.
        floor.start_anew()
        reached = strength_of(magnitude)
        if abs(math.log(max(reached, LEAST_STRENGTH) / max(seemed, LEAST_STRENGTH))) < STRENGTH_TOLERANCE:
            break
    if effect.essential is not None and strength_of_change(effect.essential(magnitude)) < WEAKEST_CLEAR:
        raise LookupError(f"{effect.name} does not show what makes it")
    return effect.change(magnitude), reached


def _description(effect: DrawnEffect, change: Change, strength: float) -> dict[str, Any]:
    described: dict[str, Any] = {
        "name": effect.name,
        "block": effect.block,
        "parameters": {name: float(value) for name, value in change.parameters.items()},
        "strength": float(strength),
    }
    if effect.channel:
        described["channel"] = effect.channel
    if effect.description:
        described["description"] = effect.description
    return described


def _with_nuisance(
    signals: list[Signals], sensors: dict[str, Sensor], laboratory: Laboratory, generator: np.random.Generator
) -> tuple[list[Signals], dict[str, Any], list[list[str]]]:
    """What a laboratory has without anything missing: nothing, a drift, or a burst of noise."""
    sort = str(generator.choice(["none", "none", "drift", "burst"]))
    if sort == "none":
        return signals, {"nuisance": sort}, []
    channel = str(generator.choice([name for name in sorted(sensors) if name != "acceleration_root"]))
    rate, noise = laboratory.plan.sampling_rate_hz, sensors[channel].noise
    changed = [dict(run) for run in signals]
    if sort == "drift":
        for run in changed:
            run[channel] = run[channel] + noise * generator.uniform(0.5, 1.5) * np.arange(run[channel].size) / rate
        return changed, {"nuisance": sort, "channel": channel}, [["sensor_drift"]]
    run = changed[int(generator.integers(len(changed)))]
    start = int(generator.uniform(0.2, 0.8) * run[channel].size)
    stop = start + int(0.25 * rate)
    values = run[channel].copy()
    values[start:stop] += 15 * noise * generator.standard_normal(stop - start)[: values[start:stop].size]
    run[channel] = values
    return changed, {"nuisance": sort, "channel": channel}, []

"""How pairs of effects are sought, with fits written by hand."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from recorded_oscillators import decays, effect, rig, surroundings

from sloshlab.diagnosis.candidate import Candidate, candidates
from sloshlab.diagnosis.explanation import Explanation
from sloshlab.diagnosis.free_run_problem import FreeRunFit
from sloshlab.diagnosis.rig_model import RigModel
from sloshlab.diagnosis.search import model_search
from sloshlab.diagnosis.search.fits import Fits


def explanation(
    cost: float, *keys: str, left: float = 2.0, in_a_channel: float = 1.0, includes: tuple[str, ...] = ()
) -> Any:
    by_run = {("run", "channel"): in_a_channel}
    acts = tuple(
        SimpleNamespace(effect=SimpleNamespace(block="structure", known_as=key, includes=includes)) for key in keys
    )
    fit = SimpleNamespace(cost=cost, keys=keys, candidates=acts, values={})
    return SimpleNamespace(fit=fit, keys=keys, held_out_rms=left, by_run=by_run)


class Tried:
    """Stands for the fits of one more effect; remembers beside what they were asked for."""

    def __init__(self, pairs: dict[tuple[str, ...], list[Any]]) -> None:
        self.pairs, self.beside, self.for_all = pairs, [], []
        self.substitution = SimpleNamespace(
            replaced_by_single=lambda wider, base, pool: self.for_all.append(wider.keys) or [],
            look_alikes=lambda *all_: [],
            nesting_models=lambda *all_: [],
        )

    def fitted(self, base: Any, jacobian: Any, pool: Any, what: str) -> list[Any]:
        self.beside.append(base.keys)
        return self.pairs.get(base.keys, [])


RETUNED = explanation(5000.0, in_a_channel=9.0)
BEST = explanation(3000.0, "stiffness_change", includes=("mass_error",))
SECOND = explanation(4500.0, "hum")


def sought(
    monkeypatch: pytest.MonkeyPatch,
    pair: Any,
    *,
    is_noise: bool = False,
    retuned: Any = RETUNED,
    has_little_repeatable: bool = True,
    known: tuple[Any, ...] = (),
    is_complete: bool = False,
) -> tuple[Tried, list[Any]]:
    tried = Tried({BEST.keys: [pair], SECOND.keys: [explanation(1000.0, "hum", "missing_mode", left=0.9)]})
    fits = SimpleNamespace(
        is_complete=lambda explanation: is_complete,
        problem_of=lambda fit: SimpleNamespace(is_down_to_noise=lambda fit: is_noise),
        jacobian=lambda fit: None,
        has_little_repeatable=lambda explanation: has_little_repeatable,
    )
    monkeypatch.setattr(model_search, "ForwardSelection", lambda fits: tried)
    monkeypatch.setattr(model_search, "_candidates_beside", lambda best, at, pool: [])
    monkeypatch.setattr(
        model_search,
        "Refinement",
        lambda fits: SimpleNamespace(backward_eliminated=lambda pairs: [SECOND] if pairs else []),
    )
    return tried, model_search._second_effects(  # type: ignore[arg-type]
        fits, [*known, BEST], retuned, cast(Any, None), []
    )


def test_where_the_best_pair_leaves_too_much_its_first_effect_is_exchanged(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tried, found = sought(monkeypatch, explanation(2000.0, "stiffness_change", "hum"))
    assert tried.beside == [("stiffness_change",), ("hum",)]
    assert [explanation.keys for explanation in found] == [
        ("stiffness_change", "hum"),
        ("hum", "missing_mode"),
        ("hum",),
    ]


@pytest.mark.parametrize(
    ("special", "is_complete", "is_tried"),
    [
        pytest.param(explanation(3990.0, "mass_error"), False, True, id="a special case with half the gain"),
        pytest.param(explanation(4010.0, "mass_error"), False, False, id="with less"),
        pytest.param(explanation(3990.0, "constant_force"), False, False, id="another effect"),
        pytest.param(explanation(3990.0, "mass_error"), True, False, id="the pair leaves nothing"),
    ],
)
def test_a_second_effect_is_sought_beside_the_model_nested_in_the_first(
    monkeypatch: pytest.MonkeyPatch, special: Any, is_complete: bool, is_tried: bool
) -> None:
    """Other numbers of the general form may have stood for the second effect."""
    pair = explanation(2990.0, "stiffness_change", "hum")
    tried, _ = sought(monkeypatch, pair, known=(special,), is_complete=is_complete)
    assert tried.beside == [("stiffness_change",), *([special.keys] if is_tried else [])]


def test_a_pair_that_leaves_little_stays_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    tried, _ = sought(monkeypatch, explanation(2000.0, "stiffness_change", "hum", left=1.2))
    assert tried.beside == [("stiffness_change",)]


def test_one_effect_is_sought_in_place_of_a_pair_that_gains(monkeypatch: pytest.MonkeyPatch) -> None:
    assert sought(monkeypatch, explanation(2000.0, "stiffness_change", "hum"))[0].for_all == [
        ("stiffness_change", "hum")
    ]
    assert sought(monkeypatch, explanation(2990.0, "stiffness_change", "hum"))[0].for_all == []


@pytest.mark.parametrize(
    ("cost", "beside"), [(2390.0, [("stiffness_change",), ("hum",)]), (2410.0, [("stiffness_change",)])]
)
def test_only_a_pair_that_gains_a_fifth_tells_that_its_first_effect_is_wrong(
    monkeypatch: pytest.MonkeyPatch, cost: float, beside: list[tuple[str, ...]]
) -> None:
    tried, _ = sought(monkeypatch, explanation(cost, "stiffness_change", "hum"))
    assert tried.beside == beside


def test_a_burst_in_one_channel_of_a_run_alone_is_no_physics() -> None:
    fits = Fits(cast(Any, None), [], [], lambda what, done, of: None, [["a", "b"], ["c"]])
    places = {("c", "tip"): 0.9, ("c", "force"): 0.9, ("c", "root"): 15.0}
    explanation = Explanation(
        FreeRunFit((), {}, 0.0, 0.0), 0.0, 1.0, by_run=places, repeatable={("a", "tip"): 0.1}
    )
    assert fits.is_complete(explanation)
    assert not fits.is_complete(replace(explanation, by_run={**places, ("c", "force"): 15.0}))


def test_nothing_is_sought_beside_what_leaves_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    tried, found = sought(monkeypatch, explanation(2000.0, "stiffness_change", "hum"), is_noise=True)
    assert (tried.beside, found) == ([], [])


@pytest.mark.parametrize(
    ("shared", "alone", "is_complete"),
    [
        pytest.param((0.2, 0.2), 1.4, True, id="little is left"),
        pytest.param((0.3, 0.3), 1.4, False, id="all channels share it"),
        pytest.param((0.45, -0.1), 1.4, True, id="one channel shares a little"),
        pytest.param((0.55, -0.1), 1.4, False, id="one channel shares more"),
        pytest.param((0.2, 0.2), 1.6, False, id="a run alone shows more"),
    ],
)
def test_nothing_more_is_sought_where_repeats_share_nothing_more(
    shared: tuple[float, float], alone: float, is_complete: bool
) -> None:
    tests = [["a", "b"], ["c"]]
    fits = Fits(cast(Any, None), [], [], lambda what, done, of: None, tests)
    left = Explanation(
        FreeRunFit((), {}, 0.0, 0.0),
        held_out=0.0,
        held_out_rms=1.0,
        by_run={("a", "tip"): 9.0, ("b", "tip"): 9.0, ("c", "tip"): alone},
        repeatable={("a", "tip"): shared[0], ("a", "force"): shared[1]},
    )
    assert fits.is_complete(left) is is_complete
    assert not fits.is_complete(replace(left, repeatable={}))


@pytest.mark.parametrize(("removed", "is_tried"), [(0.4, False), (0.6, True)])
def test_pairs_are_not_tried_where_no_effect_removes_anything_to_speak_of(
    monkeypatch: pytest.MonkeyPatch, removed: float, is_tried: bool
) -> None:
    """Noise floors removed: root of the mean square before over that after, less one."""
    pair, retuned = (
        explanation(2000.0, "stiffness_change", "hum"),
        explanation(5000.0, in_a_channel=1 + removed**2),
    )
    assert bool(sought(monkeypatch, pair, retuned=retuned)[0].beside) == is_tried
    assert sought(monkeypatch, pair, retuned=retuned, has_little_repeatable=False)[0].beside


@pytest.mark.parametrize(
    ("key", "beside"),
    [
        ("tank.liquid_sloshing", {"tank.breakup_delay", "tank.high_g_saturation"}),
        ("tank.quadratic_drag", set()),
        ("tank.effective_mass", set()),
    ],
)
def test_what_acts_on_the_damping_of_liquid_is_possible_beside_what_brings_it(
    tmp_path: Path, key: str, beside: set[str]
) -> None:
    """Frozen liquid damps nothing that could come late."""
    model = RigModel(rig(tmp_path), tmp_path, decays((0.02,), 1.0))
    at = surroundings(model)
    pool = candidates(at)
    assert "tank.breakup_delay" not in {candidate.key for candidate in pool}
    first = Candidate(effect(key), at)
    best = Explanation(FreeRunFit((first,), first.starts()[0], 0.0, 0.0), 0.0, 1.0)
    assert {candidate.key for candidate in model_search._candidates_beside(best, at, pool)} == beside

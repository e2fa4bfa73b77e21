"""An effect with several forms answers with one name; where forms are compared, each says which one it is."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from sloshlab.diagnosis.found_law import FoundLaw
from sloshlab.diagnosis.inference.decision import Decision
from sloshlab.diagnosis.interval import Interval
from sloshlab.diagnosis.wording import (
    _described,
    form_and_place,
    headline_of,
    named_and_placed,
    refuted_statement,
    statement_of,
)
from sloshlab.identification.baseline_parameter import BaselineParameter
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import Candidate, known_effects
from sloshlab.twin.product_forces import Factor, Product

assert effects.__all__


@pytest.mark.parametrize(
    ("key", "channel", "answer", "compared"),
    [
        ("tank.high_g_saturation", "", "high g saturation in the tank", "high g saturation in the tank"),
        (
            "tank.gradual_saturation",
            "",
            "high g saturation in the tank",
            "high g saturation (gradual saturation) in the tank",
        ),
        (
            "sensor.mains_hum_60",
            "force_1+force_2",
            "mains hum of force_1 and force_2",
            "mains hum (mains hum 60) of force_1 and force_2",
        ),
    ],
)
def test_a_form_is_said_where_forms_are_compared(key: str, channel: str, answer: str, compared: str) -> None:
    [effect] = [effect for effect in known_effects() if f"{effect.block}.{effect.name}" == key]
    candidate = Candidate(effect, None, channel)  # type: ignore[arg-type]
    assert named_and_placed(candidate) == answer
    assert form_and_place(candidate) == compared


@pytest.mark.parametrize(("tolerances", "said"), [(4.0, True), (2.5, False)])
def test_a_believed_number_is_refuted_where_it_is_held_far_away(tolerances: float, said: bool) -> None:
    spring = BaselineParameter("stiffness", 1e5, 1e4, "N m-1")
    found: Any = SimpleNamespace(model=SimpleNamespace(parameters=(spring,), runs=()))
    held: Any = SimpleNamespace(fit=SimpleNamespace(values={"stiffness": 1e5 - tolerances * 1e4}, candidates=()))
    words = refuted_statement(found, held)
    assert words == (
        "; what is believed of the stiffness is refuted: 1e+05 ± 1e+04 N m-1, while the recordings ask for 6e+04"
        if said
        else ""
    )


@pytest.mark.parametrize(
    ("key", "words"),
    [
        ("structure.stiffness_change", "; what is believed of the stiffness of the structure is refuted"),
        ("tank.mass_error", "; what is believed of the mass of tank and liquid is refuted"),
        ("structure.cubic_stiffness", ""),
    ],
)
def test_an_effect_that_corrects_a_number_of_the_twin_refutes_it(key: str, words: str) -> None:
    [effect] = [effect for effect in known_effects() if f"{effect.block}.{effect.name}" == key]
    found: Any = SimpleNamespace(model=SimpleNamespace(parameters=(), runs=()))
    named: Any = SimpleNamespace(fit=SimpleNamespace(values={}, candidates=(SimpleNamespace(effect=effect),)))
    assert refuted_statement(found, named) == words


@pytest.mark.parametrize(
    ("rates", "words"),
    [
        ({"first": (0.2, 0.1, 0.3), "second": (-0.1, -0.2, 0.0)}, "rate −0.1 to 0.2 in 2 runs"),
        ({"first": (0.2, 0.1, 0.3)}, "0.2 (0.1 to 0.3)"),
    ],
)
def test_numbers_of_several_runs_are_said_as_a_span(
    rates: dict[str, tuple[float, float, float]], words: str
) -> None:
    [drift] = [effect for effect in known_effects() if effect.name == "drift_of_runs"]
    candidate = Candidate(drift.of_runs(("first", "second")), cast(Any, None), "acceleration_tip")
    intervals = {(candidate.key, f"rate in {run}"): Interval(*its) for run, its in rates.items()}
    assert _described(candidate, intervals) == f"sensor drift of acceleration_tip, {words}"


def test_numbers_that_all_runs_share_stand_beside_those_of_runs() -> None:
    [line] = [effect for effect in known_effects() if effect.key == "tank.harmonic_force"]
    candidate = Candidate(line.of_runs(("first", "second")), cast(Any, None))
    numbers = {"size_n": 2.0, "frequency_hz": 9.0, "phase in first": 0.25, "phase in second": 0.75}
    intervals = {(candidate.key, name): Interval(size, 0.9 * size, 1.1 * size) for name, size in numbers.items()}
    assert _described(candidate, intervals) == (
        "external force in the tank, size 2 N (1.8 to 2.2), frequency 9 Hz (8.1 to 9.9), "
        "phase 0.25 to 0.75 in 2 runs"
    )


@pytest.mark.parametrize(
    ("none", "added"),
    [
        (
            0.47,
            "; these recordings do not tell that from mass error (0.30) or cross talk + mass error (0.22)"
            " or something that has no name (0.02)",
        ),
        (0.95, ""),
    ],
)
def test_what_may_be_the_rig_alone_is_said_beside_nothing(none: float, added: str) -> None:
    probabilities = {"none": none, "mass_error": 0.3, "cross_talk + mass_error": 0.22, "clearance": 0.001}
    decision = Decision("nothing_missing", None, [], "", {**probabilities, "unknown": 0.02})
    found: Any = SimpleNamespace(retuned=SimpleNamespace(held_out_rms=0.84))
    said = (
        "Nothing is missing: with its own parameters retuned the simulation describes the held-out runs to 0.84 of"
    )
    assert statement_of(found, decision, {}) == f"{said} the noise floor{added}."


def test_what_may_be_missing_besides_is_in_the_statement() -> None:
    best: Any = SimpleNamespace(names=("drag",), fit=SimpleNamespace(candidates=()), held_out_rms=0.9)
    wider: Any = [SimpleNamespace(names=names) for names in (("cross_talk", "drag"), ("drag", "sensor_gain"))]
    found: Any = SimpleNamespace(retuned=SimpleNamespace(held_out_rms=1.4))
    said = statement_of(found, Decision("named", best, [best], "", {}, wider), {})
    assert said.endswith("; these recordings do not tell whether cross talk or sensor gain is missing besides.")


@pytest.mark.parametrize("n_channels", [1, 2])
def test_of_one_channel_alone_its_sensor_may_be_meant(n_channels: int) -> None:
    found: Any = SimpleNamespace(fitting=[[object()] * n_channels], split=SimpleNamespace(has_held_out=True))
    said = statement_of(found, Decision("unknown", None, [], "structure", {}), {})
    sensor = " or in what its only sensor makes of it" if n_channels == 1 else ""
    assert said == f"Something is missing that has no name here, in the structure{sensor}."


def _model(keys: tuple[str, ...], held_out: float, channel: str = "acceleration_beam_1") -> Any:
    chosen = []
    for key in keys:
        [effect] = [effect for effect in known_effects() if f"{effect.block}.{effect.name}" == key]
        at = cast(Any, SimpleNamespace(runs=()))
        chosen.append(Candidate(effect, at, channel if effect.block == "sensor" else ""))
    names = tuple(sorted(candidate.effect.known_as for candidate in chosen))
    return SimpleNamespace(fit=SimpleNamespace(candidates=tuple(chosen)), names=names, held_out_rms=held_out)


LONGEST = ("tank.gradual_saturation", "sensor.sample_and_hold")


@pytest.mark.parametrize(
    ("kind", "keys", "n_products"),
    [
        ("named", ("structure.coulomb_friction",), 0),
        ("named", LONGEST, 0),
        ("indistinguishable", LONGEST, 0),
        ("unknown", LONGEST, 0),
        ("unknown", LONGEST, 1),
        ("unknown", LONGEST, 3),
        ("nothing_missing", (), 0),
    ],
)
def test_a_headline_has_at_most_forty_words_with_sizes(kind: str, keys: tuple[str, ...], n_products: int) -> None:
    found: Any = SimpleNamespace(retuned=SimpleNamespace(held_out_rms=12.34))
    best = _model(keys, 0.987) if keys else None
    others = [_model(("structure.asymmetric_friction", *LONGEST[1:]), 1.0), _model(("tank.liquid_loss",), 1.0)]
    alternatives = [best, *others] if kind == "indistinguishable" else [best]
    decision = Decision(kind, best, alternatives if best else [], "structure", {})
    intervals = {
        (candidate.key, parameter.name): Interval(0.3251, 0.31, 0.34)
        for candidate in (best.fit.candidates if best else ())
        for parameter in candidate.effect.parameters
    }
    products = (Product(Factor(4), Factor(2, True)), Product(Factor(5, True)), Product(velocity=Factor(3, True)))
    model: Any = SimpleNamespace(held_out_rms=0.9)
    chosen, coefficients = products[:n_products], (1.0, -2.0, 3.0)[:n_products]
    law = FoundLaw(model, "structure", chosen, coefficients, (0.01, 0.4, 12.0), True) if n_products else None
    words = headline_of(found, decision, intervals, law)
    assert len(words.split()) <= 40
    assert "12" in words
    if kind in ("named", "indistinguishable"):
        assert words.startswith("Left out: ")
        assert "0.325" in words
        assert "0.99" in words
    if kind == "indistinguishable":
        assert "do not tell it from" in words
        # the names of the others would be too many words
        assert "from 3 others" in words
    if n_products == 1:
        assert "f = 6.25·10⁸ N s² m⁻⁶ · x⁴ · v |v|, a damping that depends on the displacement" in words
    if n_products > 1:
        assert "a nonlinear spring" in words

"""What is believed of the numbers of effects: densities, evenly drawn sets, ranges beside every equation."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recorded_oscillators import decays, driven, effect, rig, surroundings
from scipy.stats import kstest, loguniform, uniform

from sloshlab import registry
from sloshlab.errors import InputError
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import (
    Candidate,
    Effect,
    EffectParameter,
    Surroundings,
    candidates,
    known_effects,
)
from sloshlab.missing_physics.prior import ParameterPrior, Range, drawn

assert effects.__all__


@pytest.fixture(scope="module")
def at(tmp_path_factory: pytest.TempPathFactory) -> Surroundings:
    folder = tmp_path_factory.mktemp("priors")
    found = surroundings(RigModel(rig(folder, 0.4), folder, [*driven(), *decays((0.01,), 2.0)]))
    return replace(found, runs=("driven", "decay_0"), update_rates_hz={"acceleration_tip": (61.0,)})


LOGARITHMIC = ParameterPrior("force_n", 0.02, 5.0, is_log=True, may_be_negative=False)
EITHER_SIGN = ParameterPrior("force_n", 0.02, 5.0, is_log=True, may_be_negative=True)
EVEN = ParameterPrior("exponent", -1.0, 3.0, is_log=False, may_be_negative=False)


@pytest.mark.parametrize("prior", [LOGARITHMIC, EITHER_SIGN, EVEN])
def test_a_density_is_one_over_all_numbers_and_none_outside(prior: ParameterPrior) -> None:
    sizes = np.geomspace(0.02, 5.0, 4001) if prior.is_log else np.linspace(-1.0, 3.0, 4001)
    density = np.exp([prior.log_density(float(size)) for size in sizes])
    total = np.trapezoid(density, sizes) * (2 if prior.may_be_negative else 1)
    assert total == pytest.approx(1.0, rel=1e-5)
    assert prior.log_density(5.1) == -np.inf
    assert prior.log_density(-0.5) == (-np.inf if prior is LOGARITHMIC else prior.log_density(0.5))


@pytest.mark.parametrize(("prior", "belief"), [(LOGARITHMIC, loguniform(0.02, 5.0)), (EVEN, uniform(-1.0, 4.0))])
def test_drawn_numbers_are_spread_as_the_prior_says(prior: ParameterPrior, belief: object) -> None:
    values = [numbers[prior.name] for numbers in drawn([prior], 512)]
    # of independent numbers the distance would be 0.04; evenly spread ones are ten times nearer
    assert kstest(values, belief.cdf).statistic < 0.01  # type: ignore[attr-defined]


def test_numbers_of_either_sign_are_as_often_negative() -> None:
    values = np.array([numbers["force_n"] for numbers in drawn([EITHER_SIGN], 512)])
    assert abs(np.mean(values < 0) - 0.5) < 0.01
    assert kstest(np.abs(values), loguniform(0.02, 5.0).cdf).statistic < 0.01
    shares = np.linspace(0, 1, 101)
    assert (np.diff([EITHER_SIGN.value(float(share)) for share in shares]) > 0).all()


def test_pairs_of_numbers_fill_the_square() -> None:
    """In ten dimensions, too: no two numbers of a set go together."""
    priors = [replace(EVEN, name=f"n{k}") for k in range(10)]
    table = np.array([list(numbers.values()) for numbers in drawn(priors, 256)])
    between = np.corrcoef(table.T) - np.eye(10)
    assert np.abs(between).max() < 0.2
    counts = [
        np.histogram2d(table[:, i], table[:, j], bins=4, range=((-1, 3), (-1, 3)))[0].min()
        for i in range(10)
        for j in range(i)
    ]
    assert min(counts) >= 4  # sixteen on average


@pytest.mark.parametrize(
    "wrong",
    [("force_n", 0.0, 1.0, True, False), ("force_n", 2.0, 1.0, False, False), ("force_n", 0.1, 1.0, False, True)],
)
def test_a_range_that_cannot_be_is_refused(wrong: tuple[str, float, float, bool, bool]) -> None:
    with pytest.raises(InputError, match="prior of force_n"):
        ParameterPrior(*wrong)


def test_every_number_of_the_vocabulary_has_a_range_in_which_its_starts_lie(at: Surroundings) -> None:
    found = candidates(at)
    assert {candidate.effect.block for candidate in found} == {"excitation", "structure", "tank", "sensor"}
    for candidate in found:
        assert all(parameter.range is not None for parameter in candidate.effect.parameters), candidate.key
        for start in candidate.starts():
            for prior in candidate.prior:
                assert prior.log_density(start[prior.name]) > -np.inf, (prior, start[prior.name])


def test_drawn_sets_begin_with_the_first_start_and_lie_within_the_bounds(at: Surroundings) -> None:
    for candidate in candidates(at):
        sets = candidate.drawn(9)
        assert len(sets) == 9
        assert sets[0] == candidate.starts()[0]
        assert sets == candidate.drawn(9)
        for numbers in sets[1:]:
            for parameter in candidate.effect.parameters:
                low, high = candidate.bounds(parameter)
                assert low <= numbers[f"{candidate.key}.{parameter.name}"] <= high


def test_ranges_grow_with_the_motion(at: Surroundings) -> None:
    """A friction in shares of m a, a cubic spring of m a/x³."""
    larger = replace(at, displacement_m=2 * at.displacement_m, force_n=2 * at.force_n)
    for key, factor in (("structure.coulomb_friction", 2.0), ("structure.cubic_stiffness", 0.25)):
        [before], [after] = (Candidate(effect(key), place).prior for place in (at, larger))
        assert after.low / before.low == pytest.approx(factor)
        assert after.high / before.high == pytest.approx(factor)


def test_an_effect_without_ranges_is_believed_two_decades_about_its_starts(at: Surroundings) -> None:
    own = Effect(
        "stick",
        "structure",
        "",
        (EffectParameter("force_n", 0.0, 30.0), EffectParameter("slope", -1e6, 1e6)),
        lambda at: [{"force_n": 2.0, "slope": -0.3}],
        effect("structure.coulomb_friction").extension,
    )
    force, slope = own.prior(at)
    assert (force.low, force.high, force.may_be_negative) == (pytest.approx(0.02), 30.0, False)
    assert (slope.low, slope.high, slope.may_be_negative) == (pytest.approx(0.003), pytest.approx(30.0), True)


def test_bounds_that_leave_nothing_of_a_range_are_believed_themselves(at: Surroundings) -> None:
    bounded = Effect(
        "stick",
        "structure",
        "",
        (EffectParameter("force_n", 0.0, 1.0, range=Range(30.0, 300.0)),),
        lambda at: [{"force_n": 1.0}],
        effect("structure.coulomb_friction").extension,
    )
    [prior] = bounded.prior(at)
    assert (prior.low, prior.high) == (pytest.approx(0.01), 1.0)


class _Point:
    """An entry point as an installed package has it."""

    def __init__(self, name: str, value: str) -> None:
        self.name, self.value = name, value


@pytest.fixture
def offered(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):  # type: ignore[no-untyped-def]
    """Install a package that offers something in place of an effect."""

    def install(text: str, reference: str) -> None:
        (tmp_path / "brought_along.py").write_text(text, encoding="utf-8")
        monkeypatch.syspath_prepend(str(tmp_path))
        monkeypatch.delitem(__import__("sys").modules, "brought_along", raising=False)
        monkeypatch.setattr(
            registry.importlib.metadata,  # type: ignore[attr-defined]
            "entry_points",
            lambda group: [_Point("structure.glue", reference)] if group == "sloshlab.effects" else [],
        )
        registry._offered_by_packages.cache_clear()

    yield install
    registry._offered_by_packages.cache_clear()


GLUE = """
from sloshlab.missing_physics.candidate import EFFECTS, Effect, EffectParameter
from sloshlab.missing_physics.extension import Extension

GLUE = Effect("glue", "structure", "", (EffectParameter("force_n", 0.0, 1.0),), lambda at: [{"force_n": 0.1}],
              lambda numbers, at, channel: Extension())
"""


def test_an_installed_package_adds_an_effect(offered, at: Surroundings) -> None:  # type: ignore[no-untyped-def]
    offered(GLUE, "brought_along:GLUE")
    assert "structure.glue" in [known.key for known in known_effects()]
    assert "structure.glue" in [candidate.key for candidate in candidates(at)]


def test_what_an_installed_package_offers_has_to_be_an_effect(offered) -> None:  # type: ignore[no-untyped-def]
    offered(GLUE, "brought_along:Effect")
    with pytest.raises(InputError, match=r"effect structure\.glue: got type; allowed: Effect"):
        known_effects()

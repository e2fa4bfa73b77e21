"""Laws of forces outside the vocabulary, concealed in decays that scipy made, and their words."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recorded_oscillators import decays, rig

from sloshlab.diagnosis import findings
from sloshlab.diagnosis.findings import Findings, findings_of
from sloshlab.diagnosis.found_law import FoundLaw, found_law
from sloshlab.diagnosis.selection.known_fits import SEARCH
from sloshlab.diagnosis.selection.model_selection import ModelSelection
from sloshlab.diagnosis.verdict import verdict_facts, verdict_of
from sloshlab.identification.case import Case
from sloshlab.identification.free_run_problem import FreeRunFit
from sloshlab.missing_physics.candidate import extension_of
from sloshlab.missing_physics.product_laws import library
from sloshlab.twin.excitation import free
from sloshlab.twin.product_forces import Factor, Product
from sloshlab.twin.storage import load_twin

LEVELS_M = (0.006, 0.010, 0.018)
Force = Callable[[float, float, float], float]


def retuned_alone(self: ModelSelection, retuned: FreeRunFit) -> list[FreeRunFit]:
    """In place of the search for names, which takes minutes and has none for these forces."""
    self.known.keep([retuned])
    return self.known.in_order()


def damped_with_displacement(t: float, x: float, v: float) -> float:
    """The force of which several tests ask [N]."""
    return -3e4 * x**2 * v


@pytest.fixture(name="found", scope="module")
def _found(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[Force], Findings]]:
    known: dict[Force, Findings] = {}
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(findings.ModelSelection, "selected", retuned_alone)

        def of(force: Force) -> Findings:
            if force not in known:
                folder = tmp_path_factory.mktemp("law")
                runs = decays(LEVELS_M, seed=7, force=force)
                known[force] = findings_of(Case("case", folder, rig(folder), tuple(runs)))
            return known[force]

        yield of


@pytest.fixture(name="law_of", scope="module")
def _law_of(found: Callable[[Force], Findings]) -> Callable[[Force], FoundLaw | None]:
    """The law of a structure, looked for once."""
    return functools.cache(lambda force: found_law(found(force), "structure"))


@pytest.mark.parametrize(
    ("force", "formula", "words"),
    [
        (damped_with_displacement, "x² · v", "a damping that depends on the displacement"),
        pytest.param(lambda t, x, v: -3e8 * x**5, "x⁵", "a nonlinear spring", marks=pytest.mark.slow),
        pytest.param(
            lambda t, x, v: -20 * abs(x) * np.tanh(v / 1e-4),
            "|x| · sgn v",
            "a dry friction that depends on the displacement",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_a_concealed_law_is_found(found, law_of, force: Force, formula: str, words: str) -> None:  # type: ignore[no-untyped-def]
    everything, law = found(force), law_of(force)
    assert law is not None
    assert law.formula.split(" · ", 1)[1].endswith(formula)
    assert law.words == words
    assert law.model.held_out_rms < 0.3 * everything.retuned.held_out_rms
    assert law.holds
    run, model = everything.case.runs[-1], law.model
    motion = everything.model.motion(run, model.values, extension_of(model.fit.candidates, model.values))
    expected = np.array([force(0.0, x, v) for x, v, _ in motion])
    assert np.sqrt(np.mean((law.force_n(motion) - expected) ** 2)) < 0.05 * expected.std()


def test_the_law_is_saved_as_a_twin_that_simulates(found, law_of, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    everything, law = found(damped_with_displacement), law_of(damped_with_displacement)
    assert law is not None
    everything.model.save_extended(law.model.values, law.model.fit.candidates, tmp_path / "extended.toml")
    twin = load_twin(tmp_path / "extended.toml")
    assert [term.name for term in twin.terms] == ["sum_of_products"]
    fast = twin.simulate(free(2.0, 1000.0), initial_displacement_m=0.018).displacement_m
    slow = twin.with_term(twin.terms[0].changed()).simulate(free(2.0, 1000.0), initial_displacement_m=0.018)
    # x² v takes (dA/dt = −c A³/8 m): with both forces it goes faster
    assert np.abs(slow.displacement_m[-300:]).max() < 0.9 * np.abs(fast[-300:]).max()
    rate = 3e4 * 0.018**2 / (8 * 2.241)
    assert np.abs(fast[-300:]).max() < 0.018 / np.sqrt(1 + 2 * rate * 1.7) * 1.05


@pytest.mark.slow
def test_the_verdict_says_the_law_also_where_its_place_is_not_located(found) -> None:  # type: ignore[no-untyped-def]
    everything = found(damped_with_displacement)
    verdict = verdict_of(everything)
    assert (verdict.kind, verdict.block) == ("unknown", "")
    for text in (verdict.headline, verdict.statement):
        assert "f = −3·10⁴ N s m⁻³ · x² · v, a damping that depends on the displacement" in text
    assert "refuted" not in verdict.statement
    assert verdict.has_law
    assert verdict.model is verdict.law.model
    facts = verdict_facts(everything, verdict)
    assert facts["law"]["holds"]
    assert facts["effects"][0]["name"] == "unknown"
    assert facts["fit"]["heldout_after"] == facts["fit"]["heldout_ceiling"] < 1.0


def test_where_nothing_is_missing_there_is_no_law(found) -> None:  # type: ignore[no-untyped-def]
    everything = found(lambda t, x, v: 0.0)
    assert found_law(everything, "structure") is None
    assert found_law(everything, "sensor") is None


def test_a_search_that_ended_at_its_budget_has_no_law(found, law_of) -> None:  # type: ignore[no-untyped-def]
    """What lacks may have a name that was not reached."""
    complete = found(damped_with_displacement)
    assert law_of(damped_with_displacement) is not None
    assert found_law(replace(complete, failed={**complete.failed, SEARCH: "ended"}), "structure") is None


def test_a_library_holds_nothing_linear_and_nothing_twice() -> None:
    for block in ("structure", "tank"):
        products = library(block)
        assert len(set(products)) == len(products)
        assert Product() not in products
        assert Product(velocity=Factor(1, True)) not in products
    assert Product(Factor(1, True)) not in library("structure")
    assert Product(acceleration=Factor(1, True)) not in library("tank")

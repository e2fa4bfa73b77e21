"""The registry that vocabularies stand in: order, lazy entries, other packages, messages."""

from __future__ import annotations

import importlib.metadata
import sys
from typing import Annotated, Literal

import pytest
from pydantic import BaseModel, ValidationError

from sloshlab.errors import InputError
from sloshlab.registry import Registry, loaded, one_of


def registry() -> Registry[object]:
    shapes: Registry[object] = Registry("shape")
    shapes.declare("lazy", "wave:Error")
    shapes.add("round", 1)
    shapes.register("square")(2)
    return shapes


def test_names_stand_in_the_order_in_which_they_came() -> None:
    assert registry().names == ("lazy", "round", "square")


def test_a_declared_entry_is_imported_when_it_is_asked_for_and_not_before(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "wave", raising=False)
    shapes = registry()
    assert "lazy" in shapes
    assert shapes.names
    assert "wave" not in sys.modules
    assert shapes["lazy"] is loaded("wave:Error")


def test_an_unknown_name_is_refused_with_all_that_are_allowed() -> None:
    with pytest.raises(InputError, match=r"shape: got 'oval'; allowed: lazy, round, square"):
        registry()["oval"]


def test_an_entry_that_was_withdrawn_is_unknown() -> None:
    shapes = registry()
    shapes.withdraw("round")
    assert "round" not in shapes
    assert shapes.names == ("lazy", "square")


def test_entry_points_of_other_packages_are_known_by_name_and_loaded_late(monkeypatch: pytest.MonkeyPatch) -> None:
    point = importlib.metadata.EntryPoint("far", "fractions:Fraction", "tests.shapes")
    monkeypatch.setattr(
        importlib.metadata, "entry_points", lambda group: [point] if group == "tests.shapes" else []
    )
    shapes: Registry[object] = Registry("shape", group="tests.shapes")
    shapes.add("near", 1)
    assert shapes.names == ("near", "far")
    assert shapes["far"] is loaded("fractions:Fraction")


AOrB = Annotated[str, one_of(lambda: ("a", "b"))]


class Derived(BaseModel):
    name: AOrB


class Written(BaseModel):
    name: Literal["a", "b"]


def refusal(model: type[BaseModel], value: object) -> tuple[str, str]:
    with pytest.raises(ValidationError) as refused:
        model(name=value)
    [error] = refused.value.errors()
    return error["type"], error["msg"]


@pytest.mark.parametrize("value", ["c", 1, None, ["a"]])
def test_a_wrong_name_is_refused_in_the_words_of_a_literal(value: object) -> None:
    assert refusal(Derived, value) == refusal(Written, value)
    assert Derived(name="b").name == "b"


SHAPES = registry()


class Shape(BaseModel):
    name: Annotated[str, one_of(lambda: SHAPES.names)]


def test_a_name_that_is_added_later_is_taken() -> None:
    assert refusal(Shape, "oval")
    SHAPES.add("oval", 3)
    assert Shape(name="oval").name == "oval"

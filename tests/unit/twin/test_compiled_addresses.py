"""Addresses of compiled functions: one per function and types of its arguments, whatever these hold."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest

from sloshlab.twin.compiled import address_of, called


class Pair(NamedTuple):
    """As the loops take their arrays."""

    one: Any
    other: Any


@called
def first_of(pair: Any) -> float:
    """The first number of a pair of arrays."""
    return pair.one.flat[0]  # type: ignore[no-any-return]


@called
def last_of(pair: Any) -> float:
    """The first number of the other one."""
    return pair.other.flat[0]  # type: ignore[no-any-return]


def test_one_address_serves_all_arrays_of_a_type() -> None:
    assert address_of(first_of, Pair(np.zeros(3), np.zeros(2))) == address_of(
        first_of, Pair(np.ones(7), np.zeros(1))
    )


@pytest.mark.parametrize(
    "other",
    [
        Pair(np.zeros((3, 1)), np.zeros(2)),
        Pair(np.zeros(3, np.int64), np.zeros(2)),
        Pair(np.zeros(6)[::2], np.zeros(2)),
        Pair(np.zeros(3), np.zeros((2, 2)).T),
    ],
    ids=["dimensions", "kind of number", "strides", "order of the other"],
)
def test_another_type_has_another_address(other: Pair) -> None:
    assert address_of(first_of, other) != address_of(first_of, Pair(np.zeros(3), np.zeros(2)))


def test_another_function_has_another_address() -> None:
    pair = Pair(np.zeros(3), np.zeros(2))
    assert address_of(last_of, pair) != address_of(first_of, pair)

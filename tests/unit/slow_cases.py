"""Cases of a parametrised test of which `make test` runs some, and `make test-all` all."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import pytest


def slow_but(quick: Sequence[Any], cases: Iterable[Any]) -> list[Any]:
    """Values for `pytest.mark.parametrize`: all cases, those slow that are not among the quick ones.

    Examples
    --------
    >>> [getattr(case, "values", case) for case in slow_but(["b"], "abc")]
    [('a',), 'b', ('c',)]
    """
    given = list(cases)
    if missing := [case for case in quick if case not in given]:
        raise ValueError(f"no such cases: {missing}")
    return [case if case in quick else pytest.param(case, marks=pytest.mark.slow) for case in given]

"""Halves of a trial, and cases by name."""

from __future__ import annotations

import pytest

from sealed_trial.sealing.selection import Selection, half_of, selection_of
from sloshlab.errors import InputError

CASES = [f"case_{number:03d}" for number in range(1, 61)]


def test_odd_numbers_develop_and_even_ones_judge() -> None:
    odd, even = Selection("odd").of(CASES), Selection("even").of(CASES)
    assert [int(case[5:]) % 2 for case in odd] == [1] * 30
    assert sorted([*odd, *even]) == CASES
    assert half_of("case_1000") == "even"


@pytest.mark.parametrize(
    ("half", "cases", "chosen"),
    [
        (None, None, CASES),
        (None, "7, case_002,7", ["case_002", "case_007"]),
        ("odd", "2,7,9", ["case_007", "case_009"]),
    ],
)
def test_cases_are_chosen_by_name_or_number_within_the_half(half, cases, chosen) -> None:
    assert selection_of(half, cases).of(CASES) == chosen


@pytest.mark.parametrize(
    ("half", "cases", "said"),
    [
        ("both", None, "--half: got both; allowed: odd or even"),
        (None, " , ", "--cases: got nothing"),
        (None, "61", "--cases: got case_061; allowed: case_001 … case_060"),
        (None, "../x", r"--cases: got \.\./x"),
        ("odd", "2", "no case in both"),
    ],
)
def test_what_is_no_case_is_said(half, cases, said: str) -> None:
    with pytest.raises(InputError, match=said):
        selection_of(half, cases).of(CASES)

"""What fails within the one process fails here, and what ends it is tried again outside."""

from __future__ import annotations

import os

import pytest
from one_process import in_one_process

from sloshlab.limited_process import CAN_FORK


def test_a_check_that_fails_in_the_other_process_fails_here() -> None:
    def wrong() -> None:
        raise ValueError("said elsewhere")

    with pytest.raises(RuntimeError if CAN_FORK else ValueError, match="said elsewhere"):
        in_one_process(wrong)


@pytest.mark.skipif(not CAN_FORK, reason="no fork here")
def test_a_check_that_ends_the_other_process_is_made_here() -> None:
    here, made = os.getpid(), []

    def crashing() -> None:
        made.append(os.getpid())
        if os.getpid() != here:
            os.abort()

    in_one_process(crashing)
    assert made == [here]

"""A diagnosis computes with one thread of BLAS: its workers are as many as there are cores."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from pipelines.diagnosis import diagnose
from pipelines.diagnosis.diagnose import diagnosed, opened_folder
from sloshlab.errors import AnalysisError

CASE = Path(__file__).parents[4] / "raw_data" / "cases" / "friction" / "case"


def threads() -> set[int]:
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}


def test_blas_has_one_thread_while_it_searches_and_its_own_again_after(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seen: list[set[int]] = []

    def searched(*_: Any, **__: Any) -> None:
        seen.append(threads())
        raise AnalysisError("nothing to be searched")

    monkeypatch.setattr(diagnose, "findings_of", searched)
    with threadpool_limits(2, user_api="blas"):
        before = threads()
        with pytest.raises(AnalysisError, match="nothing to be searched"):
            diagnosed(opened_folder(CASE), command="")
        assert threads() == before
    assert seen == [{1}]

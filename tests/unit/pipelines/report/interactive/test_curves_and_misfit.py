"""Charts and maps of misfit as a page carries them."""

from __future__ import annotations

import numpy as np
import pytest
from page_contents import numbers
from touchable_page import charts, misfit_map

from pipelines.report.interactive.misfit_map import MissedChannel


def test_a_chart_keeps_points_and_breaks_of_lines() -> None:
    content = charts().plain()
    [points, line] = content["charts"][1]["curves"]
    assert (points["points"], line["points"]) == (True, False)
    np.testing.assert_allclose(numbers(points["y"]), [3.0, 6.0, 9.0], rtol=1e-4)
    np.testing.assert_allclose(numbers(line["y"]), [0.0, np.nan, 12.0], rtol=1e-4)


def test_a_misfit_is_carried_band_by_band_with_its_worst_stretches_first() -> None:
    content = misfit_map().plain()
    channel = content["runs"][0]["channels"][0]
    assert (channel["start"], channel["interval"], channel["band"], channel["blocks"]) == (0.0, 0.5, 1.0, 4)
    assert channel["stretches"] == [2, 3, 1, 0]
    by_band = numbers(channel["models"][0]).reshape(3, 4)
    np.testing.assert_allclose(by_band[0], np.log10([11.0, 21.0, 81.0, 41.0]), atol=1e-4)
    np.testing.assert_allclose(by_band[2], 0.0, atol=1e-12)
    assert content["high"] == pytest.approx(np.log10(81.0))


def test_blocks_of_a_long_run_are_merged_and_none_is_lost() -> None:
    n = 700
    misfit = np.zeros((n, 20))
    misfit[611, 3] = 99.0
    channel = MissedChannel("force", 0.25 + 0.5 * np.arange(n), np.arange(20) + 0.5, (misfit,)).plain()
    # 14 000 cells, of which 6 000 may be drawn: three blocks in one
    assert channel["blocks"] == 234
    assert channel["interval"] == pytest.approx(1.5)
    assert channel["stretches"] == [203]
    by_band = numbers(channel["models"][0]).reshape(20, 234)
    assert by_band[3, 203] == pytest.approx(2.0, abs=1e-4)
    # 611 is within 609 … 611
    assert channel["start"] + 203 * channel["interval"] == pytest.approx(609 * 0.5)

"""Sweeps in Python: what is drawn lies on the axes that are given, and says what the windows say."""

from __future__ import annotations

from collections.abc import Iterator

import matplotlib
import numpy as np
import pytest
import xarray as xr
from matplotlib import pyplot
from matplotlib.figure import Figure

from acquisition.virtual_laboratory.campaign import rig_text
from acquisition.virtual_laboratory.shaker_run import virtual_shaker_run
from pipelines.interface.sweep import SweepAnalysis, analyse_sweep
from sloshlab.errors import AnalysisError, InputError
from sloshlab.rig import Rig

RIG = Rig.from_toml_text(rig_text(0.5))
RATE_HZ = 1024.0


def sweep(acceleration_g: float) -> xr.Dataset:
    return virtual_shaker_run(
        RIG, acceleration_g=acceleration_g, seed=1, duration_s=24.0, sampling_rate_hz=RATE_HZ
    )


@pytest.fixture(scope="module")
def analysis() -> SweepAnalysis:
    return analyse_sweep([sweep(1.5), sweep(3.0)], RIG)


@pytest.fixture(autouse=True)
def no_window() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(matplotlib.rcParams, "backend", "agg")
        yield


@pytest.mark.parametrize("quantity", ["", "w_bar", "beta", "w_bar_over_v_bar", "work_j"])
def test_a_map_is_drawn_on_the_given_axes(analysis: SweepAnalysis, quantity: str) -> None:
    left, right = Figure().subplots(1, 2)
    assert analysis.plot.map(quantity, ax=right) is right
    assert right.get_xlabel() == ("displacement amplitude u₀ [mm]" if quantity == "work_j" else {
        "w_bar_over_v_bar": "v̄ = Ω u₀/√(g h)"}.get(quantity, "ū = u₀/h"))  # fmt: skip
    # two runs as dots, at the amplitudes of the windows over the height of the tank
    dots = [line for line in right.lines if line.get_marker() == "."]
    assert len(dots) == 2
    if quantity in ("", "w_bar", "beta"):
        drawn = np.concatenate([line.get_xdata() for line in dots])
        # a₀/Ω² of the mean frequency is u₀ but for the sweep within the window
        np.testing.assert_allclose(drawn, analysis.windows["amplitude_m"] / 0.0272, rtol=6e-3)
    assert not left.lines
    assert not left.collections
    assert pyplot.get_fignums() == []


def areas_of_periods(axes: pyplot.Axes) -> list[float]:
    """Enclosed areas, counter-clockwise positive, of the closed polygons of all lines that are whole periods."""
    areas = []
    for line in axes.lines[1:-1]:
        x, y = (np.append(values, values[0]) for values in (line.get_xdata(), line.get_ydata()))
        areas.append(0.5 * float(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1])))
    return areas


@pytest.mark.parametrize("share", [0.3, 0.6])
def test_the_loop_encloses_the_work_of_the_window(analysis: SweepAnalysis, share: float) -> None:
    """∮ F_S/(m_l a₀) d(u/u₀) over one period is W/(m_l a₀ u₀) = W̄; polygons of 1024 Hz lose up to 3 %."""
    windows = analysis.windows
    at = int(share * windows.sizes["window"])
    axes = Figure().subplots()
    assert analysis.plot.loop(at, ax=axes) is axes
    w_bar = float(windows["w_bar"][at])
    assert np.median(areas_of_periods(axes)) == pytest.approx(w_bar, rel=0.06)
    assert f"{float(windows['frequency_hz'][at]):.3g} Hz" in axes.get_title()
    same = Figure().subplots()
    analysis.plot.loop(windows.isel(window=at), ax=same)
    np.testing.assert_array_equal(same.lines[3].get_ydata(), axes.lines[3].get_ydata())


def test_the_last_windows_are_those_of_the_last_run(analysis: SweepAnalysis) -> None:
    axes = Figure().subplots()
    analysis.plot.loop(-1, ax=axes)
    assert f"{float(analysis.windows['frequency_hz'][-1]):.3g} Hz" in axes.get_title()


def test_what_is_not_there_is_one_line(analysis: SweepAnalysis) -> None:
    with pytest.raises(InputError, match=r"map: got 'gamma'; allowed: w_bar, beta"):
        analysis.plot.map("gamma")
    with pytest.raises(InputError, match=r"rig of the map: got 0.75; allowed: rig \(0.5\)"):
        analysis.plot.map(rig=0.75)
    n_windows = analysis.windows.sizes["window"]
    with pytest.raises(InputError, match=rf"window: got {n_windows}; allowed: 0 … {n_windows - 1}"):
        analysis.plot.loop(n_windows)
    with pytest.raises(InputError, match="none of these windows"):
        analysis.plot.loop(analysis.maps)
    with pytest.raises(InputError, match=r"rig: got none; allowed: rig=, or force= and one motion"):
        analyse_sweep([sweep(1.0)])
    forgotten = analyse_sweep([sweep(3.0)], RIG, keep_signals=False)
    with pytest.raises(AnalysisError, match=r"loop: got no signals; allowed: .*keep_signals=True"):
        forgotten.plot.loop(0)


def test_a_structure_without_a_tank_has_its_own_map_and_loop() -> None:
    channels = {"force": "force_cell_1", "acceleration": "acceleration_roof_1"}
    work = analyse_sweep([sweep(1.5), sweep(3.0)], **channels)
    left, right = Figure().subplots(1, 2)
    work.plot.map(ax=left)
    work.plot.loop(10, ax=right)
    assert (right.get_xlabel(), right.get_ylabel()) == ("displacement u [mm]", "force F [N]")
    # displacement of the window's amplitude, in millimetres
    reached = max(float(np.max(line.get_xdata())) for line in right.lines)
    assert reached == pytest.approx(1e3 * float(work.windows["amplitude_m"][10]), rel=0.05)


def test_data_sets_stay_as_they_are() -> None:
    given = sweep(3.0)
    before = given.copy(deep=True)
    analyse_sweep(given, RIG)
    xr.testing.assert_identical(given, before)


def test_the_card_of_a_notebook_escapes_what_comes_from_outside(analysis: SweepAnalysis) -> None:
    hostile = sweep(3.0).assign_attrs(run_id="<script>alert(1)</script>")
    shown = analyse_sweep(hostile, {"<b>.toml": RIG})._repr_html_()
    assert "<script>alert" not in shown
    assert "<b>.toml" not in shown
    assert "Tank on the shaker" in shown


def test_the_tree_has_the_rigs_below_their_names() -> None:
    other = Rig.from_toml_text(rig_text(0.25))
    quarter = virtual_shaker_run(
        other, acceleration_g=3.0, duration_s=24.0, sampling_rate_hz=RATE_HZ, rig_name="quarter.toml", run_id="q"
    )
    half = sweep(3.0).assign_attrs(rig="half.toml")
    found = analyse_sweep([half, quarter], {"half.toml": RIG, "quarter.toml": other})
    tree = found.to_datatree()
    parts = ("windows", "maps")
    below = {f"/{rig}/{part}" for rig in ("half", "quarter") for part in parts}
    assert set(tree.groups) == {"/", "/half", "/quarter", *(f"/{part}" for part in parts), *below}
    assert set(np.unique(tree["quarter/windows"]["fill_level"])) == {0.25}
    assert tree["maps"].sizes["fill_level"] == 2

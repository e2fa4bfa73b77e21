"""Windows of a map: the signals, loops and spectra that a page carries, against closed forms."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from synthetic_experiment import excerpt, shaker_experiment, work_experiment

from pipelines.sweep.results import RunResult, SweepExperiment
from pipelines.sweep.selection import runs_of
from pipelines.sweep.touchable_maps import scaled_window_map, thinned, work_window_map
from pipelines.sweep.window_signals import Excerpt, amplitude_spectrum, window_signals


def with_signals(run: RunResult, mass_kg: float) -> RunResult:
    """The run with a force in every window that lags its displacement by 0.6 rad."""
    of = run.windows
    signals = [
        window_signals(excerpt(float(of["frequency_hz"][at]), float(of["acceleration_g"][at]), mass_kg))
        for at in range(of.sizes["window"])
    ]
    return dataclasses.replace(run, window_signals=tuple(signals))


@pytest.fixture(scope="module")
def experiment() -> SweepExperiment:
    whole = shaker_experiment()
    mass_kg = whole.rigs[0].rig.liquid_mass_kg
    return dataclasses.replace(whole, runs=tuple(with_signals(run, mass_kg) for run in whole.runs))


def test_a_line_of_the_spectrum_is_the_amplitude_of_the_force() -> None:
    time = np.arange(2400) / 1000.0
    # orders 1 and 3 of 5 Hz, whole numbers of periods
    force = 2.0 * np.sin(2 * np.pi * 5 * time + 0.3) + 0.5 * np.cos(2 * np.pi * 15 * time)
    order, amplitude = amplitude_spectrum(Excerpt(5.0, 1.0, time, force, force))
    assert order[-1] <= 8.0
    assert amplitude[np.isclose(order, 1.0)] == pytest.approx(2.0, rel=1e-3)
    assert amplitude[np.isclose(order, 3.0)] == pytest.approx(0.5, rel=1e-3)
    assert amplitude[np.isclose(order, 2.0)] == pytest.approx(0.0, abs=1e-3)


def test_a_window_of_lost_samples_has_no_spectrum_and_one_gap_is_bridged() -> None:
    time = np.arange(1200) / 1000.0
    force = np.sin(2 * np.pi * 5 * time)
    lost = Excerpt(5.0, 1.0, time, np.full(1200, np.nan), force)
    assert amplitude_spectrum(lost)[0].size == 0
    assert window_signals(lost).time_s.size > 0
    force[600:603] = np.nan
    order, amplitude = amplitude_spectrum(Excerpt(5.0, 1.0, time, force, time))
    assert amplitude[np.isclose(order, 1.0)] == pytest.approx(1.0, rel=1e-2)


def test_a_blow_is_kept_where_samples_are_many() -> None:
    time = np.arange(20_000) / 20_000.0
    force = np.sin(2 * np.pi * 12 * time)
    force[12_345] = 9.0
    kept = window_signals(Excerpt(12.0, 1.0, time, force, np.cos(2 * np.pi * 12 * time)))
    assert kept.time_s.size < 660
    assert kept.force_n.max() == 9.0


def test_loops_are_over_the_inertia_of_the_liquid_and_the_amplitude(experiment: SweepExperiment) -> None:
    rig = experiment.rigs[0]
    runs = runs_of(experiment, rig)
    shown = scaled_window_map(rig, runs)
    assert shown is not None
    assert len(shown.windows) == shown.x.size == sum(run.windows.sizes["window"] for run in runs)
    for window in shown.windows[::7]:
        # F = m_l a₀ sin(ωt − 0.6), u = u₀ sin ωt; sampled fifty times a period
        assert np.abs(window.force).max() == pytest.approx(1.0, rel=5e-3)
        assert np.abs(window.displacement).max() == pytest.approx(1.0, rel=5e-3)
        np.testing.assert_allclose(window.force**2 + window.displacement**2
                                   - 2 * window.force * window.displacement * np.cos(0.6),
                                   np.sin(0.6) ** 2, atol=1e-9)  # fmt: skip
    words = shown.windows[shown.first].words
    largest = max(float(run.windows["w_bar"].max()) for run in runs)
    assert shown.quantities[0].values[shown.first] == pytest.approx(largest)
    assert "Hz" in words


def test_of_many_windows_few_are_chosen_evenly_and_the_largest_among_them(experiment: SweepExperiment) -> None:
    rig = experiment.rigs[0]
    runs = runs_of(experiment, rig)
    whole = scaled_window_map(rig, runs)
    few = scaled_window_map(rig, runs, n_maps=20)
    assert whole is not None
    assert few is not None
    assert len(few.windows) in (10, 11)
    assert few.x.size + few.others_x.size == whole.x.size
    assert few.quantities[0].values[few.first] == whole.quantities[0].values[whole.first]
    assert thinned([], 5, "w_bar") == ([], [])


def test_without_signals_or_a_tank() -> None:
    whole = shaker_experiment()
    assert scaled_window_map(whole.rigs[0], runs_of(whole, whole.rigs[0])) is None
    work = work_experiment()
    assert work.work_maps is not None
    assert work_window_map(work.work_maps, work.runs) is None
    shown = work_window_map(work.work_maps, [with_signals(run, 1.0) for run in work.runs])
    assert shown is not None
    everything = np.concatenate([run.windows["frequency_hz"].values for run in work.runs])
    np.testing.assert_array_equal(np.sort(np.concatenate([shown.y, shown.others_y])), np.sort(everything))
    # u₀ = a₀/Ω² in the unit of the axis, millimetres
    largest = max(float(run.windows["amplitude_m"].max()) for run in work.runs)
    assert max(shown.x.max(), shown.others_x.max()) == pytest.approx(1e3 * largest, rel=1e-6)

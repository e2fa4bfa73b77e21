"""Which cycles go into which window: P and M as in (1.15)."""

from __future__ import annotations

import numpy as np
import pytest

from sloshlab.rig import Liquid, Rig, Tank
from sloshlab.sweep.cycles import Cycles
from sloshlab.sweep.windows import WindowSettings, evaluate_windows, window_slices

TANK = Rig(
    tank=Tank(height_m=0.0272, length_m=0.1172, width_m=0.078, dry_mass_kg=0.61),
    liquid=Liquid(density_kg_per_m3=1000.0, fill_level=0.5),
)


def cycles_of(frequency_hz, *, usable=None, work_j=None, speed=1.0) -> Cycles:
    """Cycles of given frequencies, one after the other, with a viscous force of 2 N s/m."""
    frequency = np.asarray(frequency_hz, float)
    edges = np.concatenate([[0.0], np.cumsum(1 / frequency)])
    n = frequency.size
    velocity = np.full(n, -1j * speed)
    acceleration = np.zeros((n, 5), complex)
    acceleration[:, 0] = 2 * np.pi * frequency * speed
    force = np.zeros((n, 5), complex)
    force[:, 0] = 2.0 * velocity
    work = 0.5 * 2.0 * speed**2 / frequency if work_j is None else np.asarray(work_j, float)
    return Cycles(
        start_s=edges[:-1],
        stop_s=edges[1:],
        usable=np.ones(n, bool) if usable is None else np.asarray(usable),
        work_j=work,
        force_phasor=force,
        acceleration_phasor=acceleration,
        velocity_phasor=velocity,
        subharmonic_phasor=np.zeros((n, 2), complex),
        dynamic_mean=np.zeros(n),
        dynamic_square=np.full(n, 2.0),
        dynamic_highest=np.full(n, 2.0),
        dynamic_lowest=np.full(n, -2.0),
        inertia_kg=0.0,
    )


@pytest.mark.parametrize(
    ("n_cycles", "p", "m", "expected"),
    [
        (68, 6, 24, [(4, 16), (28, 40), (52, 64)]),
        (67, 6, 24, [(4, 16), (28, 40)]),
        (20, 6, 24, [(4, 16)]),
        (28, 2, 4, [(4, 8), (8, 12), (12, 16), (16, 20), (20, 24)]),
        (18, 2, 1, [(i, i + 4) for i in range(4, 11)]),
        (16, 6, 24, [(4, 12)]),
        (10, 6, 24, []),
    ],
)
def test_windows_of_2p_cycles_whose_centres_are_m_apart(n_cycles, p, m, expected):
    """Four cycles at both ends are left out: the phase is smoothed there and the shaker starts and stops."""
    slices = list(window_slices(cycles_of(np.linspace(9, 10, n_cycles)), WindowSettings(p, m)))
    assert [(window.start, window.stop) for window in slices] == expected


def test_no_window_crosses_a_step():
    cycles = cycles_of(np.repeat([5.0, 8.0, 11.0], 40))
    slices = list(window_slices(cycles, WindowSettings(6, 12)))
    assert slices
    for window in slices:
        # no cycle of another step, and none within four cycles of a step
        step = window.start // 40
        assert (window.stop - 1) // 40 == step
        assert window.start - 40 * step >= 4
        assert 40 * (step + 1) - window.stop >= 4
    assert {window.start // 40 for window in slices} == {0, 1, 2}


def test_means_and_scatter_are_those_of_the_cycles():
    frequency = np.full(32, 10.0)
    work = np.tile([1.0, 3.0], 16)
    windows = evaluate_windows(
        cycles_of(frequency, work_j=work), run_id="a", law=None, settings=WindowSettings(6, 12)
    )
    np.testing.assert_allclose(windows.work_j, 2.0)
    np.testing.assert_allclose(windows.work_j_std, np.sqrt(12 / 11))
    np.testing.assert_allclose(windows.frequency_hz, 10.0)
    np.testing.assert_allclose(windows.time_s, [1.0, 2.2])
    np.testing.assert_allclose(windows.amplitude_m, 1.0 / (2 * np.pi * 10.0))
    np.testing.assert_allclose(windows.acceleration_g, 2 * np.pi * 10.0 / 9.81)
    np.testing.assert_allclose(windows.gamma_kg_per_s, 2.0)
    # πγΩu₀² with γ = 2, Ωu₀ = 1 and Ω = 2π·10: 1/10 J
    np.testing.assert_allclose(windows.work_harmonic_j, 0.1)
    assert windows.run.values.tolist() == ["a", "a"]
    assert np.isnan(windows.phase_error_rad).all()


def test_unusable_cycles_are_left_out_and_counted():
    usable = np.ones(32, bool)
    usable[7:10] = False
    work = np.where(usable, 1.0, 99.0)
    windows = evaluate_windows(
        cycles_of(np.full(32, 10.0), usable=usable, work_j=work),
        run_id="a",
        law=None,
        settings=WindowSettings(6, 12),
    )
    assert windows.n_cycles.values.tolist() == [9, 12]
    np.testing.assert_allclose(windows.work_j, 1.0)


def test_a_window_with_too_few_cycles_is_left_out():
    usable = np.ones(32, bool)
    usable[6:16] = False
    windows = evaluate_windows(
        cycles_of(np.full(32, 10.0), usable=usable), run_id="a", law=None, settings=WindowSettings(6, 12)
    )
    assert windows.n_cycles.values.tolist() == [12]


@pytest.mark.parametrize("rig", [None, TANK], ids=["force and motion", "tank"])
def test_no_cycles_give_an_empty_table_with_all_columns(rig):
    empty = evaluate_windows(cycles_of(np.full(2, 10.0)), run_id="a", law=None, rig=rig)
    full = evaluate_windows(cycles_of(np.full(40, 10.0)), run_id="a", law=None, rig=rig)
    assert empty.sizes["window"] == 0
    assert list(empty.variables) == list(full.variables)
    assert dict(empty.dtypes) == dict(full.dtypes)
    assert {name: empty[name].dims for name in empty} == {name: full[name].dims for name in full}

"""What force cells read, by the equation of motion of the tank on them, and what is made of it again."""

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp

from sloshlab.conditioning.cell_resonance import deconvolved, inverse_response, without_cell_resonance
from sloshlab.errors import AnalysisError
from sloshlab.rig import Rig

TANK_KG, CELL_HZ, ZETA, RATE_HZ = 0.314, 120.0, 0.03, 2048.0
K = TANK_KG * (2 * np.pi * CELL_HZ) ** 2
C = 2 * ZETA * np.sqrt(K * TANK_KG)
RIG = """
[tank]
height_m = 0.0272
length_m = 0.1172
width_m = 0.0780
dry_mass_kg = 0.314
cell_frequency_hz = 120.0
cell_damping_ratio = 0.03
[liquid]
density_kg_per_m3 = 1000.0
fill_level = 0.5
"""


def foot(t):
    """Displacement, velocity and acceleration of a foot that is let go from rest at t = 0.25 s."""
    w, s = 2 * np.pi * 10.87, np.maximum(t - 0.25, 0.0)
    a = np.where(t < 0.25, 0.0, 68.0 * np.cos(w * s) * np.exp(-3 * s))
    decay = -3 + 1j * w
    v = 68.0 * (np.exp(decay * s) / decay - 1 / decay).real
    u = 68.0 * (np.exp(decay * s) / decay**2 - 1 / decay**2 - s / decay).real
    return u, v, a


def liquid(t):
    """Force of a liquid: blows of 20 ms, a hundredth of a second apart from each other."""
    blows = sum((-1) ** n * 6.0 * np.exp(-(((t - 0.4 - 0.05 * n) / 0.008) ** 2)) for n in range(12))
    return -0.124 * foot(t)[2] + blows


def reading(times):
    """F = k (u − z) + c (u̇ − ż), the tank's motion z integrated in steps."""

    def moved(t, y):
        u, v, _ = foot(t)
        force = K * (u - y[0]) + C * (v - y[1])
        return [y[1], (force + liquid(t)) / TANK_KG]

    parts, start = [], [0.0, 0.0]
    for first, last in ((0.0, 0.25), (0.25, times[-1])):
        used = times[(times >= first) & (times <= last)]
        at = np.unique(np.append(used, last))
        found = solve_ivp(moved, (first, last), start, t_eval=at, rtol=1e-9, atol=1e-12, method="DOP853")
        start = found.y[:, -1]
        parts.append(found.y[:, np.isin(at, used)] if first == 0.0 else found.y[:, np.isin(at, used[used > 0.25])])
    z, w = np.concatenate(parts, axis=1)
    u, v, _ = foot(times)
    return K * (u - z) + C * (v - w)


def test_a_tone_through_the_cells_is_the_ratio_of_two_amplitudes():
    """|F| / |M ü − F_S| of the oscillator, in the textbook's symbols for r = f/f_c."""
    r = np.array([0.0, 0.3, 1.0, 1.7])
    textbook = np.sqrt((1 + (2 * ZETA * r) ** 2) / ((1 - r**2) ** 2 + (2 * ZETA * r) ** 2))
    assert 1 / np.abs(inverse_response(r * CELL_HZ, CELL_HZ, ZETA)) == pytest.approx(textbook, rel=1e-12)


def test_a_release_and_blows_come_back():
    times = np.arange(4096) / RATE_HZ
    cells = reading(times)
    truth = TANK_KG * foot(times)[2] - liquid(times)
    found = deconvolved(cells, RATE_HZ, resonance_hz=CELL_HZ, damping_ratio=ZETA)
    # what no filter can give back: the step of the release itself rings at the highest frequency for some ms
    used = times > 0.25 + 5 / (2 * CELL_HZ)
    size = np.abs(truth).max()
    left, before = (np.sqrt(np.mean((values - truth)[used] ** 2)) for values in (found, cells))
    assert before > 0.05 * size
    assert left < 0.02 * before
    assert np.abs((found - truth)[used]).max() < 0.01 * size
    # the wrong resonance does not
    wrong = deconvolved(cells, RATE_HZ, resonance_hz=0.8 * CELL_HZ, damping_ratio=ZETA)
    assert np.sqrt(np.mean((wrong - truth)[used] ** 2)) > 0.3 * before


def test_slow_forces_and_static_ones_stay():
    times = np.arange(3000) / RATE_HZ
    force = 5.0 + 2.0 * times + 3.0 * np.sin(2 * np.pi * 3.0 * times)
    found = deconvolved(force, RATE_HZ, resonance_hz=CELL_HZ, damping_ratio=0.0)
    # 1 − (3/120)² of the tone
    assert found == pytest.approx(force - (3 / 120) ** 2 * 3.0 * np.sin(2 * np.pi * 3.0 * times), abs=3e-3)


def test_a_recording_and_what_is_refused():
    times = np.arange(2048) / RATE_HZ
    force, attributes = np.sin(2 * np.pi * 60 * times), {"units": "N", "quantity": "force"}
    run = xr.Dataset({"force_interface": ("time", force, attributes)}, coords={"time": times})
    rig = Rig.from_toml_text(RIG)
    found = without_cell_resonance(run, rig)["force_interface"]
    assert found.attrs["cell_resonance_removed_hz"] == 120.0
    # half the resonance: 1 − 1/4, the damping aside
    assert np.ptp(found.values[500:1500]) / 2 == pytest.approx(0.75, rel=0.01)
    stiff = Rig.from_toml_text(RIG.replace("cell_frequency_hz = 120.0\ncell_damping_ratio = 0.03\n", ""))
    assert without_cell_resonance(run, stiff) is run
    with pytest.raises(AnalysisError, match="1 lost samples"):
        deconvolved(np.append(force, np.nan), RATE_HZ, resonance_hz=CELL_HZ, damping_ratio=ZETA)
    with pytest.raises(AnalysisError, match="do not ring"):
        deconvolved(force, RATE_HZ, resonance_hz=900.0, damping_ratio=ZETA)

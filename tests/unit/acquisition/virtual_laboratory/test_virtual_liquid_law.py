"""The virtual liquid's law obeys the published facts about the measured maps (thesis ch. 1, App. E)."""

import math

import numpy as np
import pytest

from acquisition.virtual_laboratory.liquid_law import (
    FILL_LEVEL_RANGE,
    LAWS,
    amplitude_shape_from_means,
    dissipated_work,
    effective_mass,
    liquid_law,
)
from sloshlab.errors import InputError

FREQUENCY_SCALE = 18.991  # sqrt(g/h) as printed
STROKE_U_BAR = 12.5 / 27.2
SIX_G = 6.0


def domain(n=500):
    """The measured plane: 5…20 Hz, 0.25…6 g, stroke limit."""
    omega = np.linspace(2 * np.pi * 5 / FREQUENCY_SCALE, 2 * np.pi * 20 / FREQUENCY_SCALE, n)[:, None]
    u = np.linspace(0.005, STROKE_U_BAR, n)[None, :]
    acceleration = u * omega**2
    return omega, u, acceleration, (acceleration >= 0.25) & (acceleration <= SIX_G)


def most_dissipating(fill_level):
    omega, u, _, inside = domain()
    work = np.where(inside, dissipated_work(omega, u, fill_level), 0.0)
    region = work >= 0.85 * work.max()
    rows, columns = np.nonzero(region)
    return work, omega[rows, 0], u[0, columns], region.sum() / inside.sum()


def test_the_peak_is_1_65_at_3_78_near_4_g():
    omega, u, _, inside = domain(1500)
    work = np.where(inside, dissipated_work(omega, u, 0.5), 0.0)
    row, column = np.unravel_index(work.argmax(), work.shape)
    assert work.max() == pytest.approx(1.65, abs=1e-4)
    assert omega[row, 0] == pytest.approx(3.78, abs=0.01)
    assert u[0, column] * omega[row, 0] ** 2 == pytest.approx(4.0, abs=0.4)
    assert 3 < omega[row, 0] < 5
    assert 0.2 < u[0, column] < 0.4


def test_there_is_only_one_maximum():
    omega, u, _, inside = domain(300)
    for fill_level in LAWS:
        work = np.where(inside, dissipated_work(omega, u, fill_level), 0.0)
        padded = np.pad(work, 1)
        neighbours = [
            padded[1 + i : padded.shape[0] - 1 + i, 1 + j : padded.shape[1] - 1 + j]
            for i in (-1, 0, 1)
            for j in (-1, 0, 1)
            if (i, j) != (0, 0)
        ]
        peaks = np.all([work > other for other in neighbours], axis=0)
        assert peaks.sum() == 1, fill_level


def test_work_is_almost_zero_below_1_g_and_grows_beyond():
    omega, u, acceleration, inside = domain()
    work = dissipated_work(omega, u, 0.5)
    assert work[inside & (acceleration <= 0.5)].max() < 0.001 * 1.65
    assert work[inside & (acceleration <= 1.0)].max() < 0.07 * 1.65
    along = dissipated_work(3.55, np.linspace(1.0, 3.0, 50) / 3.55**2, 0.5)
    assert np.all(np.diff(along) > 0)
    assert along[-1] > 10 * along[0]


def test_work_falls_again_at_higher_acceleration():
    along = dissipated_work(3.78, np.linspace(4.0, 6.0, 50) / 3.78**2, 0.5)
    assert np.all(np.diff(along) < 0)
    assert along[-1] < 0.8 * 1.65


def test_appendix_e_c_rand_is_met():
    assert float(dissipated_work(3.55, 0.162, 0.5)) == pytest.approx(1.38, abs=1e-6)
    damping_kg_per_s = 0.12433 / math.pi * FREQUENCY_SCALE * 3.55 * float(dissipated_work(3.55, 0.162, 0.5))
    assert damping_kg_per_s == pytest.approx(3.686, abs=0.005)


def test_appendix_e_c_1_is_met_by_the_mean_beyond_the_onset():
    u = np.linspace(1.0 / 3.55**2, STROKE_U_BAR, 20001)  # from the 1 g line to the stroke limit (5.8 g)
    work = dissipated_work(3.55, u, 0.5)
    mean = np.trapezoid(work, u) / (u[-1] - u[0])
    assert mean == pytest.approx(1.274, abs=1e-4)
    assert 0.12433 / math.pi * FREQUENCY_SCALE * 3.55 * mean == pytest.approx(3.40, abs=0.005)


def test_the_mean_from_0_25_g_could_not_be_1_274():
    # 0 below 1 g, at most 1.38 until ū = 0.162 and at most 1.65 beyond
    onset, low = 1.0 / 3.55**2, 0.25 / 3.55**2
    at_most = (1.38 * (0.162 - onset) / 2 + 1.65 * (STROKE_U_BAR - 0.162)) / (STROKE_U_BAR - low)
    assert at_most < 1.274


def test_the_committed_shape_is_the_fitted_one():
    stiffness, skew = amplitude_shape_from_means()
    assert LAWS[0.50].amplitude_stiffness == pytest.approx(stiffness, rel=1e-7)
    assert LAWS[0.50].amplitude_skew == pytest.approx(skew, rel=1e-7)


@pytest.mark.parametrize("fill_level", [0.25, 0.50, 0.75])
def test_the_85_percent_isoline_lies_about_u_bar_0_2_to_0_3(fill_level):
    _, omega, u, _ = most_dissipating(fill_level)
    assert 0.2 <= np.median(u) <= 0.3
    assert 0.2 <= u.mean() <= 0.3
    assert u.min() > 0.1
    assert u.max() < 0.42
    assert (omega * omega * u).min() > 1.0


def test_a_lower_fill_moves_the_isoline_to_larger_amplitude():
    centre = {fill: most_dissipating(fill)[2].mean() for fill in (0.25, 0.50, 0.75)}
    assert centre[0.25] > centre[0.50] + 0.02
    assert centre[0.50] > centre[0.75] + 0.02


def test_a_higher_fill_widens_the_region_and_flattens_the_map():
    area = {fill: most_dissipating(fill)[3] for fill in (0.25, 0.50, 0.75)}
    highest = {fill: most_dissipating(fill)[0].max() for fill in (0.25, 0.50, 0.75)}
    assert area[0.25] < area[0.50] < area[0.75]
    assert highest[0.75] < 0.7 * highest[0.50]


@pytest.mark.parametrize("acceleration_g", [1.5, 3.0])
@pytest.mark.parametrize(("frequency_hz", "half_is_largest"), [(9, True), (13, True), (17, False)])
def test_work_in_joule_is_largest_half_full_at_9_and_13_hz_but_not_at_17(
    acceleration_g, frequency_hz, half_is_largest
):
    omega = 2 * np.pi * frequency_hz
    u0 = acceleration_g * 9.81 / omega**2
    work_j = {
        fill: float(dissipated_work(omega / FREQUENCY_SCALE, u0 / 0.0272, fill))
        * (1000 * fill * 0.0272 * 0.1172 * 0.0780)
        * (u0 * omega) ** 2
        for fill in (0.25, 0.50, 0.75)
    }
    assert (max(work_j, key=work_j.get) == 0.50) is half_is_largest


def test_beta_is_negative_everywhere():
    omega, u, _, inside = domain()
    for fill_level in (0.25, 0.50, 0.75):
        beta = effective_mass(omega, u, fill_level)[inside]
        assert beta.max() < -0.05
        assert beta.min() > -1.0


def test_beta_is_minus_0_154_in_the_mean_at_0_25_g():
    omega = 2 * np.pi * np.linspace(5, 20, 4001) / FREQUENCY_SCALE
    assert effective_mass(omega, 0.25 / omega**2, 0.5).mean() == pytest.approx(-0.154, abs=2e-4)


def test_the_law_is_smooth():
    omega, u, _, inside = domain(1000)
    for values in (dissipated_work(omega, u, 0.5), effective_mass(omega, u, 0.5)):
        curvature = np.abs(np.diff(values, 2, axis=1))[:, :][inside[:, 1:-1]]
        coarse = np.abs(values[:, 4::2] - 2 * values[:, 2:-2:2] + values[:, :-4:2])[inside[:, 2:-2:2]]
        assert curvature.max() < 0.3 * coarse.max()  # quartered with the step, as where there are no kinks


def test_between_the_fills_the_law_is_between_and_beyond_refused():
    assert liquid_law(0.5) is LAWS[0.50]
    near = float(dissipated_work(3.78, 0.259, 0.5001))
    assert near == pytest.approx(1.65, abs=2e-3)
    assert liquid_law(0.6).u_bar_peak < liquid_law(0.4).u_bar_peak
    for fill_level in (0.1, 0.9, math.nan):
        with pytest.raises(InputError, match="fill level"):
            liquid_law(fill_level)
    assert FILL_LEVEL_RANGE[0] < 0.25
    assert FILL_LEVEL_RANGE[1] > 0.75


def test_rest_and_bad_points():
    assert dissipated_work(0.0, 0.0, 0.5) == 0.0
    with pytest.raises(InputError, match="≥ 0"):
        dissipated_work(-1.0, 0.2, 0.5)
    with pytest.raises(InputError, match="≥ 0"):
        effective_mass(np.nan, 0.2, 0.5)

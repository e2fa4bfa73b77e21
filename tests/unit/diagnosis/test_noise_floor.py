"""Noise of the accelerometer that drives a simulation, through a resonance, against its closed form."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from recorded_oscillators import DAMPING, MASS_KG, OMEGA, RATE_HZ, rig, run_of

from sloshlab.diagnosis.case import Case, CaseRun
from sloshlab.diagnosis.free_run_problem import FreeRunFit
from sloshlab.diagnosis.noise_floor import _noise_through, weighted_observations
from sloshlab.diagnosis.observations import noise_of_sensor, observations
from sloshlab.diagnosis.rig_model import RigModel

NOISE_M_PER_S2 = 0.1
MORE_DAMPING = 10.0
"""So that the resonance forgets within half a second, and a minute tells its noise."""


def quiet_run(duration_s: float, seed: int = 0, noise: float = NOISE_M_PER_S2) -> CaseRun:
    """A base that stands still and an accelerometer on it that does not know it."""
    still = np.zeros(round(duration_s * RATE_HZ))
    channels = {"acceleration_tip": still, "acceleration_root": still}
    sizes = {"acceleration_root": noise, "acceleration_tip": 1e-3}
    return run_of("quiet", channels, sizes, seed, experiment="other", repeat=seed)


def case_of(folder: Path, *runs: CaseRun) -> Case:
    return Case("case", folder, rig(folder), runs)


def test_noise_of_the_base_comes_through_the_resonance_as_its_closed_form_says(tmp_path: Path) -> None:
    """White noise of density S through |(1 + 2iζr)/(1 − r² + 2iζr)|² has the mean square S π f (1 + 4ζ²)/(4ζ)."""
    run = quiet_run(60.0)
    plain = {"quiet": observations(run, ["acceleration_tip"])}
    fit = FreeRunFit((), {"damping of mode 1": MORE_DAMPING}, 0.0, 0.0)
    [(place, found)] = _noise_through(case_of(tmp_path, run), run, "acceleration_root", plain, fit).items()
    ratio = MORE_DAMPING * DAMPING / (2 * MASS_KG * OMEGA)
    density = 2 * NOISE_M_PER_S2**2 / RATE_HZ
    expected = density * np.pi * OMEGA / (2 * np.pi) * (1 + 4 * ratio**2) / (4 * ratio)
    assert place == ("quiet", "acceleration_tip")
    assert float(found.mean()) == pytest.approx(expected, rel=0.15)
    frequencies, bands = plain["quiet"][0].frequencies_hz, found.mean(axis=0)
    resonance, above = (int(np.argmin(np.abs(frequencies - f))) for f in (OMEGA / (2 * np.pi), 25.0))
    assert bands[resonance] > 0.8 * bands.max() > 20 * bands[above]


def test_a_channel_that_is_left_out_of_the_drive_is_compared_with_another_sensor(tmp_path: Path) -> None:
    run = quiet_run(4.0)
    plain = {"quiet": observations(run, ["acceleration_tip"])}
    without = CaseRun(run.name, run.recording.drop_vars("acceleration_tip"), run.attributes)
    fit = FreeRunFit((), {}, 0.0, 0.0)
    [found] = _noise_through(case_of(tmp_path, run), without, "acceleration_root", plain, fit).values()
    assert found == pytest.approx(np.full(found.shape, NOISE_M_PER_S2**2))


def test_the_floor_of_two_repeats_knows_the_noise_of_the_base(tmp_path: Path) -> None:
    """Two repeats whose noise happens to be the same: their difference is none, the floor is that of the noise."""
    runs = [quiet_run(8.0) for _ in range(2)]
    runs[1] = CaseRun("again", runs[0].recording.assign_attrs(repeat=1), runs[1].attributes)
    case = case_of(tmp_path, *runs)
    found = weighted_observations(case, RigModel(case.rig, tmp_path, case.runs))  # type: ignore[arg-type]
    [one] = found["quiet"]
    least = one.variance[:, np.argmax(one.variance.mean(axis=0))].mean()
    assert least > 10 * 1e-3**2


def test_the_noise_of_a_sensor_is_what_is_stated_or_what_its_high_bands_show() -> None:
    run = quiet_run(20.0)
    assert noise_of_sensor(run, "acceleration_root") == pytest.approx(NOISE_M_PER_S2, rel=0.05)
    del run.recording["acceleration_root"].attrs["noise_std"]
    assert noise_of_sensor(run, "acceleration_root") == pytest.approx(NOISE_M_PER_S2, rel=0.15)

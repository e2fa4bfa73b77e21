"""Noise of several channels together: covariances of draws whose correlation is known, and what whitens them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from recorded_oscillators import DAMPING, MASS_KG, RATE_HZ, STIFFNESS, rig, run_of
from scipy.signal import StateSpace, lsim

from sloshlab.diagnosis.inference.run_noise import run_noise, sums_of_cells
from sloshlab.errors import AnalysisError
from sloshlab.identification.observations import observations
from sloshlab.identification.rig_model import RigModel

SHAPE = (8, 12)


def observed(of_drive: np.ndarray | None, channel: str, variance: float = 1.0) -> Any:
    return SimpleNamespace(
        channel=channel,
        spectra=np.zeros(SHAPE),
        variance=np.full(SHAPE, variance),
        of_drive=of_drive,
        run=SimpleNamespace(
            attributes=SimpleNamespace(sampling_rate_hz=RATE_HZ), recording=SimpleNamespace(sizes={"time": 500})
        ),
    )


class OwnTwin:
    """A twin of a user's own that does not reach its end, so that no transfer can be probed."""

    def motion(self, *request: Any) -> None:
        raise AnalysisError("twin", got="no end")

    def driving(self, run: Any) -> tuple[str, ...]:
        return ()


OWN_TWIN = cast(Any, OwnTwin())


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_what_a_drive_shares_is_the_correlation(share: float) -> None:
    """Noise of the drive has this share of the variance of both channels, with opposite signs."""
    drawn = np.sqrt(share) * np.random.default_rng(1).normal(size=(4000, *SHAPE))
    channels = [observed(drawn, "acceleration_tip"), observed(-2.0 * drawn, "force_interface", variance=4.0)]
    found = run_noise(OWN_TWIN, channels, {})
    covariance = np.linalg.inv(np.swapaxes(found.inverse_root, -1, -2) @ found.inverse_root).mean(axis=(0, 1))
    # Sensors have noise of their own: at most 0.95 of it is shared. 4000 × 96 draws tell the share to 0.3 %.
    np.testing.assert_allclose(covariance, [[1.0, -0.95 * share], [-0.95 * share, 1.0]], atol=0.01)


def test_noise_through_a_narrow_resonance_is_shared_in_its_band_alone() -> None:
    drawn = np.random.default_rng(3).normal(size=(4000, *SHAPE)) * (np.arange(SHAPE[1]) == 5)
    found = run_noise(OWN_TWIN, [observed(drawn, "a"), observed(drawn, "b")], {})
    covariance = np.linalg.inv(np.swapaxes(found.inverse_root, -1, -2) @ found.inverse_root).mean(axis=0)
    np.testing.assert_allclose(covariance[5, 0, 1], 0.95, atol=0.01)
    np.testing.assert_allclose(np.delete(covariance[:, 0, 1], 5), 0.0, atol=1e-12)


def test_whitened_noise_of_the_drive_is_independent() -> None:
    generator = np.random.default_rng(2)
    root = np.linalg.cholesky(np.array([[1.0, 0.95], [0.95, 1.0]]))
    # Draws of exactly the size of the noise: what is left of one channel beside the other is a tenth of it.
    drawn = generator.choice([-1.0, 1.0], size=(40, *SHAPE))
    found = run_noise(OWN_TWIN, [observed(drawn, "a"), observed(drawn, "b")], {})
    x = np.stack([np.einsum("cd,dbk->cbk", root, generator.normal(size=(2, *SHAPE))) for _ in range(2000)])
    white = np.stack([found.whitened(each) for each in x])
    np.testing.assert_allclose(np.einsum("ncbk,ndbk->cd", white, white) / (2000 * 96), np.eye(2), atol=0.02)


def test_an_error_of_a_sensor_shows_along_its_channel() -> None:
    found = run_noise(OWN_TWIN, [observed(None, "a"), observed(None, "b")], {})
    rows, shares = found.places["sensor b"]
    np.testing.assert_allclose(np.abs(rows[0, 0, 0]), [0.0, 1.0])
    np.testing.assert_allclose(shares, 1.0)
    # Of a twin of a user's own a force shows in any way in all channels.
    rows, shares = found.places["structure elsewhere"]
    np.testing.assert_allclose(shares, 0.5)
    np.testing.assert_allclose(rows[0, 0] @ rows[0, 0].T, np.eye(2), atol=1e-12)


@pytest.mark.parametrize("damping", [0.0, 0.5])
def test_what_the_tank_does_not_move_knows_no_chaos_of_its_liquid(tmp_path: Path, damping: float) -> None:
    names = ("acceleration_root", "acceleration_tip", "force_interface")
    time = np.arange(500) / RATE_HZ
    run = run_of("run_1", dict.fromkeys(names, np.sin(40.0 * time)), {}, 0, experiment="other")
    channels = [
        SimpleNamespace(
            run=run,
            channel=name,
            spectra=np.zeros(SHAPE),
            variance=np.ones(SHAPE),
            of_drive=None,
            frequencies_hz=np.linspace(1.0, 24.0, SHAPE[1]),
        )
        for name in names
    ]
    model = RigModel(rig(tmp_path, damping), tmp_path, [run])
    exact = run_noise(model, cast(Any, channels), {}).exactness
    assert exact["sensor acceleration_root"] == 0.01
    for place in ("tank", "structure", "sensor acceleration_tip", "sensor force_interface"):
        assert exact[place] == (0.05 if damping else 0.01)


def test_a_force_shows_beside_a_resonance_as_the_resonance_does(tmp_path: Path) -> None:
    """White force on an oscillator of 6.56 Hz, by SciPy: displacement and acceleration have the ratio 1/ω₀² in the
    bands of 5.5 and 7.6 Hz, too, as there is more of what a window lets through of the resonance.
    """
    generator, n = np.random.default_rng(6), round(1200 * RATE_HZ)
    force = generator.normal(size=n)
    system = StateSpace(
        [[0.0, 1.0], [-STIFFNESS / MASS_KG, -DAMPING / MASS_KG]],
        [[0.0], [1.0 / MASS_KG]],
        [[1.0, 0.0], [-STIFFNESS / MASS_KG, -DAMPING / MASS_KG]],
        [[0.0], [1.0 / MASS_KG]],
    )
    _, y, _ = lsim(system, force, np.arange(n) / RATE_HZ, interp=False)
    channels = {"displacement_tank": y[:, 0], "acceleration_tip": y[:, 1]}
    run = run_of("pushed", channels, {}, 1, initial_displacement_m=1e-3)
    model = RigModel(rig(tmp_path), tmp_path, [run])
    found = [
        replace(each, variance=np.full(each.spectra.shape, float(np.mean(each.spectra**2))))
        for each in observations(run, list(channels))
    ]
    rows, shares = run_noise(model, found, model.believed).places["structure"]
    expected = np.einsum("bkm,bkmc,bkmd->kcd", shares, rows, rows) / rows.shape[0]
    x = np.stack([each.spectra / np.sqrt(each.variance) for each in found])[:, 4:-4]
    for band in (4, 5, 6, 7, 8):
        covariance = x[:, :, band] @ x[:, :, band].T
        np.testing.assert_allclose(expected[band], covariance / np.trace(covariance), atol=0.03)


def test_cells_at_the_ends_are_smaller() -> None:
    values = np.ones((6, 5))
    np.testing.assert_array_equal(sums_of_cells(values), [[16.0, 4.0], [8.0, 2.0]])

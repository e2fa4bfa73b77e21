"""Noise by forces that jump between samples, against jumps that are counted and errors that are drawn."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from recorded_oscillators import MASS_KG, motion, rig, run_of

from sloshlab.diagnosis.inference import sampled_jumps
from sloshlab.diagnosis.inference.sampled_jumps import jumps_of, with_sampled_jumps
from sloshlab.identification.diagnosed_model import Request
from sloshlab.identification.free_run_problem import FreeRunFit
from sloshlab.identification.observations import observations
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics.extension import NOTHING, Extension
from sloshlab.rig import Rig
from sloshlab.twin.structure_forces import COULOMB_FRICTION

FRICTION_N, START_M, DURATION_S = 0.4, 0.02, 6.0
NOISE = {"acceleration_tip": 1e-4, "displacement_tank": 1e-8}
TIP = "acceleration_tip"


def rubbing(folder: Path) -> Rig:
    """The rig of the closed forms, with the friction in its file."""
    rig(folder)
    file = folder / "rig.toml"
    plain = file.read_text(encoding="utf-8")
    file.write_text(plain.replace("[twin]", f"coulomb_force_n = {FRICTION_N}\n[twin]"), encoding="utf-8")
    return Rig.from_toml(file)


def recorded(folder: Path, error_of_a_jump: float) -> tuple[RigModel, np.ndarray]:
    """A decay with friction; after every reversal one sample is off by up to this part of the jump."""
    _, x, v, a = motion(START_M, DURATION_S, friction_n=(FRICTION_N, FRICTION_N))
    turned = np.flatnonzero(np.diff(np.sign(v[1:])) != 0) + 2
    off = np.zeros(a.size)
    jump = 2 * FRICTION_N / MASS_KG
    off[turned] = error_of_a_jump * jump * np.random.default_rng(4).uniform(-1.0, 1.0, turned.size)
    channels = {TIP: a + off, "displacement_tank": x}
    run = run_of("decay", channels, NOISE, 5, configuration="frozen", initial_displacement_m=START_M)
    return RigModel(rubbing(folder), folder, [run]), turned


def test_every_reversal_has_the_power_of_its_jump(tmp_path: Path) -> None:
    """Twice the friction: half its square in two samples. The rest of a constant force is smooth."""
    model, turned = recorded(tmp_path, 0.0)
    [run] = model.runs
    found = jumps_of(model, Request(run, model.believed, NOTHING))
    assert set(found) == {"structure"}
    n_before = int(turned[20])
    assert np.sum(found["structure"][3 : n_before + 1] ** 2) == pytest.approx(
        20.5 * 0.5 * (2 * FRICTION_N) ** 2, rel=0.03
    )
    assert np.count_nonzero(np.abs(found["structure"]) > 1e-9) < 2.2 * turned.size


def test_forces_without_jumps_have_none(tmp_path: Path) -> None:
    model, _ = recorded(tmp_path, 0.0)
    smooth = RigModel(rig(tmp_path), tmp_path, model.runs)
    assert jumps_of(smooth, Request(model.runs[0], smooth.believed, NOTHING)) == {}
    rubbed = Extension(terms=(COULOMB_FRICTION(force_n=FRICTION_N),))
    assert set(jumps_of(smooth, Request(model.runs[0], smooth.believed, rubbed))) == {"structure"}


def test_readings_between_before_and_after_a_jump_are_noise(tmp_path: Path) -> None:
    """A third of the squared jump where any reading between is as likely; the variance is half of it."""
    model, _ = recorded(tmp_path, 1.0)
    [run] = model.runs
    plain = observations(run, model.compared(run))
    fit = FreeRunFit((), model.believed, 0.0, 0.0)
    [noisy] = with_sampled_jumps(model, [plain], [fit])
    for before, after in zip(plain, noisy, strict=True):
        assert (after.variance >= before.variance).all()
        if before.channel == TIP:
            read = model.simulate(run, model.believed, NOTHING)[TIP]
            # Blocks in which it moves, bands above the resonance, where the transfer is that of the mass.
            assert 0.3 < float(np.mean(after.residual(read)[2:8, 20:] ** 2)) < 1.2
            # The quietest bands show some of it already.
            assert np.mean(before.residual(read)[2:8, 20:] ** 2) > 2.0


def test_no_more_of_a_jump_is_believed_than_is_recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A hundred newtons of white jumps beside a smooth decay: no more than it has above a quarter."""
    _, x, _, a = motion(START_M, DURATION_S)
    smooth = run_of("decay", {TIP: a, "displacement_tank": x}, NOISE, 5, initial_displacement_m=START_M)
    other = RigModel(rubbing(tmp_path), tmp_path, [smooth])
    white = 100.0 * np.random.default_rng(6).normal(size=a.size)
    monkeypatch.setattr(sampled_jumps, "jumps_of", lambda model, request: {"structure": white})
    plain = observations(smooth, other.compared(smooth))
    [noisy] = with_sampled_jumps(other, [plain], [FreeRunFit((), other.believed, 0.0, 0.0)])
    for before, after in zip(plain, noisy, strict=True):
        first = before.spectra.shape[1] // 4
        added = (after.variance - before.variance)[:, first:].mean(axis=1)
        assert (added <= 1.001 * np.mean(before.spectra[:, first:] ** 2, axis=1)).all()

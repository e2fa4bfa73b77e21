"""A beam on a base that gives way, against the beam hinged on a rotational spring in closed form."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.signal import lsim

from sloshlab.errors import InputError, RigError
from sloshlab.modal.cantilever import Cantilever, cantilever_modes
from sloshlab.modal.rig_beam import base_participation_kg, rotation_of_beam, shapes_at
from sloshlab.rig import Structure as DescribedStructure
from sloshlab.twin.base_rocking import BaseRocking
from sloshlab.twin.excitation import free, recorded
from sloshlab.twin.storage import load_twin, save_twin
from sloshlab.twin.structure import Structure, modal_structure
from sloshlab.twin.twin import Twin

BEAM = Cantilever(0.74, 0.1, 0.01, 70e9, 2700.0, 0.45)
LINE, EI, LENGTH = BEAM.mass_per_length_kg_per_m, BEAM.bending_stiffness_n_m2, BEAM.length_m


def described(n_modes: int) -> DescribedStructure:
    modes = cantilever_modes(BEAM, n_modes=n_modes)
    return DescribedStructure(
        kind="beam",
        length_m=LENGTH,
        width_m=0.1,
        thickness_m=0.01,
        frequencies_hz=tuple(modes.frequency_hz),
        damping_ratios=(0.004,) * n_modes,
        modal_masses_kg=tuple(modes.modal_mass_kg),
        tip_mode_shape=(1.0,) * n_modes,
    )


def clamped(n_modes: int) -> Structure:
    beam = described(n_modes)
    return modal_structure(
        beam.frequencies_hz,
        beam.damping_ratios,
        beam.modal_masses_kg,
        mode_shape=beam.tip_mode_shape,
        base_participation_kg=base_participation_kg(beam),
    )


def hinged_frequencies_hz(compliance: float, n: int) -> np.ndarray:
    """w(0) = 0, EI w″(0) = w′(0)/c, w″(L) = 0, EI w‴(L) = −M ω² w(L), w of the four beam functions."""
    spring, ratio = LENGTH / (compliance * EI), BEAM.tip_mass_kg / (LINE * LENGTH)

    def determinant(z: float) -> float:
        c, s, ch, sh = np.cos(z), np.sin(z), np.cosh(z), np.sinh(z)
        rows = np.array(
            [
                [1, 0, 1, 0],
                [-z * z, -spring * z, z * z, -spring * z],
                np.array([-c, -s, ch, sh]) / ch,
                np.array([s + ratio * z * c, -c + ratio * z * s, sh + ratio * z * ch, ch + ratio * z * sh]) / ch,
            ]
        )
        return float(np.linalg.det(rows))

    grid = np.linspace(0.2, 10.0, 2000)
    values = [determinant(z) for z in grid]
    roots = [
        brentq(determinant, a, b)
        for a, b, f, g in zip(grid, grid[1:], values, values[1:], strict=False)
        if f * g < 0
    ]
    return np.array(roots[:n]) ** 2 / LENGTH**2 * np.sqrt(EI / LINE) / (2 * np.pi)


@pytest.mark.parametrize("share", [0.02, 0.1, 0.3])
def test_frequencies_are_those_of_the_hinged_beam(share: float) -> None:
    """Ritz frequencies lie above; with three modes by 1e-6 for the first and 3e-3 for the third."""
    structure = clamped(3)
    compliance = share / (structure.static_stiffness_n_per_m * LENGTH**2)
    found = BaseRocking(described(3), compliance).of(structure).frequencies_hz
    exact = hinged_frequencies_hz(compliance, 3)
    excess = found / exact - 1
    assert (excess > -1e-9).all()
    assert (excess < [1e-6, 1e-4, 3e-3]).all()


def test_the_tip_gives_way_by_compliance_times_length_squared() -> None:
    """A static force F at the tip has the moment F l, turns the base by c F l and moves the tip by c F l² more."""
    structure, compliance = clamped(3), 2e-5
    rocked = BaseRocking(described(3), compliance).of(structure)
    more = 1 / rocked.static_stiffness_n_per_m - 1 / structure.static_stiffness_n_per_m
    assert more == pytest.approx(compliance * LENGTH**2, rel=3e-3)


def test_root_moments_of_the_modes_are_those_of_their_curvature() -> None:
    """r_i k_i = EI ψ″(0), the curvature by differences of the shape near the root."""
    structure, rotation = clamped(3), rotation_of_beam(described(3))
    assert rotation is not None
    step = 2e-3
    shapes = cantilever_modes(BEAM, n_modes=3, x_m=np.array([0.0, step, 2 * step, 3 * step])).mode_shape
    curvature = (2 * shapes[0] - 5 * shapes[1] + 4 * shapes[2] - shapes[3]) / step**2
    np.testing.assert_allclose(rotation.of_modes_per_m * structure.stiffnesses_n_per_m, EI * curvature, rtol=3e-3)


def test_no_compliance_changes_nothing() -> None:
    structure = clamped(3)
    rocked = BaseRocking(described(3), 0.0).of(structure)
    for name in ("masses_kg", "stiffnesses_n_per_m", "dampings_kg_per_s", "mode_shape", "base_participation_kg"):
        np.testing.assert_allclose(getattr(rocked, name), getattr(structure, name), rtol=1e-9)
    x = [0.2, 0.5]
    np.testing.assert_allclose(
        rocked.shapes(shapes_at(described(3), x), x), shapes_at(described(3), x), rtol=1e-8, atol=1e-9
    )


def coupled_run(compliance: float, base: np.ndarray, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Tip and mid-span accelerations of clamped modes and a rotation that is a coordinate of its own, by scipy."""
    n = 2
    nodes, weights = np.polynomial.legendre.leggauss(80)
    x = 0.5 * LENGTH * (nodes + 1)
    w = 0.5 * LENGTH * LINE * weights
    modes = cantilever_modes(BEAM, n_modes=n, x_m=x)
    tip = BEAM.tip_mass_kg
    functions = np.column_stack([modes.mode_shape, x])
    at_tip = np.array([1.0, 1.0, LENGTH])
    mass = functions.T @ (w[:, None] * functions) + tip * np.outer(at_tip, at_tip)
    omega = 2 * np.pi * modes.frequency_hz
    stiffness = np.diag([*(modes.modal_mass_kg * omega**2), 1 / compliance])
    damping = np.diag([*(2 * 0.004 * modes.modal_mass_kg * omega), 0.3])  # the fast rocking mode dies out
    drive = w @ functions + tip * at_tip
    inverse, time = np.linalg.inv(mass), np.arange(base.size) / rate
    pushed = np.hstack([-inverse @ stiffness, -inverse @ damping])
    rates = np.vstack([np.eye(3, 6, 3), pushed])
    forced = np.concatenate([np.zeros(3), -inverse @ drive])
    _, accelerations, _ = lsim((rates, forced[:, None], pushed, forced[3:, None]), base, time)
    middle = np.append(cantilever_modes(BEAM, n_modes=n, x_m=np.array([0.4])).mode_shape[0], 0.4)
    return base + accelerations @ at_tip, base + accelerations @ middle


def test_a_rocking_beam_moves_as_one_with_a_rotation_of_its_own() -> None:
    rate = 1000.0
    time = np.arange(1500) / rate
    base = np.sin(np.pi * time / 1.5) ** 2 * (
        np.sin(2 * np.pi * 9.0 * time) + 0.5 * np.sin(2 * np.pi * 23.0 * time)
    )
    compliance = 0.15 / (clamped(2).static_stiffness_n_per_m * LENGTH**2)
    tip, middle = coupled_run(compliance, base, rate)
    structure = BaseRocking(described(2), compliance).of(clamped(2))
    result = Twin(structure).simulate(recorded(rate, acceleration=base), n_substeps=2)
    size = np.sqrt(np.mean(tip**2))
    assert np.sqrt(np.mean((result.acceleration_m_per_s2 - tip) ** 2)) < 0.01 * size
    shape = structure.shapes(shapes_at(described(2), [0.4]), [0.4])[0]
    along = base + result.modes[:, 2] @ shape
    assert np.sqrt(np.mean((along - middle) ** 2)) < 0.01 * np.sqrt(np.mean(middle**2))
    rigid = Twin(clamped(2)).simulate(recorded(rate, acceleration=base), n_substeps=2)
    assert np.sqrt(np.mean((rigid.acceleration_m_per_s2 - tip) ** 2)) > 0.2 * size


def test_a_saved_twin_keeps_its_rotation(tmp_path: Path) -> None:
    structure = BaseRocking(described(2), 2e-5).of(clamped(2))
    save_twin(Twin(structure), tmp_path / "twin.toml")
    read = load_twin(tmp_path / "twin.toml").structure
    assert read is not None
    assert read.rocked is not None
    assert structure.rocked is not None
    np.testing.assert_array_equal(read.rocked.of_clamped, structure.rocked.of_clamped)
    np.testing.assert_array_equal(read.rocked.rotation_rad_per_m, structure.rocked.rotation_rad_per_m)
    first = Twin(structure).simulate(free(0.2, 1000.0), initial_displacement_m=0.01)
    again = load_twin(tmp_path / "twin.toml").simulate(free(0.2, 1000.0), initial_displacement_m=0.01)
    np.testing.assert_array_equal(first.displacement_m, again.displacement_m)


def test_a_damaged_rotation_is_one_clear_line(tmp_path: Path) -> None:
    file = tmp_path / "twin.toml"
    save_twin(Twin(BaseRocking(described(2), 2e-5).of(clamped(2))), file)
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace("rocked_rotation_rad_per_m = [", "rocked_rotation_rad_per_m = [1.0, "), "utf-8")
    with pytest.raises(InputError, match="4 and 2 numbers"):
        load_twin(file)


def test_a_beam_without_dimensions_cannot_rock() -> None:
    beam = DescribedStructure(
        kind="beam", frequencies_hz=(10.0,), damping_ratios=(0.01,), modal_masses_kg=(1.0,), tip_mode_shape=(1.0,)
    )
    with pytest.raises(RigError, match=r"length_m.*give the beam's dimensions"):
        BaseRocking(beam, 1e-5).of(clamped(1))

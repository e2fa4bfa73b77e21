"""The beam of a rig file: tip mass, participation, shapes, and masses that it does not have."""

from __future__ import annotations

import numpy as np
import pytest

from sloshlab.errors import RigError
from sloshlab.modal.cantilever import cantilever_modes
from sloshlab.modal.rig_beam import base_participation_kg, beam_of_rig, scale_remarks, shapes_at
from sloshlab.rig import Structure

TABLE_2_4 = Structure(
    kind="beam",
    length_m=0.74,
    width_m=0.10,
    thickness_m=0.01,
    frequencies_hz=(10.87, 78.31, 226.5),
    damping_ratios=(0.0032, 0.0090, 0.0176),
    modal_masses_kg=(0.8956, 1.0692, 0.9655),
    tip_mode_shape=(1.0, 1.0, 1.0),
)


def rig_structure(**changes: object) -> Structure:
    return TABLE_2_4.model_copy(update=changes)


def test_participation_of_the_beam_adds_up_to_its_mass() -> None:
    """Σ Γ²/m over all modes is the moving mass, here that of an aluminium beam and its tip mass."""
    many = dict(frequencies_hz=(10.87,) * 10, modal_masses_kg=(0.9,) * 10, tip_mode_shape=(1.0,) * 10)
    beam = beam_of_rig(rig_structure(**many))
    gamma = base_participation_kg(rig_structure(**many))
    assert beam is not None
    assert gamma is not None
    masses = cantilever_modes(beam, n_modes=10).modal_mass_kg
    effective = np.cumsum(gamma**2 / masses)
    total = 2700 * 0.74 * 0.001 + beam.tip_mass_kg
    assert (np.diff(effective) > 0).all()
    assert 0.96 * total < effective[-1] < total


def test_the_tip_mass_of_the_beam_is_that_of_its_first_frequency() -> None:
    """ "About 0.44 kg" meets the first mode of Table 2.4; without such a mass the first modal mass decides."""
    beam = beam_of_rig(rig_structure())
    assert beam is not None
    assert cantilever_modes(beam, n_modes=1).frequency_hz[0] == pytest.approx(10.87, rel=1e-9)
    assert beam.tip_mass_kg == pytest.approx(0.44, rel=0.03)
    stiffer = beam_of_rig(rig_structure(frequencies_hz=(60.0, 78.31, 226.5)))
    assert stiffer is not None
    assert cantilever_modes(stiffer, n_modes=1).modal_mass_kg[0] == pytest.approx(0.8956, rel=1e-9)
    with pytest.raises(RigError, match="aluminium beam of these dimensions"):
        beam_of_rig(rig_structure(frequencies_hz=(60.0, 78.31, 226.5), modal_masses_kg=(0.1, 1.0, 1.0)))


def test_masses_that_a_beam_with_these_tip_values_does_not_have_are_remarked() -> None:
    """Table 2.4 is scaled to the largest deflection; with the tip values of that scale there is no remark."""
    assert [remark[:6] for remark in scale_remarks(rig_structure())] == ["mode 2", "mode 3"]
    assert scale_remarks(rig_structure(tip_mode_shape=(1.0, -0.63, 0.46))) == []


def test_shapes_along_the_beam_are_scaled_to_the_tip_values() -> None:
    shapes = shapes_at(rig_structure(tip_mode_shape=(1.0, -0.5, 2.0)), [0.0, 0.37, 0.74])
    np.testing.assert_allclose(shapes[0], 0.0, atol=1e-12)
    np.testing.assert_allclose(shapes[2], [1.0, -0.5, 2.0], rtol=1e-12)
    assert (np.sign(shapes[1]) == [1.0, 1.0, 1.0]).all()
    with pytest.raises(RigError, match="position along the beam"):
        shapes_at(rig_structure(), [0.8])
    with pytest.raises(RigError, match="length_m"):
        shapes_at(rig_structure(length_m=None), [0.1])

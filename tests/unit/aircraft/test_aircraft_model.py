"""Aircraft models: structure files, tanks on them, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
from hand_made_decks import beam_cards, deck_of_text, fields

from sloshlab.aeroelastic.rational_functions import RationalForces
from sloshlab.aircraft.flight_stability import flight_system
from sloshlab.aircraft.model import AircraftModel, load_model
from sloshlab.aircraft.practical_mean_axes import body_axes_system
from sloshlab.aircraft.structure import AircraftStructure, load_structure, save_structure, structure_of_deck
from sloshlab.errors import InputError
from sloshlab.lateral_sloshing.coupling import coupled_system, rigid_motion

MAEWING1 = Path(__file__).resolve().parents[3] / "raw_data" / "aircraft" / "maewing1"
TANK = """
[[tanks]]
name = "{name}"
node = {node}
offset_m = [0.02, 0.01, -0.05]
length_m = 0.18
width_m = 0.09
height_m = 0.13
fill_level = 0.5
density_kg_per_m3 = 650.0
turn_deg = 20.0
"""


@pytest.fixture
def flying_beam(tmp_path: Path) -> AircraftStructure:
    """A free beam with point masses and surfaces, in millimetre and tonne."""
    cards = [
        *beam_cards(6, kind="CBEAM"),
        fields("CONM2", 90, 3, 0, 0.4, 0.1, 0.0, 0.05, None, 0.02, 0.001, 0.03, 0.0, 0.0, 0.02),
        fields("CAERO1", 100, 1, None, 2, 3, None, None, 1, -0.1, 0.0, 0.0, 0.3, -0.1, 2.0, 0.0, 0.2),
        fields("CAERO1", 200, 1, None, 1, 1, None, None, 1, -0.1, 2.0, 0.0, 0.3, -0.1, 2.0, 1.0, 0.2),
        fields("SPLINE4", 3, 100, 4, None, 5),
        fields("AELIST", 4, 100, "THRU", 105),
        fields("SET1", 5, 1, 3, 7),
        fields("AERO", 0, None, 0.25, 1.2),
        fields("SUPORT", 1, 123456),
    ]
    deck = deck_of_text(tmp_path, *cards)
    return structure_of_deck(deck, length_m=1.0, mass_kg=1.0, n_modes=14, facts={"source": "µ by hand"})


def model_of(folder: Path, structure: AircraftStructure, *tanks: str, more: str = "") -> AircraftModel:
    save_structure(structure, folder / "structure.nc")
    (folder / "model.toml").write_text(f'[aircraft]\nstructure = "structure.nc"\n{more}' + "".join(tanks))
    return load_model(folder / "model.toml")


def test_a_structure_comes_back_as_it_was(flying_beam: AircraftStructure, tmp_path: Path) -> None:
    save_structure(flying_beam, tmp_path / "a.nc")
    back = load_structure(tmp_path / "a.nc")
    for name in ("nodes", "panels", "splines", "facts", "is_free", "reference_chord_m", "density_kg_per_m3"):
        assert getattr(back, name) == getattr(flying_beam, name)
    for name in ("places_m", "frequencies_hz", "modal_masses_kg", "shapes", "mass_centre_m", "rigid_mass"):
        assert np.array_equal(getattr(back, name), getattr(flying_beam, name))
    save_structure(back, tmp_path / "b.nc")
    assert (tmp_path / "a.nc").read_bytes() == (tmp_path / "b.nc").read_bytes()


def test_units_of_the_deck_become_si(flying_beam: AircraftStructure, tmp_path: Path) -> None:
    """The same beam stated in decimetre and tonne: the second stays the second."""
    length, mass = 0.1, 1000.0
    cards = [
        fields("MAT1", 1, 7.0e10 / mass * length, 2.7e10 / mass * length, None, 2700.0 / mass * length**3),
        fields("PBEAM", 1, 1, 2e-4 / length**2, 6.667e-9 / length**4, 1.667e-9 / length**4, None,
               5e-9 / length**4),
        *[fields("GRID", n + 1, None, 0.0, 2.0 * n / 6 / length, 0.0) for n in range(7)],
        *[fields("CBEAM", n + 1, 1, n + 1, n + 2, 0.0, 0.0, 1.0) for n in range(6)],
        fields("CONM2", 90, 3, 0, 0.4 / mass, 1.0, 0.0, 0.5, None,
               *(i / mass / length**2 for i in (0.02, 0.001, 0.03, 0.0, 0.0, 0.02))),
        fields("AERO", 0, None, 2.5, 1.2 / mass * length**3),
        fields("SUPORT", 1, 123456),
    ]  # fmt: skip
    other = structure_of_deck(deck_of_text(tmp_path, *cards), length_m=length, mass_kg=mass, n_modes=14)
    assert other.frequencies_hz == pytest.approx(flying_beam.frequencies_hz, rel=2e-3)
    assert other.rigid_mass == pytest.approx(flying_beam.rigid_mass, rel=1e-3, abs=1e-4)
    assert other.mass_centre_m == pytest.approx(flying_beam.mass_centre_m, rel=1e-4, abs=1e-6)
    assert np.abs(other.shapes[0]) == pytest.approx(np.abs(flying_beam.shapes[0]), rel=1e-2, abs=1e-2)
    assert (other.reference_chord_m, other.density_kg_per_m3) == pytest.approx((0.25, 1.2), rel=1e-3)


def test_frozen_liquid_in_six_directions_on_the_aircraft(flying_beam: AircraftStructure, tmp_path: Path) -> None:
    """Rigid acceleration in each direction: force and moment of body and liquid are those of one solid."""
    model = model_of(tmp_path, flying_beam, TANK.format(name="a", node=5), TANK.format(name="b", node=2))
    found = model.frozen_mass_matrix[:6, :6]
    expected = flying_beam.rigid_mass.copy()
    for node in (5, 2):
        place = flying_beam.places_m[flying_beam.row_of(node)] + [0.02, 0.01, -0.05 - 0.0325]
        mass, box = 650 * 0.18 * 0.09 * 0.065, np.array([0.18, 0.09, 0.065])
        inertia = mass / 12 * np.diag((box**2).sum() - box**2)
        c, s = np.cos(np.radians(20)), np.sin(np.radians(20))
        axes = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        about = np.zeros((6, 6))
        about[:3, :3], about[3:, 3:] = mass * np.eye(3), axes @ inertia @ axes.T
        arm = rigid_motion(place - flying_beam.mass_centre_m)
        expected += arm.T @ about @ arm
    assert found == pytest.approx(expected, rel=1e-10, abs=1e-13)


def test_body_axes_have_the_poles_of_inertial_axes(flying_beam: AircraftStructure, tmp_path: Path) -> None:
    """With sloshing tanks and any forces of the air with lags, without weight; 8 digits of each pole."""
    model = model_of(tmp_path, flying_beam, TANK.format(name="a", node=5), more="damping_ratio = 0.01\n")
    n, speed, density, b = model.structure.mass_matrix.shape[0], 20.0, 1.2, 0.3
    generator = np.random.default_rng(3)
    a0, a1 = (scale * generator.normal(size=(n, n)) for scale in (0.0125, 0.08))
    # air that feels no position of the whole but its tilt, as it does none in flight
    a0[:, :3] = 0.0
    air = RationalForces(
        a0,
        a1,
        0.02 * np.diag(generator.random(n)),
        0.02 * generator.normal(size=(n, 4)),
        np.array([0.1, 0.2, 0.5, 1.1]),
        generator.normal(size=(4, n)),
        b,
    )
    system = flight_system(model, air, "lateral", density_kg_per_m3=density, gravity=False)
    # in inertial axes: (M − A) η̈ … by blocks of the coupled system, lags ȧ = −(U/b) P a + B η̇ beside them
    whole = coupled_system(
        model.structure.mass_matrix,
        model.damping_matrix,
        model.structure.stiffness_matrix,
        tuple(tank.sloshing for tank in model.tanks),
    )
    size, pressure = whole.mass.shape[0], 0.5 * density * speed**2
    padded = [np.pad(matrix, (0, size - n)) for matrix in (air.a0, air.a1, air.a2)]
    output, into = np.pad(air.lag_output, ((0, size - n), (0, 0))), np.pad(air.lag_input, ((0, 0), (0, size - n)))
    expected = np.linalg.eigvals(
        np.block(
            [
                [np.zeros((size, size)), np.eye(size), np.zeros((size, 4))],
                [
                    np.linalg.solve(
                        whole.mass - pressure * (b / speed) ** 2 * padded[2],
                        np.hstack(
                            [
                                pressure * padded[0] - whole.stiffness,
                                pressure * b / speed * padded[1] - whole.damping,
                                pressure * output,
                            ]
                        ),
                    )
                ],
                [np.zeros((4, size)), into, -speed / b * np.diag(air.lags)],
            ]
        )
    )
    found = np.linalg.eigvals(system.matrix_at(speed))
    assert len(system.names) == size
    # three positions play no part, so zero is a multiple pole and no solver finds it exactly
    for pole in expected[np.abs(expected) > 0.1]:
        assert np.abs(found - pole).min() < 1e-8 * np.abs(pole)


def test_a_frozen_aircraft_in_still_air_has_the_modes_of_its_masses(
    flying_beam: AircraftStructure, tmp_path: Path
) -> None:
    """Generalised eigenvalues of the frozen mass matrix; weight left out."""
    model = model_of(tmp_path, flying_beam, TANK.format(name="a", node=5))
    n = model.structure.mass_matrix.shape[0]
    still = RationalForces(*np.zeros((3, n, n)), np.zeros((n, 0)), np.zeros(0), np.zeros((0, n)), 1.0)
    system = flight_system(model, still, "frozen", density_kg_per_m3=1.2, gravity=False)
    found = np.sort(np.linalg.eigvals(system.matrix_at(20.0)).imag)[-model.structure.n_modes :]
    squares = scipy.linalg.eigh(model.structure.stiffness_matrix, model.frozen_mass_matrix, eigvals_only=True)
    assert found == pytest.approx(np.sqrt(squares[-model.structure.n_modes :]), rel=1e-6)
    assert system.names[:7] == ("surge", "sway", "heave", "roll", "pitch", "yaw", "mode 1")


def test_a_tilted_free_aircraft_feels_the_weight_and_the_free_surface(
    flying_beam: AircraftStructure, tmp_path: Path
) -> None:
    tank = TANK.format(name="a", node=4).replace("turn_deg = 20.0", "")
    model = model_of(tmp_path, flying_beam, tank)
    system = body_axes_system(model, 20.0, sloshing=True)
    # static: coordinates of the waves follow the tilt
    [coupling] = system.tanks
    surface = coupling.gravitational @ np.diag(1 / coupling.stiffness_per_s2) @ coupling.gravitational.T
    down = 0.05 + 0.0325 + flying_beam.mass_centre_m[2]
    weight = 650 * 0.18 * 0.09 * 0.065 * 9.81
    pitch = weight * down - 650 * 9.81 * 0.18**3 * 0.09 / 12
    # three modes hold 99.9 % of the free surface
    assert (system.stiffness - surface)[4, 4] == pytest.approx(pitch, rel=2e-3)
    roll = weight * down - 650 * 9.81 * 0.09**3 * 0.18 / 12
    assert (system.stiffness - surface)[3, 3] == pytest.approx(roll, rel=2e-3)
    # a pitch up pulls back: weight of all along −x, forces on the left side of the equation
    whole = (flying_beam.rigid_mass[0, 0]) * 9.81 + weight
    assert system.stiffness[0, 4] == pytest.approx(whole)
    assert system.stiffness[1, 3] == pytest.approx(-whole)


def test_a_tank_at_the_mean_of_nodes_moves_as_they_do(flying_beam: AircraftStructure, tmp_path: Path) -> None:
    several = TANK.format(name="a", node=3).replace("node = 3", "nodes = [2, 4]\nweights = [0.25, 0.75]")
    [tank] = model_of(tmp_path, flying_beam, several).tanks
    [at_2] = model_of(tmp_path, flying_beam, TANK.format(name="a", node=2)).tanks
    # rigid motion of the place, whichever nodes carry it
    place = 0.25 * flying_beam.places_m[1] + 0.75 * flying_beam.places_m[3] + [0.02, 0.01, -0.05]
    assert tank.place_m == pytest.approx(place)
    assert tank.motion[:, :6] == pytest.approx(rigid_motion(place - flying_beam.mass_centre_m))
    assert tank.motion[3:, 6:] == pytest.approx(
        0.25 * flying_beam.shapes[:, 1, 3:].T + 0.75 * flying_beam.shapes[:, 3, 3:].T
    )
    assert at_2.motion[3:, 6:] == pytest.approx(flying_beam.shapes[:, 1, 3:].T)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("fill_level = 0.5", "fill_level = 1.0"), "tanks.0.fill_level: got 1.0"),
        (("node = 3", "node = 77"), "aircraft: node 77: allowed: a node, such as 7"),
        (("node = 3", ""), "a tank needs node, or nodes and weights"),
        (("node = 3", "nodes = [1, 2]\nweights = [1.0, 0.5]"), "weights: one for each of nodes, 1 in all"),
        (("turn_deg", "turn_degrees"), "tanks.0.turn_degrees: got an unknown key"),
        (("length_m = 0.18", 'length_m = "0.18"'), "tanks.0.length_m: got '0.18'"),
        (('"t"', '"t"\n[[tanks]]'), "tanks.0"),
    ],
)
def test_impossible_models_are_one_line(
    change: tuple[str, str], message: str, flying_beam: AircraftStructure, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=message) as caught:
        model_of(tmp_path, flying_beam, TANK.format(name="t", node=3).replace(*change))
    assert "\n" not in str(caught.value)


def test_two_tanks_of_one_name_and_too_many_modes(flying_beam: AircraftStructure, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="the name t twice"):
        model_of(tmp_path, flying_beam, *[TANK.format(name="t", node=3)] * 2)
    with pytest.raises(InputError, match="n_modes: got 99; allowed: ≤ 8"):
        model_of(tmp_path, flying_beam, more="n_modes = 99\n")
    assert model_of(tmp_path, flying_beam, more="n_modes = 3\n").structure.n_modes == 3


def test_a_structure_whose_mass_is_not_positive_is_refused(flying_beam: AircraftStructure) -> None:
    negative = flying_beam.rigid_mass.copy()
    negative[3, 3] = -1.0
    with pytest.raises(InputError, match="aircraft: mass matrix: got a smallest eigenvalue of -1"):
        replace(flying_beam, rigid_mass=negative)
    with pytest.raises(InputError, match="a frequency or modal mass of 0 or less"):
        replace(flying_beam, modal_masses_kg=-flying_beam.modal_masses_kg)


@pytest.mark.parametrize("content", [b"", b"CDF\x02", b"no netCDF at all" * 10])
def test_damaged_structures_are_refused(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "a.nc").write_bytes(content)
    with pytest.raises(InputError, match=r"aircraft structure .*a\.nc"):
        load_structure(tmp_path / "a.nc")
    with pytest.raises(InputError, match="No such file"):
        load_structure(tmp_path / "b.nc")


def test_half_of_a_structure_is_refused(flying_beam: AircraftStructure, tmp_path: Path) -> None:
    save_structure(flying_beam, tmp_path / "a.nc")
    content = (tmp_path / "a.nc").read_bytes()
    for size in (200, len(content) // 2, len(content) - 1000):
        (tmp_path / "a.nc").write_bytes(content[:size])
        with pytest.raises(InputError, match="aircraft structure"):
            load_structure(tmp_path / "a.nc")


def test_maewing1_with_the_tank_of_case_1() -> None:
    """Weight as printed in its authors' output; the liquid is a fifth of it."""
    model = load_model(MAEWING1 / "case_1.toml")
    structure = model.structure
    # 14.73628 lb times PARAM WTMASS, in lbf s²/inch
    assert structure.rigid_mass[0, 0] == pytest.approx(14.73628 * 0.002591 * 175.126835, rel=1e-6)
    assert structure.frequencies_hz[:6] == pytest.approx(
        [6.074476, 8.686970, 10.38866, 12.16186, 19.48424, 23.42714], rel=1e-5
    )
    assert model.liquid_mass_kg == pytest.approx(1.3689)
    assert (len(structure.nodes), sum(panel.n_boxes for panel in structure.panels)) == (126, 2652)
    # frozen liquid lowers the first bending, as its place moves in it
    frozen = np.linalg.eigvals(np.linalg.solve(model.frozen_mass_matrix, structure.stiffness_matrix))
    first = np.sqrt(np.sort(frozen.real)[6]) / (2 * np.pi)
    assert 0.9 * 6.074 < first < 6.074

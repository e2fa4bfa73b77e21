"""Flutter of the mAEWing1 flying wing (v2.1) by the doublet lattice, against MSC Nastran's three flutter points.

Geometry and splines are read from the published decks, modes from the published MAT file; inch, pound and second.
"""

from __future__ import annotations

import functools
import importlib.util
import itertools
import re
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from sloshlab.aeroelastic.generalised_forces import GeneralisedForces, flags_of_reach, generalised_forces
from sloshlab.aeroelastic.modal_structure import ModalStructure, of_modes
from sloshlab.aeroelastic.p_k import p_k_roots
from sloshlab.aeroelastic.planform import Boxes, Trapezoid, boxes_of
from sloshlab.aeroelastic.rational_minimum_state import minimum_state_fit
from sloshlab.aeroelastic.rational_roger import roger_fit
from sloshlab.aeroelastic.root_locus import RootLocus, root_locus
from sloshlab.aeroelastic.splines import spline_motion
from sloshlab.aeroelastic.state_space import system_over_speed

pytestmark = [pytest.mark.external, pytest.mark.slow]

INCH = 0.0254
SEMI_CHORD = 15.744 / 2
DENSITY = 1.1468e-7
K = np.array([0.0, 0.02, 0.05, 0.08, 0.12, 0.17, 0.23, 0.3, 0.38, 0.47, 0.57, 0.68, 0.8, 0.95, 1.2])
N_FLEXIBLE = 10
# sol145_maewing1.f06: speed in knots times VREF in inch/s, frequency in Hz
NASTRAN = ((32.74, 5.10), (37.65, 7.36), (46.02, 10.23))


def number(field: str) -> float:
    """A number of a deck, whose exponent needs no e."""
    return float(re.sub(r"(?<=\d|\.)([+-]\d+)$", r"e\1", field.strip())) if field.strip() else 0.0


def trapezoids(deck: str) -> list[Trapezoid]:
    """Surfaces of CAERO1 cards; those behind the middle wing are cut where the front ones change."""
    found = []
    lines = deck.splitlines()
    for line, following in itertools.pairwise(lines):
        if not line.startswith("CAERO1"):
            continue
        x1, y1, z1, c1, x4, y4, z4, c4 = (number(following[8 * i : 8 * i + 8]) for i in range(1, 9))
        name, ends = line[8:16].strip()[:4], ((x1, y1, z1), (x4, y4, z4))
        n_span, n_chord = divisions(name)
        if name[1] == "4":
            share = (abs(7.63) - abs(y1)) / (abs(y4) - abs(y1))
            cut = tuple((1 - share) * a + share * b for a, b in zip(*ends, strict=True))
            middle = (1 - share) * c1 + share * c4
            found.append(Trapezoid(f"{name} a", (ends[0], cut), (c1, middle), 4, n_chord))
            found.append(Trapezoid(f"{name} b", (cut, ends[1]), (middle, c4), 4, n_chord))
        else:
            found.append(Trapezoid(name, ends, (c1, c4), n_span, n_chord))
    return found


def divisions(name: str) -> tuple[int, int]:
    """Strips across and boxes along the flow of a surface by its number: 1101, 1102, 1201 … 1601; 424 in all."""
    return {
        "101": (3, 6), "102": (3, 6), "201": (2, 6), "301": (12, 6), "401": (8, 4), "501": (4, 6), "601": (4, 9)
    }[name[1:]]  # fmt: skip


def carriers(deck: str, rows: dict[int, int], names: list[str]) -> dict[str, list[int]]:
    """Nodes of each surface, from SPLINE4, AELIST and SET1 cards."""
    cards: dict[tuple[str, str], list[str]] = {}
    current: list[str] = []
    for line in deck.splitlines():
        words = line.split()
        if line[:1] in ("$", "") or not words:
            continue
        if line[0] in " \t":
            current += words
        else:
            current = words[2:]
            cards[(words[0], words[1])] = current
    result = {}
    for (kind, _), words in cards.items():
        if kind == "SPLINE4":
            surfaces = {box[:4] for box in cards[("AELIST", words[1])]}
            nodes = [rows[int(node)] for node in cards[("SET1", words[2])]]
            result.update({name: nodes for name in names if name[:4] in surfaces})
    return result


@functools.cache
def aircraft(folder: Path) -> tuple[Boxes, ModalStructure, GeneralisedForces]:
    content = scipy.io.loadmat(
        folder / "mAEWing1_FEMv2p1_ModeInfo_updated_nodecords.mat1", struct_as_record=False, squeeze_me=True
    )
    points, modes = content["FEM"].points_coordinates, content["ModeShape"].modeshape
    n_modes = 6 + N_FLEXIBLE
    omega = 2 * np.pi * content["ModeShape"].natural_frequency[:n_modes]
    omega[:6] = 0.0
    rows = {int(node): row for row, node in enumerate(points[:, 0])}
    parts = trapezoids((folder / "CAERO_mAEWing1.dat").read_text())
    boxes = boxes_of(parts)
    nodes = carriers((folder / "Spline4_mAEWing1.dat").read_text(), rows, [part.name for part in parts])
    motion = spline_motion(boxes, points[:, 1:], modes[:, 1:, :n_modes], nodes, arm_m=0.05 * 2 * SEMI_CHORD)
    names = tuple(f"rigid {i + 1}" for i in range(6)) + tuple(f"mode {i + 7}" for i in range(N_FLEXIBLE))
    forces = generalised_forces(boxes, motion, K, semi_chord_m=SEMI_CHORD, mach=0.0)
    return boxes, of_modes(omega, names=names), forces


@pytest.fixture
def wing(external_data: Path) -> tuple[Boxes, ModalStructure, GeneralisedForces]:
    folder = external_data / "maewing1"
    if not folder.is_dir():
        pytest.skip("no maewing1 in the folder of recordings")
    if importlib.util.find_spec("panelaero") is None:
        pytest.skip("PanelAero is not installed: pip install 'sloshlab[aircraft]'")
    return aircraft(folder)


def locus_of(wing: tuple[Boxes, ModalStructure, GeneralisedForces], fit: str) -> RootLocus:
    _, structure, forces = wing
    if fit == "roger":
        form = roger_fit(K, forces.motion, semi_chord_m=SEMI_CHORD)
    else:
        form = minimum_state_fit(K, forces.motion, semi_chord_m=SEMI_CHORD, lags=np.geomspace(0.06, 1.2, 16))
    system = system_over_speed(structure, form, density_kg_per_m3=DENSITY)
    return root_locus(system, np.linspace(20, 50, 61) / INCH, structure.names)


def test_reference_area(wing: tuple[Boxes, ModalStructure, GeneralisedForces]) -> None:
    """1.072 m² by an independent reading of the cards; winglets left out."""
    boxes = wing[0]
    flat = np.abs(boxes.normal[:, 2]) > 0.9
    assert boxes.n == 424
    assert boxes.area_m2[flat].sum() * INCH**2 == pytest.approx(1.072, rel=0.01)


@pytest.mark.parametrize("fit", ["roger", "minimum state"])
def test_three_flutter_points_are_nastrans(
    wing: tuple[Boxes, ModalStructure, GeneralisedForces], fit: str
) -> None:
    locus = locus_of(wing, fit)
    found = [
        (crossing.speed_m_per_s * INCH, crossing.frequency_rad_per_s / (2 * np.pi))
        for crossing in locus.crossings
        if crossing.frequency_rad_per_s > 10
    ]
    assert len(found) >= 3
    for (speed, frequency), (expected, expected_hz), within in zip(
        found, NASTRAN, (0.025, 0.04, 0.04), strict=False
    ):
        # 424 boxes in place of Nastran's 2652
        assert speed == pytest.approx(expected, rel=within)
        assert frequency == pytest.approx(expected_hz, rel=0.02)


def test_branches_keep_the_names_of_their_modes(
    wing: tuple[Boxes, ModalStructure, GeneralisedForces],
) -> None:
    locus = locus_of(wing, "roger")
    assert locus.flags == ()
    assert [crossing.origin for crossing in locus.crossings if crossing.frequency_rad_per_s > 10][:3] == [
        "mode 7",
        "mode 8",
        "mode 10",
    ]
    assert (
        flags_of_reach(
            locus.speed_m_per_s,
            locus.pole_rad_per_s[:, [name.startswith("mode 7") for name in locus.origin]],
            ("mode 7",),
            semi_chord_m=SEMI_CHORD,
            largest_reduced_frequency=K[-1],
        )
        == ()
    )


def test_p_k_agrees_with_the_rational_functions(
    wing: tuple[Boxes, ModalStructure, GeneralisedForces],
) -> None:
    _, structure, forces = wing
    speeds = np.linspace(2, 33, 32) / INCH
    roots = p_k_roots(structure, forces.at, semi_chord_m=SEMI_CHORD, density_kg_per_m3=DENSITY, speeds=speeds)
    real = roots.pole_rad_per_s[:, 6].real
    [step] = np.flatnonzero((real[:-1] < 0) & (real[1:] >= 0))
    weight = -real[step] / (real[step + 1] - real[step])
    speed = (speeds[step] + weight * (speeds[step + 1] - speeds[step])) * INCH
    frequency = roots.pole_rad_per_s[step + 1, 6].imag / (2 * np.pi)
    found = locus_of(wing, "roger").flutter
    assert found is not None
    # an independent script: 32.30 m/s and 5.05 Hz by p-k, 32.26 m/s by Roger's fit
    assert speed == pytest.approx(32.30, rel=0.005)
    assert frequency == pytest.approx(5.05, rel=0.01)
    assert speed == pytest.approx(found.speed_m_per_s * INCH, rel=0.005)

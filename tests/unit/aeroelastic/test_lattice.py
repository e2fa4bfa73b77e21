"""The doublet lattice: lifting-surface theory, two-dimensional flow, gust identity, cache. Needs PanelAero."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from sloshlab.aeroelastic.generalised_force_cache import CacheStatus, cached_generalised_forces
from sloshlab.aeroelastic.generalised_forces import (
    GeneralisedForces,
    flags_of_reach,
    generalised_forces,
    usual_reduced_frequencies,
)
from sloshlab.aeroelastic.planform import Boxes, Trapezoid, boxes_of
from sloshlab.aeroelastic.section_forces import Section
from sloshlab.aeroelastic.splines import BoxMotion, rigid_motion
from sloshlab.errors import AnalysisError, MissingExtraError

K = np.array([0.0, 0.1, 0.3, 0.6])


@pytest.fixture(autouse=True)
def _needs_panelaero() -> None:
    pytest.importorskip("importlib.metadata")
    from importlib.metadata import PackageNotFoundError, version

    try:
        version("PanelAero")
    except PackageNotFoundError:
        pytest.skip("PanelAero is not installed: pip install 'sloshlab[aircraft]'")


def rigid_plunge_and_pitch(boxes: Boxes, axis_m: float) -> BoxMotion:
    """Columns: up, and nose up about a line across the flow."""
    whole = rigid_motion(boxes, np.array([axis_m, 0.0, 0.0]))
    return BoxMotion(*(part[:, [2, 4]] for part in vars(whole).values()))


def elliptic_wing(semi_span: float, root_chord: float, n_span: int, n_chord: int) -> list[Trapezoid]:
    """Equal strips with the chord of an ellipse and a straight mid-chord line."""
    edges = np.linspace(-semi_span, semi_span, n_span + 1)
    chord = root_chord * np.sqrt(np.maximum(1 - (edges / semi_span) ** 2, 0.0))
    return [
        Trapezoid(
            f"{i}",
            ((-chord[i] / 2, edges[i], 0), (-chord[i + 1] / 2, edges[i + 1], 0)),
            chord[i : i + 2],
            1,
            n_chord,
        )
        for i in range(n_span)
    ]


def lift_slope(trapezoids: list[Trapezoid], mach: float = 0.0) -> tuple[float, float]:
    """dC_L/dα and the area."""
    boxes = boxes_of(trapezoids)
    forces = generalised_forces(
        boxes, rigid_plunge_and_pitch(boxes, 0.0), np.array([0.0, 1e-3, 2e-3, 3e-3]), semi_chord_m=1.0, mach=mach
    )
    area = float(boxes.area_m2.sum())
    return float(forces.motion[0, 0, 1].real) / area, area


def extrapolated(semi_span: float, root_chord: float, n_span: int, n_chord: int) -> float:
    """Lift slope for ever narrower strips: the lattice is too long at the tips by a share of a strip."""
    coarse, _ = lift_slope(elliptic_wing(semi_span, root_chord, n_span, n_chord))
    fine, _ = lift_slope(elliptic_wing(semi_span, root_chord, 2 * n_span, n_chord))
    return 2 * fine - coarse


def test_circular_wing_has_the_exact_lift_slope() -> None:
    """Exact lifting-surface theory of the circular planform: 1.7900 per rad."""
    # order one in the width of strips, extrapolated from 12 and 24
    assert extrapolated(1.0, 2.0, 12, 5) == pytest.approx(1.7900, rel=0.01)


def test_elliptic_wing_has_the_lift_slope_of_third_order_lifting_line_theory() -> None:
    """Van Dyke (1964): 2π/[1 + 2/A + (16/π²A²) ln(1 + π e^(−9/8) A)]."""
    ratio = 32 / np.pi
    third = 16 / (np.pi * ratio) ** 2 * np.log(1 + np.pi * np.exp(-9 / 8) * ratio)
    # what strips leave after extrapolation; lifting-line theory of first order is 3 % off
    assert extrapolated(4.0, 1.0, 16, 4) == pytest.approx(2 * np.pi / (1 + 2 / ratio + third), rel=0.005)


def test_compressibility_follows_goethert() -> None:
    """β C_Lα of a wing at Mach M is C_Lα of the wing stretched by 1/β along the flow at M = 0."""
    beta = 0.6
    wing = [Trapezoid("wing", ((0, -3, 0), (0, 3, 0)), (1.0, 1.0), 14, 4)]
    stretched = [Trapezoid("wing", ((0, -3, 0), (0, 3, 0)), (1 / beta, 1 / beta), 14, 4)]
    assert lift_slope(wing, mach=0.8)[0] * beta == pytest.approx(lift_slope(stretched)[0], rel=1e-6)


def test_middle_of_a_slender_wing_has_theodorsens_lift() -> None:
    """Aspect ratio 16: three-dimensional effects fade as k grows; at k = 0 they are 10 %."""
    boxes = boxes_of([Trapezoid("wing", ((0, -16, 0), (0, 16, 0)), (2.0, 2.0), 32, 6)])
    motion = rigid_plunge_and_pitch(boxes, 0.5)
    middle = np.abs(boxes.at_chord(0.5)[:, 1]) < 1.1
    motion = BoxMotion(
        motion.control_displacement, motion.control_slope, motion.load_displacement * middle[:, None]
    )
    forces = generalised_forces(boxes, motion, K, semi_chord_m=1.0, mach=0.0)
    span = float(boxes.area_m2[middle].sum()) / 2
    for index, within in ((2, 0.035), (3, 0.04)):
        exact = Section(1.0, -0.5).forces(1j * K[index])[0]
        lift = forces.motion[index, 0] / span
        assert np.all(np.abs(lift - exact) < within * np.abs(exact))


def test_forces_depend_on_the_size_only_through_the_reduced_frequency() -> None:
    """Twice the size, the same k: forces by pitch grow with the area, moments with area and length."""
    boxes = boxes_of([Trapezoid("wing", ((0.5, -2, 0), (0, 0, 0)), (0.6, 1.0), 5, 3)])
    small = generalised_forces(boxes, rigid_plunge_and_pitch(boxes, 0.4), K, semi_chord_m=0.4, mach=0.3)
    twice = boxes.scaled(2.0)
    large = generalised_forces(twice, rigid_plunge_and_pitch(twice, 0.8), K, semi_chord_m=0.8, mach=0.3)
    np.testing.assert_allclose(large.motion, small.motion * [[2.0, 4.0], [4.0, 8.0]], rtol=1e-8, atol=1e-10)


def test_uniform_gust_is_rigid_plunge_over_the_frequency() -> None:
    """V16, zones summed; a travelling gust of no frequency is a uniform one."""
    boxes = boxes_of([Trapezoid("wing", ((0.5, -2, 0), (0, 0, 0)), (0.6, 1.0), 5, 3)])
    forces = generalised_forces(
        boxes, rigid_plunge_and_pitch(boxes, 0.4), K, semi_chord_m=0.5, mach=0.3, n_gust_zones=3
    )
    for index in (1, 2, 3):
        expected = -0.5 / (1j * K[index]) * forces.motion[index, :, 0]
        np.testing.assert_allclose(forces.gust[index].sum(axis=1), expected, rtol=1e-10)
    np.testing.assert_allclose(forces.travelling_gust[0], forces.gust[0].sum(axis=1), rtol=1e-12)
    assert np.all(np.diff(forces.zone_place_m) > 0)


def test_a_travelling_gust_has_the_phase_of_its_place() -> None:
    """On a small surface far behind the first zone the gust is a uniform one that comes later."""
    boxes = boxes_of(
        [
            Trapezoid("nose", ((0, -0.5, 0), (0, 0.5, 0)), (0.1, 0.1), 2, 1),
            Trapezoid("tail", ((40, -20.5, 0), (40, -19.5, 0)), (0.1, 0.1), 2, 1),
        ]
    )
    motion = rigid_plunge_and_pitch(boxes, 0.0)
    tail = (boxes.surface == 1)[:, None]
    motion = BoxMotion(motion.control_displacement, motion.control_slope, motion.load_displacement * tail)
    forces = generalised_forces(boxes, motion, K, semi_chord_m=5.0, mach=0.0, n_gust_zones=2)
    place = boxes.at_chord(0.75)[boxes.surface == 1, 0].mean() - forces.zone_place_m[0]
    late = np.exp(-1j * K[2] * place / 5.0) * forces.gust[2].sum(axis=1)
    # what the nose induces at the tail 45 chords away is what is left
    np.testing.assert_allclose(forces.travelling_gust[2], late, rtol=1e-3)


def test_cache_is_read_again_and_made_anew_when_damaged(tmp_path: Path) -> None:
    boxes = boxes_of([Trapezoid("wing", ((0, -1, 0), (0, 1, 0)), (0.5, 0.5), 4, 2)])
    motion = rigid_plunge_and_pitch(boxes, 0.2)

    def forces(mach: float = 0.2) -> tuple[GeneralisedForces, CacheStatus]:
        return cached_generalised_forces(tmp_path / "cache", boxes, motion, K, semi_chord_m=0.25, mach=mach)

    made, status = forces()
    assert status is CacheStatus.MADE
    read, status = forces()
    assert status is CacheStatus.READ
    np.testing.assert_array_equal(read.motion, made.motion)
    np.testing.assert_array_equal(read.travelling_gust, made.travelling_gust)
    assert (read.mach, read.semi_chord_m) == (0.2, 0.25)
    assert forces(mach=0.3)[1] is CacheStatus.MADE
    [place] = [path for path in (tmp_path / "cache").glob("*.nc") if abs(_mach_of(path) - 0.2) < 1e-9]
    content = bytearray(place.read_bytes())
    content[len(content) // 2] ^= 0xFF
    place.write_bytes(content)
    again, status = forces()
    assert status is CacheStatus.DAMAGED
    assert "damaged" in status.value
    np.testing.assert_array_equal(again.motion, made.motion)
    place.with_suffix(".sha256").unlink()
    assert forces()[1] is CacheStatus.DAMAGED
    assert forces()[1] is CacheStatus.READ


def _mach_of(path: Path) -> float:
    import xarray as xr

    with xr.open_dataset(path) as dataset:
        return float(dataset.attrs["mach"])


def test_importing_the_lattice_leaves_numpys_warnings_on() -> None:
    program = (
        "import numpy as np; np.seterr(divide='raise')\n"
        "from sloshlab.aeroelastic.lattice import _panelaero\n"
        "_panelaero('DLM'); assert np.geterr()['divide'] == 'raise', np.geterr()\n"
        "import sys; assert 'panelaero' in sys.modules"
    )
    subprocess.run([sys.executable, "-c", program], check=True)


def test_a_missing_panelaero_is_one_line_that_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "panelaero", None)
    monkeypatch.delitem(sys.modules, "panelaero.VLM", raising=False)
    with pytest.raises(MissingExtraError, match=r"pip install 'sloshlab\[aircraft\]'"):
        lift_slope([Trapezoid("wing", ((0, -1, 0), (0, 1, 0)), (1.0, 1.0), 2, 2)])


@pytest.mark.parametrize(("mach", "k", "message"), [(1.1, K, "Mach number: got 1.1"), (0.2, -K, "negative")])
def test_flow_out_of_range_is_refused(mach: float, k: np.ndarray, message: str) -> None:
    boxes = boxes_of([Trapezoid("wing", ((0, -1, 0), (0, 1, 0)), (1.0, 1.0), 2, 2)])
    with pytest.raises(AnalysisError, match=message):
        generalised_forces(boxes, rigid_plunge_and_pitch(boxes, 0.0), k, semi_chord_m=0.5, mach=mach)


def test_branches_beyond_the_table_are_flagged() -> None:
    poles = np.array([[1 + 10j, -1 + 40j], [1 + 12j, -2 + 30j]])
    flags = flags_of_reach(
        np.array([10.0, 20.0]), poles, ("bending", "torsion"), semi_chord_m=0.5, largest_reduced_frequency=1.2
    )
    assert flags == ("branch torsion has reduced frequencies up to 2, beyond 1.2 of the aerodynamics",)


def test_usual_frequencies_start_at_zero_and_are_denser_there() -> None:
    k = usual_reduced_frequencies(1.3)
    assert (k[0], k[-1], k.size) == (0.0, pytest.approx(1.3), 15)
    assert np.all(np.diff(k, 2) > 0)

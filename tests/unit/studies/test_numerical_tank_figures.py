"""The pictures of the numerical tank show what was computed, at the phases that they name."""

from __future__ import annotations

import io
import math
import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from PIL import Image

from acquisition.numerical_tank.forced_motion import HarmonicMotion
from acquisition.numerical_tank.simulation import NumericalTank
from acquisition.numerical_tank.tank import Box, Liquid, filled_tank
from sloshlab.errors import InputError
from sloshlab.rig import Rig
from studies.measured_facts.map_readings import facts_of, half_filled
from studies.numerical_tank_figures import writing
from studies.numerical_tank_figures.__main__ import main
from studies.numerical_tank_figures.beam_release import release_plate, released
from studies.numerical_tank_figures.film import FRAME_MS, film, slowdown
from studies.numerical_tank_figures.maps import maps_figure
from studies.numerical_tank_figures.plates import conditions_plate, cycle_plate, shaking_title
from studies.numerical_tank_figures.snapshots import FRAMES_PER_CYCLE, Shaking, Snapshot, snapshots
from studies.numerical_tank_figures.tank_drawing import (
    condition_text,
    draw_outline,
    draw_particles,
    top_speed_m_per_s,
)

HEIGHT_M, LENGTH_M = 0.0272, 0.1172
RIG = f"""
[tank]
height_m = {HEIGHT_M}
length_m = {LENGTH_M}
width_m = 0.078
dry_mass_kg = 0.61
[liquid]
density_kg_per_m3 = 998.2
kinematic_viscosity_m2_per_s = 1.0e-6
fill_level = 0.5
"""
VIOLENT = Shaking(4.0, 11.4)


@pytest.fixture(scope="module")
def rig() -> Rig:
    return Rig.from_toml_text(RIG)


@pytest.fixture(scope="module")
def cycle(rig: Rig) -> list[Snapshot]:
    """Every second frame of the fifth cycle of a violent motion."""
    first = 4 * FRAMES_PER_CYCLE
    frames = range(first, first + FRAMES_PER_CYCLE, 2)
    return list(snapshots(rig, VIOLENT, frames, layers_per_height=8, seed=3))


def image_of(content: bytes) -> Image.Image:
    return Image.open(io.BytesIO(content))


def test_acceleration_is_the_second_derivative_of_the_displacement() -> None:
    shaking = Shaking(2.0, 8.0)
    step_s = 1e-4
    step_deg = 360 * 8.0 * step_s
    for phase_deg in (0.0, 50.0, 200.0, 330.0):
        u = [shaking.displacement_m(phase_deg + k * step_deg) for k in (-1, 0, 1)]
        assert (u[0] - 2 * u[1] + u[2]) / step_s**2 == pytest.approx(
            9.81 * shaking.acceleration_g(phase_deg), rel=1e-4, abs=1e-3
        )


def test_the_stroke_limits_the_level_at_low_frequency() -> None:
    assert Shaking(3.0, 6.0).amplitude_g == pytest.approx(0.0125 * (12 * math.pi) ** 2 / 9.81)
    assert Shaking(3.0, 6.0).displacement_amplitude_m == pytest.approx(0.0125)
    assert Shaking(3.0, 9.0).amplitude_g == 3.0


def test_a_snapshot_is_the_liquid_at_its_time(rig: Rig, cycle: list[Snapshot]) -> None:
    """The same motion given to the tank directly, to the time of the frame in one go."""
    frame = cycle[5].frame
    setup = filled_tank(
        Box(LENGTH_M, HEIGHT_M, 0.078),
        0.5,
        8,
        liquid=Liquid(998.2),
        seed=3,
        sampling_rate_hz=11.4 * FRAMES_PER_CYCLE,
    )
    tank = NumericalTank(setup)
    motion = HarmonicMotion(4 * 9.81, 11.4, rise_s=3 / 11.4)
    tank.advance(motion(tank.times_s(round(frame / FRAMES_PER_CYCLE / 11.4 / setup.step_s))))
    assert tank.time_s == pytest.approx(frame / FRAMES_PER_CYCLE / 11.4, rel=1e-12)
    np.testing.assert_array_equal(cycle[5].liquid.x_m, tank.state().x_m)
    np.testing.assert_array_equal(cycle[5].liquid.vz_m_per_s, tank.state().vz_m_per_s)


def test_particles_are_inside_the_tank_and_have_moved(cycle: list[Snapshot]) -> None:
    for snapshot in cycle:
        liquid = snapshot.liquid
        assert (liquid.x_m >= 0).all()
        assert (liquid.x_m <= LENGTH_M).all()
        assert (liquid.z_m >= 0).all()
        assert (liquid.z_m <= HEIGHT_M).all()
    assert max(snapshot.liquid.z_m.max() for snapshot in cycle) > 0.8 * HEIGHT_M


def test_frames_must_rise(rig: Rig) -> None:
    with pytest.raises(InputError, match="frames: got"):
        next(snapshots(rig, VIOLENT, [5, 5], layers_per_height=8, seed=0))


@pytest.mark.parametrize("frame", range(FRAMES_PER_CYCLE))
def test_titles_name_phase_and_acceleration(frame: int) -> None:
    snapshot = Snapshot(Shaking(3.0, 9.0), 7 * FRAMES_PER_CYCLE + frame, None, 1e-3)  # type: ignore[arg-type]
    found = re.fullmatch(r"φ = (\d+)°, ü = (0|[+−]\d\.\d\d) g", condition_text(snapshot))
    assert found
    phase_deg, acceleration_g = float(found[1]), float(found[2].replace("−", "-"))
    assert phase_deg == 15 * frame
    assert acceleration_g == pytest.approx(3 * math.cos(frame / 24 * 2 * math.pi), abs=0.0051)
    assert shaking_title(snapshot) == f"3 g, 9 Hz: {found[0]}"


def test_discs_and_outline_are_what_was_computed(rig: Rig, cycle: list[Snapshot]) -> None:
    from matplotlib.figure import Figure

    axes = Figure().subplots()
    snapshot, lift_m = cycle[2], 0.004
    discs = draw_particles(axes, snapshot, rig.tank, 1.0, lift_m)
    liquid = snapshot.liquid
    offsets = np.asarray(discs.get_offsets())
    np.testing.assert_allclose(offsets[:, 0], 1e3 * liquid.x_m)
    np.testing.assert_allclose(offsets[:, 1], 1e3 * liquid.z_m + 4.0)
    np.testing.assert_allclose(discs.get_array() ** 2, liquid.vx_m_per_s**2 + liquid.vz_m_per_s**2)
    walls = np.asarray(draw_outline(axes, rig.tank, lift_m).get_xydata())
    np.testing.assert_allclose([walls.min(axis=0), walls.max(axis=0)], [[0.0, 4.0], [117.2, 31.2]])


def test_one_particle_in_a_hundred_is_beyond_the_colours(cycle: list[Snapshot]) -> None:
    top = top_speed_m_per_s(cycle)
    speeds = np.concatenate([np.hypot(s.liquid.vx_m_per_s, s.liquid.vz_m_per_s) for s in cycle])
    assert (speeds > top).mean() <= 0.01
    assert (speeds > top - 0.1).mean() > 0.01


def test_plates_are_repeatable_pictures_without_empty_panels(rig: Rig, cycle: list[Snapshot]) -> None:
    content = cycle_plate(cycle, rig.tank)
    assert content == cycle_plate(cycle, rig.tank)
    assert len(content) < 400_000
    colours = np.asarray(image_of(content).convert("RGB")).astype(int)
    coloured = (np.ptp(colours, axis=-1) > 40)[: int(0.86 * colours.shape[0])]
    panels = [part for row in np.array_split(coloured, 6) for part in np.array_split(row, 2, axis=1)]
    assert min(part.mean() for part in panels) > 0.1
    assert image_of(conditions_plate(cycle[:3], rig.tank)).size[0] == colours.shape[1]


def test_the_released_beam_throws_its_liquid_at_first_and_sways_it_later(rig: Rig) -> None:
    """By particles above three quarters of the height, and by the decay of Table 2.4 as a bound from above."""
    # the flow is chaotic: single starts scatter by 0.04, and one start ends elsewhere on another processor
    starts = [released(rig, layers_per_height=10, seed=seed) for seed in range(6)]
    first, later = starts[0]
    high = np.array(
        [[(instant.snapshot.liquid.z_m > 0.75 * HEIGHT_M).mean() for instant in instants] for instants in starts]
    )
    assert high[:, 0].mean() > 0.15
    assert high[:, 1].mean() < 0.05
    assert later.time_s == pytest.approx(1.2, abs=2e-3)
    # at the release the tank has 6.9 g, with frozen liquid e^(−ζωt) = 0.77 of it at that time
    assert abs(later.acceleration_g) < 0.3 * 6.9
    content = release_plate([first, later], rig)
    assert content == release_plate([first, later], rig)
    colours = np.asarray(image_of(content).convert("RGB")).astype(int)
    coloured = (np.ptp(colours, axis=-1) > 40)[: int(0.7 * colours.shape[0])]
    assert min(half.mean() for half in np.array_split(coloured, 2, axis=1)) > 0.1


def test_the_film_moves_the_tank_as_told(rig: Rig, cycle: list[Snapshot]) -> None:
    content = film(cycle, rig.tank)
    moving = image_of(content)
    assert (moving.n_frames, moving.info["duration"], moving.info["loop"]) == (12, FRAME_MS, 0)
    low, high = walls_rows(moving, 0), walls_rows(moving, 6)  # φ = 0 and 180°
    assert high[1] - high[0] == pytest.approx(low[1] - low[0], abs=1)
    stroke_over_height = (low[0] - high[0]) / (low[1] - low[0])
    u0_m = 4 * 9.81 / (2 * math.pi * 11.4) ** 2
    assert stroke_over_height == pytest.approx(2 * u0_m / HEIGHT_M, abs=0.02)  # a pixel of 138
    for k, (roof, floor) in ((0, low), (6, high)):
        seen = (floor - coloured_rows(moving, k, roof, floor)) / (floor - roof)
        assert seen == pytest.approx(cycle[k].liquid.z_m.mean() / HEIGHT_M, abs=0.1)  # discs overlap
    assert slowdown(VIOLENT) == pytest.approx(FRAME_MS * 1e-3 / (1 / (24 * 11.4)))


def walls_rows(moving: Image.Image, frame: int) -> tuple[int, int]:
    """First and last row of a frame that is dark nearly all along: roof and floor."""
    moving.seek(frame)
    dark = np.asarray(moving.convert("L")).astype(int) < 90
    rows = np.flatnonzero(dark.mean(axis=1) > 0.85)
    return int(rows[0]), int(rows[-1])


def coloured_rows(moving: Image.Image, frame: int, roof: int, floor: int) -> float:
    """Mean row of what is neither white nor grey between roof and floor."""
    moving.seek(frame)
    colours = np.asarray(moving.convert("RGB")).astype(int)[roof + 2 : floor - 1]
    return roof + 2 + float(np.nonzero(np.ptp(colours, axis=-1) > 40)[0].mean())


def maps_of_parabolas() -> xr.Dataset:
    """W̄ = 2 − ((ū − 0.25)/0.1)² − ((ω̄ − 4)/2)², β = −0.04 ω̄, of three fill levels."""
    omega_bar, u_bar = np.linspace(2, 6, 81), np.linspace(0.005, 0.45, 90)
    work = 2 - ((u_bar - 0.25) / 0.1) ** 2 - ((omega_bar[:, None] - 4) / 2) ** 2
    beta = np.broadcast_to(-0.04 * omega_bar[:, None], work.shape)
    levels, dims = [0.25, 0.5, 0.75], ("fill_level", "u_bar", "omega_bar")
    return xr.Dataset(
        {
            "w_bar": (dims, np.stack([level * 2 * work.T for level in levels])),
            "beta": (dims, np.stack([level * 2 * beta.T for level in levels])),
        },
        {"fill_level": levels, "u_bar": u_bar, "omega_bar": omega_bar},
    )


def test_facts_are_read_from_the_map_of_the_half_filled_tank() -> None:
    facts = facts_of(half_filled(maps_of_parabolas()))
    assert (facts.largest.omega_bar, facts.largest.u_bar) == pytest.approx((4.0, 0.25), abs=0.003)
    assert facts.largest.w_bar == pytest.approx(2.0, abs=0.001)
    assert facts.w_bar_of_beam == pytest.approx(2 - 0.88**2 - 0.225**2, abs=0.002)
    half_width = 0.1 * math.sqrt(0.3)  # 2 − x² = 0.85 · 2
    assert facts.u_bar_above_85 == pytest.approx((0.25 - half_width, 0.25 + half_width), abs=0.006)
    assert facts.largest_beta == pytest.approx(-0.08)
    assert facts.beta_at_weakest == pytest.approx(-0.16)  # the mean ω̄ is 4


def test_beta_at_the_weakest_level_is_none_where_the_map_does_not_reach_it() -> None:
    maps = half_filled(maps_of_parabolas())
    assert math.isnan(facts_of(maps.where(maps["u_bar"] > 0.15)).beta_at_weakest)


def test_the_picture_of_maps_is_repeatable(rig: Rig) -> None:
    content = maps_figure(maps_of_parabolas(), rig)
    assert content == maps_figure(maps_of_parabolas(), rig)
    assert image_of(content).size[0] == image_of(maps_figure(-maps_of_parabolas(), rig)).size[0]


@pytest.mark.parametrize(
    ("maps", "message"),
    [
        (maps_of_parabolas().drop_vars("beta"), "no beta"),
        (maps_of_parabolas().sel(fill_level=[0.25, 0.75]), "fill level: got 0.25, 0.75"),
        (maps_of_parabolas() * np.nan, "w_bar: got no map with finite values"),
    ],
    ids=["no beta", "no half-filled tank", "nothing finite"],
)
def test_maps_that_cannot_be_drawn_are_refused(maps: xr.Dataset, message: str) -> None:
    with pytest.raises(InputError, match=message):
        half_filled(maps)


def test_the_command_writes_the_maps(tmp_path: Path, rig: Rig, capsys: pytest.CaptureFixture[str]) -> None:
    rig_file, maps_file = tmp_path / "rig.toml", tmp_path / "maps.nc"
    rig_file.write_text(RIG)
    maps_of_parabolas().to_netcdf(maps_file)
    arguments = ["maps", "--rig", rig_file, "--maps", maps_file, "--output", tmp_path / "new"]
    assert main([str(argument) for argument in arguments]) == 0
    assert "tank_maps.png" in capsys.readouterr().out
    assert (tmp_path / "new" / "tank_maps.png").read_bytes() == maps_figure(maps_of_parabolas(), rig)


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        (["portrait"], "picture: got portrait; allowed: snapshots, cycle, release, film, maps"),
        (["maps"], "maps: got no file"),
        (["maps", "--maps", "rig.toml"], "rig.toml: got"),
        (["maps", "--maps", "none.nc"], "none.nc: got"),
        (["cycle", "--layers", "0"], "layers of particles over the height: got 0"),
        (["cycle", "--rig", "none.toml"], "none.toml"),
    ],
)
def test_bad_input_is_one_line(
    extra: list[str],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("rig.toml").write_text(RIG)
    assert main(["--rig", "rig.toml", "--output", "new", *extra]) == 1
    line = capsys.readouterr().err
    assert message in line
    assert line.count("\n") == 1
    assert not Path("new").exists()


def test_a_picture_that_fails_leaves_the_old_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "rig.toml").write_text(RIG)
    (tmp_path / "tank_cycle.png").write_bytes(b"old")

    def interrupted(*_: object) -> bytes:
        raise KeyboardInterrupt

    monkeypatch.setattr(writing, "_film_snapshots", lambda *_: [])
    monkeypatch.setattr(writing, "cycle_plate", interrupted)
    assert main(["cycle", "--rig", str(tmp_path / "rig.toml"), "--output", str(tmp_path)]) == 130
    assert (tmp_path / "tank_cycle.png").read_bytes() == b"old"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["rig.toml", "tank_cycle.png"]

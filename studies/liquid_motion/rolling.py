"""A half-filled tank of liquid and gas shaken up and rolled at once: what adding both forces leaves out.

Run as ``python -m studies.liquid_motion.rolling FOLDER``; what is in the folder already is not computed again.
The roll is about the middle of the box, in phase with the vertical motion, as the tip of a beam turns with its
deflection. Accelerations and forces are along the axes of the tank.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from acquisition.two_phase_tank.setup import Fluids, filled_two_phase_tank
from acquisition.two_phase_tank.simulation import TwoPhaseTank
from pipelines.report.style import DISTINCT_COLOURS, drawing_style, new_figure, png_bytes
from pipelines.report.terminal import say
from sloshlab.atomic_file import write_bytes
from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.errors import SloshlabError
from sloshlab.lateral_sloshing.box_tank import BoxTank, equivalent_model
from sloshlab.lateral_sloshing.coupling import plane_at_tank_centre
from studies.liquid_motion.shaking import FILL_LEVEL, TANK, first_harmonic

FloatArray = NDArray[np.float64]

FREQUENCY_HZ: Final = 10.7
"""Of the first mode of the beam."""
OMEGA_RAD_PER_S: Final = 2 * math.pi * FREQUENCY_HZ
VERTICAL_G: Final = (1.0, 2.0, 3.0, 5.0)
ROLL_RAD: Final = (0.005, 0.01, 0.03)
"""The tip of the source's beam, 0.74 m long, turns by 0.009 rad at 2 g and 0.03 rad at the release."""
CELLS: Final = 16
N_CYCLES: Final = 34
N_AVERAGED: Final = 24
RISE_CYCLES: Final = 3


@dataclass(frozen=True)
class Rolling:
    """ü = a cos Ωt upward and a roll −θ₀ cos Ωt from x towards z.

    Attributes
    ----------
    vertical_g : float
        a/g.
    roll_rad : float
        θ₀.
    seed : int
        Of the disturbance at the start.
    """

    vertical_g: float
    roll_rad: float = 0.0
    seed: int = 0

    @property
    def name(self) -> str:
        """One that no other has."""
        return ", ".join(f"{key}={value:g}" for key, value in asdict(self).items())


@dataclass(frozen=True)
class Rolled:
    """First harmonics of what the fluids do beyond frozen ones, over m_l g; phasors of e^{iΩt} with ü = a.

    Attributes
    ----------
    vertical, sideways : complex
        Upward and along x, both of the tank's axes.
    """

    vertical: complex
    sideways: complex


def roll_acceleration(times_s: FloatArray, step_s: float, roll_rad: float) -> FloatArray:
    """Mean angular acceleration over steps [rad/s²], of a roll that begins at rest and swells for three cycles.

    Parameters
    ----------
    times_s : ndarray
        Middles of the steps.
    step_s : float
    roll_rad : float
        θ₀.
    """
    edges = np.append(times_s - 0.5 * step_s, times_s[-1:] + 0.5 * step_s)
    return np.asarray(np.diff(_roll_rate(edges, roll_rad)) / step_s)


def _roll_rate(time_s: FloatArray, roll_rad: float) -> FloatArray:
    """θ̇ of θ = −θ₀ r cos Ωt with r = sin² up to its end: no step, so that no tilt is left."""
    rising = np.pi * FREQUENCY_HZ / (2 * RISE_CYCLES)
    inside = time_s < 0.5 * np.pi / rising
    r = np.where(inside, np.sin(rising * time_s) ** 2, 1.0)
    slope = np.where(inside, rising * np.sin(2 * rising * time_s), 0.0)
    phase = OMEGA_RAD_PER_S * time_s
    return np.asarray(-roll_rad * (slope * np.cos(phase) - r * OMEGA_RAD_PER_S * np.sin(phase)))


def rolled(case: Rolling) -> Rolled:
    """Shake and roll the tank from rest.

    Parameters
    ----------
    case : Rolling
    """
    setup = filled_two_phase_tank(TANK, FILL_LEVEL, CELLS, fluids=Fluids(density_kg_per_m3=1000.0), seed=case.seed)
    tank, step_s = TwoPhaseTank(setup), setup.step_s
    times = tank.times_s(round(N_CYCLES / FREQUENCY_HZ / step_s))
    share = np.clip(times * FREQUENCY_HZ / RISE_CYCLES, 0, 1) * np.cos(OMEGA_RAD_PER_S * times)
    vertical = case.vertical_g * GRAVITY_M_PER_S2 * share
    roll = roll_acceleration(times, step_s, case.roll_rad)
    forces = tank.advance(np.stack([np.zeros_like(times), vertical, roll], axis=1))
    used = slice(-round(N_AVERAGED / FREQUENCY_HZ / step_s), None)
    up = first_harmonic(times[used], forces.vertical_n[used], OMEGA_RAD_PER_S)
    along = first_harmonic(times[used], forces.horizontal_n[used], OMEGA_RAD_PER_S)
    # frozen fluids: −m a upward; along x −m (g θ + d θ̈), their centre d below the axis
    mass, s2 = setup.fluid_mass_kg, -(OMEGA_RAD_PER_S**2)
    below = 0.5 * (TANK.height_m - FILL_LEVEL * TANK.height_m)
    up += mass * case.vertical_g * GRAVITY_M_PER_S2
    along += mass * (GRAVITY_M_PER_S2 + below * s2) * -case.roll_rad
    unit = setup.liquid_mass_kg * GRAVITY_M_PER_S2
    return Rolled(up / unit, along / unit)


def sideways_of_linear_model(roll_rad: float) -> complex:
    """Δf_x over m_l g of the equivalent mechanical model (D.1–D.8) for a roll −θ₀ cos Ωt about the box's middle.

    Parameters
    ----------
    roll_rad : float
        θ₀.
    """
    tank = BoxTank(TANK.length_m, TANK.depth_m, TANK.height_m, fill_level=FILL_LEVEL, density_kg_per_m3=1000.0)
    plane = plane_at_tank_centre(equivalent_model(tank, "x", n_modes=200), tank.liquid_centre_m)
    # φ turns the top towards +x, the roll from x towards z the other way
    phi, s = roll_rad, 1j * OMEGA_RAD_PER_S
    force = plane.transfer_matrix(s)[0, 1] * phi
    frozen = -tank.liquid_mass_kg * s**2 * tank.liquid_centre_m * phi
    return complex((force - frozen) / (tank.liquid_mass_kg * GRAVITY_M_PER_S2))


def cases() -> list[Rolling]:
    """Vertical motion alone with two starts, the roll alone, and both."""
    alone = [Rolling(level, 0.0, seed) for level in VERTICAL_G for seed in (0, 1)]
    return [*alone, *(Rolling(level, roll) for roll in ROLL_RAD for level in (0.0, *VERTICAL_G))]


def computed(folder: Path) -> dict[Rolling, Rolled]:
    """Compute what is not there yet, and return all.

    Parameters
    ----------
    folder : Path
    """
    place = folder / "rolled.json"
    kept = json.loads(place.read_text()) if place.exists() else {}
    for case in cases():
        if case.name not in kept:
            found = rolled(case)
            kept[case.name] = {
                name: [getattr(found, name).real, getattr(found, name).imag] for name in ("vertical", "sideways")
            }
            write_bytes(place, (json.dumps(kept, indent=1) + "\n").encode())
    return {
        case: Rolled(complex(*kept[case.name]["vertical"]), complex(*kept[case.name]["sideways"]))
        for case in cases()
    }


def table(found: Mapping[Rolling, Rolled]) -> Iterator[str]:
    """What the vertical force loses and the sideways force gains when the shaken tank rolls, as Markdown."""
    yield (
        "| a_z | θ₀ | W̄, β alone | rolling | error of Δf_z | another start "
        "| Δf_x, linear | roll alone | both | a_z alone |"
    )
    yield "|---" * 10 + "|"
    for vertical in VERTICAL_G:
        starts = alone, other = (found[Rolling(vertical, 0.0, 0)], found[Rolling(vertical, 0.0, 1)])
        for roll in ROLL_RAD:
            both, still = found[Rolling(vertical, roll)], found[Rolling(0.0, roll)]
            pairs = [_work_and_mass(run, vertical) for run in (alone, both)]
            errors = [f"{100 * vertical_error(run, alone):.0f} %" for run in (both, other)]
            sideways = [sideways_of_linear_model(roll), still.sideways, both.sideways]
            sizes = [f"{abs(force):.3f}" for force in sideways]
            sizes.append(", ".join(f"{abs(run.sideways):.3f}" for run in starts))
            cells = [f"{vertical:g} g", f"{roll:g} rad", *pairs, *errors, *sizes]
            yield f"| {' | '.join(cells)} |".replace("-", "−")


def vertical_error(run: Rolled, alone: Rolled) -> float:
    """Difference of the vertical force from that of a run without roll, over the latter."""
    return abs(run.vertical - alone.vertical) / abs(alone.vertical)


def _work_and_mass(run: Rolled, vertical_g: float) -> str:
    ratio = -run.vertical / vertical_g
    return f"{-math.pi * ratio.imag:.2f}, {ratio.real:+.2f}"


def figure(found: Mapping[Rolling, Rolled]) -> bytes:
    """Error of the vertical force and size of the sideways one over the vertical level, as PNG."""
    with drawing_style():
        drawn = new_figure(3.0)
        left, right = drawn.subplots(1, 2, sharex=True)
        for colour, roll in zip(DISTINCT_COLOURS, ROLL_RAD, strict=False):
            both = [found[Rolling(level, roll)] for level in VERTICAL_G]
            alone = [found[Rolling(level)] for level in VERTICAL_G]
            errors = [100 * vertical_error(*pair) for pair in zip(both, alone, strict=True)]
            left.plot(VERTICAL_G, errors, "o-", color=colour, label=f"roll of {roll:g} rad")
            right.plot(VERTICAL_G, [abs(run.sideways) for run in both], "o-", color=colour)
            right.axhline(abs(sideways_of_linear_model(roll)), color=colour, lw=0.9, ls=":")
        starts = [100 * vertical_error(found[Rolling(v, 0.0, 1)], found[Rolling(v)]) for v in VERTICAL_G]
        left.plot(VERTICAL_G, starts, "k--", label="no roll, another start")
        for seed in (0, 1):
            right.plot(VERTICAL_G, [abs(found[Rolling(v, 0.0, seed)].sideways) for v in VERTICAL_G], "k--")
        left.set(xlabel="vertical level [g]", ylabel="error of the vertical force [%]", ylim=(0, None))
        right.set(xlabel="vertical level [g]", ylabel="sideways force, over m g", ylim=(0, None))
        drawn.legend(loc="outside upper center", ncols=4)
        return png_bytes(drawn)


def main(arguments: Sequence[str] | None = None) -> int:
    """Compute, and write table and picture.

    Parameters
    ----------
    arguments : sequence of str, optional
        As on the command line.
    """
    parser = argparse.ArgumentParser(prog="python -m studies.liquid_motion.rolling", description=__doc__)
    parser.add_argument("folder", type=Path, help="of table and picture")
    given = parser.parse_args(arguments)
    try:
        given.folder.mkdir(parents=True, exist_ok=True)
        found = computed(given.folder)
        write_bytes(given.folder / "rolled.md", ("\n".join(table(found)) + "\n").encode())
        write_bytes(given.folder / "vertical_and_roll.png", figure(found))
    except SloshlabError as error:
        say(f"rolling: {error}", error=True)
        return 1
    say(f"{given.folder / 'rolled.md'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""Speed of the twin: `python -m tests.benchmarks.twin` prints JSON.

The rival is the same model by `scipy.integrate.solve_ivp`, piece by piece between contacts, written as anybody
would write it. Equal error: both are compared with the twin at 32 times smaller steps, the error being the largest
difference of the tank's displacement at any of the 200 001 samples; the rival gets the loosest tolerance at which
its error is not larger than that of the twin.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from sloshlab.twin.excitation import Excitation, free, recorded, with_cached_inputs
from sloshlab.twin.lane_preparation import Lane, done, motions
from sloshlab.twin.structure import Structure, modal_structure
from sloshlab.twin.structure_forces import QUADRATIC_DRAG, VISCOUS_DAMPING
from sloshlab.twin.tank_forces import BOUNCING_BALL
from sloshlab.twin.twin import Twin
from tests.benchmarks.measurements import best_in_turn, best_of

RATE_HZ, DURATION_S, DEFLECTION_M = 20_000.0, 10.0, -0.0146
FREE_LABEL = "twin: 10 s of beam and ball at 20 kHz [s]"
RANDOM_LABEL = "twin: 90 s of random base motion at 20 kHz [s]"
LANES_LABEL = "twin: 64 beams one at a time, over side by side"
BALL_LABEL = "… with a ball, over side by side"
N_SIDE_BY_SIDE = 64
N_TURNS = 5
RIVAL_LABEL = "twin: time of solve_ivp ({}) at equal error over ours"
METHODS, LOOSEST = ("RK45", "DOP853"), 5.0
BALL = {
    "radius_m": 0.009, "stiffness_n_per_m": 3000.0, "damping_kg_per_s": 9.0, "hardening_per_m": 500.0,
    "beta": 0.002, "liquid_mass_kg": 0.12433, "height_m": 0.0272,
}  # fmt: skip


def beam() -> Structure:
    """Table 2.4."""
    return modal_structure(
        [10.87, 78.31, 226.5], [0.0032, 0.0090, 0.0176], [0.8956, 1.0692, 0.9655],
        mode_shape=[1.0, 1.0, 1.0], base_participation_kg=[1.21, -1.05, 0.85],
    )  # fmt: skip


def sloshing_beam() -> Twin:
    """The beam with the bouncing ball in its tank."""
    return Twin(beam()).with_term(BOUNCING_BALL(**BALL))


def random_run(duration_s: float = 90.0, rms_g: float = 0.4) -> Excitation:
    """Gaussian spectrum (2.30) about the first mode, sampled at 1000 Hz."""
    rate, rng = 1000.0, np.random.default_rng(3)
    n = round(duration_s * rate)
    f = np.fft.rfftfreq(n, 1 / rate)
    lines = np.exp(-((f - 10.87) ** 2) / (4 * 4.0**2)) * np.exp(2j * np.pi * rng.random(f.size))
    lines[0] = 0.0
    omega = np.maximum(2 * np.pi * f, 1e-3)  # the mean is zero
    a, v, x = (np.fft.irfft(lines / (1j * omega) ** k, n) for k in range(3))
    factor = rms_g * 9.81 / a.std()
    return recorded(rate, acceleration=factor * a, velocity=factor * v, displacement=factor * x)


def rival(method: str, duration_s: float, tolerance: float) -> np.ndarray:
    """Displacement of the tank at 20 kHz by `solve_ivp`, restarted at every contact."""
    times = np.arange(round(duration_s * RATE_HZ) + 1) / RATE_HZ
    s, g, h = beam(), 9.81, BALL["height_m"]
    r0, k, c, alpha = (BALL[n] for n in ("radius_m", "stiffness_n_per_m", "damping_kg_per_s", "hardening_per_m"))
    ball_kg = (1 - BALL["beta"]) * BALL["liquid_mass_kg"]
    mass = np.diag(s.masses_kg) - ball_kg * np.outer(s.mode_shape, s.mode_shape)
    inverse, shape = np.linalg.inv(mass), s.mode_shape

    def overlap(y: np.ndarray, phase: int) -> float:
        height = y[6] - shape @ y[:3]
        return float(height - r0 if phase < 0 else height - h + r0)

    def rhs(t: float, y: np.ndarray, phase: int) -> np.ndarray:
        force = 0.0
        if phase:
            o = overlap(y, phase)
            force = k * (1 + alpha * o * o / (r0 - abs(o))) * o + c * (y[7] - shape @ y[3:6])
        q = inverse @ (
            shape * (force + ball_kg * g) - s.stiffnesses_n_per_m * y[:3] - s.dampings_kg_per_s * y[3:6]
        )
        return np.concatenate([y[3:6], q, [y[7], -g - force / ball_kg]])

    def event(which: int, direction: float) -> Callable[..., float]:
        def gap(t: float, y: np.ndarray, phase: int) -> float:
            return overlap(y, which)

        gap.terminal, gap.direction = True, direction  # type: ignore[attr-defined]
        return gap

    events = {-1: [event(-1, 1.0)], 0: [event(-1, -1.0), event(1, 1.0)], 1: [event(1, -1.0)]}
    rest = brentq(lambda o: k * (1 + alpha * o * o / (r0 - o)) * o - ball_kg * g, 0, 0.9 * r0, xtol=1e-15)
    tip = DEFLECTION_M
    state = np.concatenate([s.static_deflection(tip), np.zeros(3), [tip + r0 - rest, 0.0]])
    found, t, phase = np.full(times.size, np.nan), 0.0, -1
    while t < duration_s:
        wanted = times[(times >= t) & (times <= duration_s)]
        piece = solve_ivp(
            rhs, (t, duration_s), state, method=method, t_eval=wanted, args=(phase,), events=events[phase],
            rtol=tolerance, atol=1e-3 * tolerance,
        )  # fmt: skip
        if len(piece.t):
            found[np.searchsorted(times, piece.t)] = shape @ piece.y[:3]
        if piece.status != 1:
            break
        which = next(i for i, hits in enumerate(piece.t_events) if len(hits))
        t, state = float(piece.t_events[which][0]), piece.y_events[which][0]
        phase = 0 if phase else (-1 if which == 0 else 1)
    return found


def errors() -> tuple[float, dict[str, tuple[float, float]]]:
    """Largest error of the twin [m]; loosest tolerance of each rival with no larger error, and that error.

    Tolerances are tried from loose to tight, four per decade.
    """
    run, start = free(DURATION_S, RATE_HZ), {"initial_displacement_m": DEFLECTION_M}
    finest = sloshing_beam().simulate(run, **start, n_substeps=32).displacement_m
    ours = float(np.abs(moved(sloshing_beam(), run) - finest).max())
    found = {}
    for method in METHODS:
        for tolerance in 10.0 ** -np.arange(LOOSEST, 12.0, 0.25):
            theirs = float(np.abs(rival(method, DURATION_S, tolerance) - finest).max())
            if theirs <= ours:
                break
        found[method] = (tolerance, theirs)
    return ours, found


def lanes_of(twins: Sequence[Twin], base: Excitation) -> list[Lane]:
    """Twins driven alike, with integration steps as a diagnosis takes them: 8 per period of the highest mode."""
    return [Lane(twin, base, n_substeps=2) for twin in twins]


def over_side_by_side(twins: Sequence[Twin]) -> float:
    """Processor time of simulations one at a time over that of the same side by side, on one core."""
    lanes = lanes_of(twins, with_cached_inputs(random_run(10.0)))

    def one_at_a_time() -> None:
        for lane in lanes:
            assert isinstance(lane.twin, Twin)
            lane.twin.simulate(lane.excitation, n_substeps=lane.n_substeps).require_done()

    def together() -> None:
        for motion in motions(lanes):
            done(motion)

    return best_of(one_at_a_time, 5) / best_of(together, 5)


def different_beams() -> list[Structure]:
    """The beam with frequencies that differ by a thousandth from lane to lane."""
    own = beam()
    factors = 1.0 + 0.002 * np.arange(N_SIDE_BY_SIDE)
    return [replace(own, stiffnesses_n_per_m=own.stiffnesses_n_per_m * factor) for factor in factors]


def side_by_side_figures() -> dict[str, float]:
    """Damped beams, of which all of a step is taken together, and beams with a ball, whose law is called alone."""
    damped = (VISCOUS_DAMPING(place="tank", damping_n_s_per_m=0.5), QUADRATIC_DRAG(drag_n_s2_per_m2=0.5))
    return {
        LANES_LABEL: over_side_by_side([Twin(own, damped) for own in different_beams()]),
        BALL_LABEL: over_side_by_side([Twin(own, (BOUNCING_BALL(**BALL),)) for own in different_beams()]),
    }


def moved(twin: Twin, run: Excitation) -> np.ndarray:
    """Displacement of the tank at every sample, of a run that keeps the motion alone."""
    (motion,) = motions([Lane(twin, run, (DEFLECTION_M, 0.0))])
    return done(motion).displacement_m


def twin_figures() -> dict[str, float]:
    """Times and their ratios, compiled before; both give the displacement of the tank at every sample."""
    twin, run, base = sloshing_beam(), free(DURATION_S, RATE_HZ), random_run()
    whole = best_of(lambda: twin.simulate(run, initial_displacement_m=DEFLECTION_M).displacement_m, 9)
    random = best_of(lambda: twin.simulate(base, n_substeps=20).require_done().displacement_m, 3)
    error, rivals = errors()
    figures = side_by_side_figures() | {
        FREE_LABEL: whole,
        RANDOM_LABEL: random,
        "twin: its largest error in these 10 s [m]": error,
    }
    # a rival gives the motion alone, without works and forces: so does the twin beside it
    actions: dict[str, Callable[[], object]] = {"ours": lambda: moved(twin, run)}
    actions |= {method: partial(rival, method, DURATION_S, tolerance) for method, (tolerance, _) in rivals.items()}
    moved(twin, run)
    taken = best_in_turn(actions, N_TURNS)
    for method, (tolerance, theirs) in rivals.items():
        figures[RIVAL_LABEL.format(method)] = taken[method] / taken["ours"]
        figures[f"twin: largest error of {method} [m]"] = theirs
        figures[f"twin: relative tolerance of {method}"] = tolerance
    return figures


if __name__ == "__main__":
    print(json.dumps(twin_figures()))

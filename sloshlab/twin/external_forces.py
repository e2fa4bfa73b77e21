"""Forces that do not depend on the motion: a train of pulses, and the line of a machine that runs by itself."""

from __future__ import annotations

from math import cos, floor, pi, sin

from sloshlab.twin.law import TIME, law
from sloshlab.twin.terms import ForceKind, Parameter, register

# the laws are compiled, so their arguments are described once, in sloshlab.twin.law
# mypy: disable-error-code="no-untyped-def"

_BOTH = ("structure", "tank")


@law
def _pulses(motion, parameters, memory, rates):
    """F/2 (1 − cos(2π s/w)), s the time since the last pulse began; every other one against it if so wished."""
    since = motion[TIME] - parameters[1]
    number = floor(since / parameters[2])
    within = since - number * parameters[2]
    if since < 0.0 or within >= parameters[3]:
        return 0.0
    force = 0.5 * parameters[0] * (1.0 - cos(2.0 * pi * within / parameters[3]))
    return -force if parameters[4] > 0.5 and number % 2.0 == 1.0 else force


@law
def _line(motion, parameters, memory, rates):
    cycles = parameters[0] * (motion[TIME] - parameters[3]) + parameters[2]
    return parameters[1] * sin(2.0 * pi * cycles)


PULSE_TRAIN = register(
    ForceKind(
        "pulse_train",
        _BOTH,
        (
            Parameter("size_n", "N", -1e7, 1e7),
            Parameter("start_s", "s", -1e5, 1e5),
            Parameter("period_s", "s", 1e-6, 1e6),
            Parameter("width_s", "s", 1e-6, 1e6),
            Parameter("alternates", "1", 0.0, 1.0, 0.0),
        ),
        _pulses,
        equation="F/2 (1 − cos 2πs/w) for w from start on, again after every period",
    )
)
"""Haversine pulses, of impulse F w/2 each: force and slope are continuous, so that no step looks across a jump."""

HARMONIC_FORCE = register(
    ForceKind(
        "harmonic_force",
        _BOTH,
        (
            Parameter("frequency_hz", "Hz", 0.0, 1e5),
            Parameter("size_n", "N", -1e7, 1e7),
            Parameter("phase", "1", -1e3, 1e3, 0.0),
            Parameter("reference_s", "s", 0.0, 1e6, 0.0),
        ),
        _line,
        equation="F sin 2π(f (t − t_r) + φ), φ in cycles",
    )
)
"""The phase is that at an instant t_r: in the middle of a run a small change of the frequency leaves it alone."""

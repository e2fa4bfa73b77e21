"""An effect of one's own: dry friction behind a play. For ``sloshlab diagnose CASE --effects``.

A slider with dry friction F is moved through a stiffness k with a play p: after every reversal the force unloads,
the play is crossed at no force, and the stiffness loads again. The state e is how far the slider is behind:

    f = −k max(|e| − p/2, 0) sgn e,    ė = v, but zero where |f| = F and it would grow
"""

from sloshlab.diagnosis.effects.force_effect import force_effect
from sloshlab.twin.law import VELOCITY, law
from sloshlab.twin.terms import ForceKind, Parameter, register


@law
def _behind_play(motion, parameters, memory, rates):  # type: ignore[no-untyped-def]
    friction, play, stiffness = parameters[0], parameters[1], parameters[2]
    e, v = memory[0], motion[VELOCITY]
    stretch = max(abs(e) - 0.5 * play, 0.0)
    force = min(stiffness * stretch, friction)
    slides = stiffness * stretch >= friction and e * v > 0.0
    rates[0] = 0.0 if slides else v
    return -force if e > 0.0 else force


KIND = ForceKind(
    "friction_behind_play",
    ("structure",),
    (
        Parameter("force_n", "N", 0.0, 1e6),
        Parameter("play_m", "m", 0.0, 1.0),
        Parameter("stiffness_n_per_m", "N m-1", 0.0, 1e12),
    ),
    _behind_play,
    memory=lambda values, table: (0.0,),
    equation="dry friction F behind a stiffness k with a play p",
)
EFFECT = force_effect(
    register(KIND),
    "structure",
    lambda at: [
        {
            "force_n": share * at.force_n,
            "play_m": 0.1 * at.displacement_m,
            "stiffness_n_per_m": 5 * share * at.force_n / at.displacement_m,
        }
        for share in (0.2, 1.0)
    ],
    look_alikes=("hysteresis", "coulomb_friction"),
    separated_by="slow reversals at several amplitudes, with the force read while it is low",
)

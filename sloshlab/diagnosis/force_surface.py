"""Restoring force surface with memory: the correction without a name, of two motions of a place.

A sum of Chebyshev polynomials of the motions, a part that changes sign with the velocity, and three dampers behind
springs (relaxation), slower than the motion, as fast, and faster.

It is the ceiling that a named effect is compared with, and the model of what has no name (Masri and Caughey 1979,
doi:10.1115/1.3424568).
"""

from __future__ import annotations

from math import tanh

from sloshlab.diagnosis.candidate import Effect, EffectParameter, Numbers, Surroundings
from sloshlab.diagnosis.extension import Extension
from sloshlab.twin.law import ACCELERATION, DISPLACEMENT, VELOCITY, law
from sloshlab.twin.terms import ForceKind, Parameter, register

# the laws are compiled, so their arguments are described once, in sloshlab.twin.law
# mypy: disable-error-code="no-untyped-def"

DEGREE = 5
_SHARP = 0.05
_N_REMEMBERED = 3
_SLOWEST, _RATIO = 0.2, 5.0


@law
def _surface(motion, parameters, memory, rates):
    """Σ c_ij T_i(p) T_j(q), i + j ≤ 5, c tanh(q/0.05), Σ m_k z_k, ż = r (q − z); p is x or a, q is v, scaled."""
    p = motion[DISPLACEMENT] if parameters[2] == 0.0 else motion[ACCELERATION]
    # Beyond ±1 polynomials of fifth degree explode, and with them a free-running simulation.
    p = min(max(p / parameters[0], -1.0), 1.0)
    q = min(max(motion[VELOCITY] / parameters[1], -1.0), 1.0)
    # What remembers makes it a ceiling for hysteresis and relaxation as well.
    force, at = parameters[4] * tanh(q / _SHARP), 5
    rate = _SLOWEST * parameters[3]
    for k in range(_N_REMEMBERED):
        # Three relaxing dampers, slower than the motion, as fast, and faster: 0.2, 1 and 5 times its own rate.
        force += parameters[at] * memory[k]
        rates[k] = rate * (q - memory[k])
        rate *= _RATIO
        at += 1
    before_p, now_p = 1.0, 1.0
    for i in range(DEGREE + 1):
        before_q, now_q = 1.0, 1.0
        for j in range(DEGREE + 1 - i):
            if i + j > 0:
                force += parameters[at] * now_p * now_q
                at += 1
            after_q = q if j == 0 else 2 * q * now_q - before_q
            before_q, now_q = now_q, after_q
        after_p = p if i == 0 else 2 * p * now_p - before_p
        before_p, now_p = now_p, after_p
    return -force


_POLYNOMIALS = tuple(f"c_{i}{j}" for i in range(DEGREE + 1) for j in range(DEGREE + 1 - i) if i + j > 0)
NAMES = ("sharp", *(f"remembered_{k + 1}" for k in range(_N_REMEMBERED)), *_POLYNOMIALS)


def _kind(block: str) -> ForceKind:
    """The surface of one block; in the tank it depends on the acceleration, which is solved for in every step."""
    in_tank = block == "tank"
    return register(
        ForceKind(
            f"force_surface_of_{block}",
            (block,),
            (
                Parameter("largest_first", "1", 1e-12, 1e12),
                Parameter("largest_velocity_m_per_s", "m s-1", 1e-12, 1e6),
                Parameter("first_is_acceleration", "1", 0.0, 1.0),
                Parameter("rate_rad_per_s", "rad s-1", 1e-3, 1e6),
                *(Parameter(name, "N", -1e6, 1e6) for name in NAMES),
            ),
            _surface,
            memory=lambda values, table: (0.0,) * _N_REMEMBERED,
            uses_acceleration=in_tank,
            equation=f"−Σ c_ij T_i(p) T_j(v) − Σ m_k z_k, ż_k = r_k (v − z_k), p = {'a' if in_tank else 'x'}",
        )
    )


_KINDS = {block: _kind(block) for block in ("structure", "tank")}


def surface_effect(block: str) -> Effect:
    """A force of x and v at the structure, or of a and v at the tank; not part of the vocabulary."""
    in_tank = block == "tank"

    def extension(numbers: Numbers, at: Surroundings, channel: str) -> Extension:
        del channel
        first = at.acceleration_m_per_s2 if in_tank else at.displacement_m
        return Extension(
            terms=(
                _KINDS[block](
                    place=block,
                    largest_first=1.1 * first,
                    largest_velocity_m_per_s=1.1 * at.velocity_m_per_s,
                    first_is_acceleration=float(in_tank),
                    rate_rad_per_s=at.omega,
                    **numbers,
                ),
            )
        )

    return Effect(
        f"any force of {'a and v' if in_tank else 'x and v'}",
        block,
        _KINDS[block].equation,
        tuple(EffectParameter(name, -1e6, 1e6) for name in NAMES),
        lambda at: [dict.fromkeys(NAMES, 1e-4 * at.force_n)],
        extension,
        needs=lambda at: in_tank or at.twin.structure is not None,
    )

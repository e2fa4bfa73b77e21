"""Two filters of the third order with a diode between them, which conducts above a voltage (Wiener–Hammerstein).

The first filter has a real pole and a pair; the second one a pair of zeros on the axis besides, where it lets
nothing through. Believed are the poles of their documented designs: Chebyshev's filter with 0.5 dB of ripple up to
4.4 kHz, and his inverse filter with 40 dB from 5 kHz on. Above `onset` the diode and its resistors pass the share
1 − `loss`, and the knee is as wide as `knee`.
"""

from __future__ import annotations

from math import exp, log1p, pi
from typing import Any

from numba import njit

from sloshlab.user_twin import Compared, EquationTwin, Parameter


@njit  # type: ignore[untyped-decorator]
def filtered(state: Any, voltage: Any, parameters: Any, between: Any) -> Any:
    """Rates of both filters, and the output; x is the first filter's output, y the second one's pair."""
    first, second = 2 * pi * parameters.frequency_1, 2 * pi * parameters.frequency_2
    zero = 2 * pi * parameters.zero_2
    real_1 = 2 * pi * parameters.pole_1 * (voltage - state.first)
    bend_x = first * (state.first - state.x - 2 * parameters.damping_1 * state.x_rate)
    real_2 = 2 * pi * parameters.pole_2 * (between - state.second)
    bend_y = second * (state.second - state.y - 2 * parameters.damping_2 * state.y_rate)
    rates = (real_1, first * state.x_rate, bend_x, real_2, second * state.y_rate, bend_y)
    # (s² + ω_z²)/ω_z² of the pair; the second derivative is that of the pair's own rate
    return rates, (state.y + second * bend_y / zero**2,)


def linear(state: Any, inputs: Any, parameters: Any, force: Any) -> Any:
    """Both filters, without the diode."""
    return filtered(state, inputs.voltage_input, parameters, parameters.gain * state.x + force)


def with_diode(state: Any, inputs: Any, parameters: Any, force: Any) -> Any:
    """The diode between them."""
    over = (state.x - parameters.onset) / parameters.knee
    # log(1 + eˣ) without overflow
    softened = parameters.knee * (max(over, 0.0) + log1p(exp(-abs(over))))
    return filtered(
        state, inputs.voltage_input, parameters, parameters.gain * (state.x - parameters.loss * softened) + force
    )


FILTERS = (
    Parameter("pole_1", 2756.0, 300.0, "Hz"),
    Parameter("frequency_1", 4703.0, 300.0, "Hz"),
    Parameter("damping_1", 0.293, 0.06),
    Parameter("gain", 0.8, 0.2),
    Parameter("pole_2", 1761.0, 300.0, "Hz"),
    Parameter("frequency_2", 1685.0, 300.0, "Hz"),
    Parameter("damping_2", 0.478, 0.1),
    Parameter("zero_2", 5774.0, 300.0, "Hz"),
)
DIODE = (
    Parameter("onset", 0.3, 0.1, "V"),
    Parameter("loss", 0.5, 0.12),
    Parameter("knee", 0.06, 0.014, "V"),
)


def _twin(equations: Any, parameters: tuple[Parameter, ...]) -> EquationTwin:
    return EquationTwin(
        equations,
        states=dict.fromkeys(("first", "x", "x_rate", "second", "y", "y_rate"), 0.0),
        parameters=parameters,
        driving=("voltage_input",),
        compared={"voltage_output": Compared("V", gain_tolerance=0.0)},
        moves=("second",),
    )


TWIN = _twin(linear, FILTERS)
WITH_DIODE = _twin(with_diode, (*FILTERS, *DIODE))

"""How small and how large the numbers of a rig may be: what a tank, a liquid or a structure can have at all.

The ranges are wide. They find slips of units and of the keyboard, and keep numbers away whose squares and
quotients no computer can hold; what is usual is not asked.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True)
class PhysicalRange:
    """Values that a quantity can have.

    Attributes
    ----------
    low, high : float
        Both included.
    units : str
        For messages; empty for a share.
    origin : str
        What the limits come from.
    or_zero : bool
        Whether 0, which leaves an effect out, is allowed beside the range.
    of_either_sign : bool
        Whether the range is that of the absolute value.

    Examples
    --------
    >>> TANK_DIMENSION_M.checked(0.0272)
    0.0272
    >>> TANK_DIMENSION_M.checked(1e308)
    Traceback (most recent call last):
    ...
    ValueError: 0.0001 … 100 m, from a capillary to the tanks of gas carriers, which are 50 m long
    """

    low: float
    high: float
    units: str
    origin: str
    or_zero: bool = False
    of_either_sign: bool = False

    def __str__(self) -> str:
        sign, zero = "± " if self.of_either_sign else "", "0 or " if self.or_zero else ""
        units = f" {self.units}" if self.units else ""
        return f"{zero}{sign}{self.low:.10g} … {self.high:.10g}{units}, {self.origin}"

    def checked(self, value: float) -> float:
        """The value.

        Raises
        ------
        ValueError
            If it is not in the range; the message is the range.
        """
        size = abs(value) if self.of_either_sign else value
        # NaN is in no range
        if self.low <= size <= self.high or (self.or_zero and value == 0):
            return value
        raise ValueError(str(self))


TANK_DIMENSION_M: Final = PhysicalRange(
    1e-4, 100.0, "m", "from a capillary to the tanks of gas carriers, which are 50 m long"
)
MASS_KG: Final = PhysicalRange(
    1e-6, 1e7, "kg", "from a milligram to eight times what the largest shaking table carries, 1200 t"
)
LIQUID_DENSITY_KG_PER_M3: Final = PhysicalRange(
    30.0, 25_000.0, "kg/m³", "from hydrogen at its critical point, 31 kg/m³, to molten metals, 20 000 kg/m³"
)
SURFACE_TENSION_N_PER_M: Final = PhysicalRange(
    1e-6, 10.0, "N/m", "from liquids near their critical points to molten metals, 3 N/m", or_zero=True
)
KINEMATIC_VISCOSITY_M2_PER_S: Final = PhysicalRange(
    1e-9, 1000.0, "m²/s", "from liquid helium, 2e-8 m²/s, to far beyond silicone oils, 3 m²/s", or_zero=True
)
FILL_LEVEL: Final = PhysicalRange(1e-4, 0.9999, "", "from a film on the bottom to a film of air under the roof")
BEAM_DIMENSION_M: Final = PhysicalRange(
    1e-6, 1e4, "m", "from the thickness of a film to several times the longest span of a bridge, 2 km"
)
AMPLITUDE_OVER_HEIGHT: Final = PhysicalRange(
    1e-6, 1e4, "", "from what no sensor sees to a metre of stroke in the lowest of tanks"
)
FREQUENCY_HZ: Final = PhysicalRange(
    1e-3, 1e5, "Hz", "from far below the longest bridges, 0.04 Hz, to the resonances of accelerometers"
)
DAMPING_RATIO: Final = PhysicalRange(
    1e-9, 1.0, "", "from the best resonators to critical damping, beyond which no mode oscillates", or_zero=True
)
MODAL_MASS_KG: Final = PhysicalRange(
    1e-9, 1e9, "kg", "that of masses and a hundred times more, as the scale of the mode shape is free"
)
MODE_SHAPE: Final = PhysicalRange(
    1e-6, 1e6, "", "as the scale of a mode shape is free", or_zero=True, of_either_sign=True
)
STIFFNESS_N_PER_M: Final = PhysicalRange(
    1e-6,
    1e12,
    "N/m",
    "from below the cantilevers of force microscopes, 0.01 N/m, to beyond a bridge's pier",
)
FRICTION_N: Final = PhysicalRange(1e-9, 1e8, "N", "up to the weight of the largest mass, 10 000 t", or_zero=True)
DAMPING_KG_PER_S: Final = PhysicalRange(
    1e-9, 1e9, "kg/s", "up to critical damping of the largest mass at 8 Hz", or_zero=True
)

"""Forces that are sums of products of powers of the motion: laws that are found, and have no name.

    f = Σ_k c_k [±]|x/x₀|^i [±]|v/v₀|^j [±]|a/a₀|^l

with a sign wherever a factor is odd. The scales x₀, v₀, a₀ are sizes of the motion, so that every c_k is a force
in newton. Everything is in the table of a term, which is saved with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from sloshlab.errors import InputError
from sloshlab.twin.law import ACCELERATION, DIRECTION, DISPLACEMENT, VELOCITY, law
from sloshlab.twin.terms import PLACES, ForceKind, Term, register

# the laws are compiled, so their arguments are described once, in sloshlab.twin.law
# mypy: disable-error-code="no-untyped-def"

FloatArray = npt.NDArray[np.float64]
MOST_PRODUCTS: Final = 64


@dataclass(frozen=True)
class Factor:
    """A power of one motion.

    Attributes
    ----------
    power : int
        Of its size.
    is_odd : bool
        Whether it has the sign of the motion.
    """

    power: int = 0
    is_odd: bool = False

    @property
    def is_one(self) -> bool:
        """Whether it is no factor at all."""
        return self.power == 0 and not self.is_odd

    def of(self, motion: FloatArray) -> FloatArray:
        """Its values, shape (n,)."""
        return np.asarray(np.abs(motion) ** self.power * (np.sign(motion) if self.is_odd else 1.0))


@dataclass(frozen=True)
class Product:
    """A product of powers of displacement, velocity and acceleration."""

    displacement: Factor = Factor()
    velocity: Factor = Factor()
    acceleration: Factor = Factor()

    @property
    def factors(self) -> tuple[Factor, Factor, Factor]:
        """In the order of the motion."""
        return self.displacement, self.velocity, self.acceleration

    @property
    def jumps(self) -> bool:
        """Whether it jumps as the velocity turns, as dry friction does."""
        return self.velocity.is_odd and self.velocity.power == 0

    def of(self, motion: FloatArray, scales: Sequence[float]) -> FloatArray:
        """Its values along a motion of shape (n, 3), shape (n,)."""
        values = np.ones(motion.shape[0])
        for k, factor in enumerate(self.factors):
            if not factor.is_one:
                values = values * factor.of(motion[:, k] / scales[k])
        return values


# Table: how many products, three scales, the bound; of each product its coefficient, then power and sign of each
# factor.
@law
def _products(motion, parameters, memory, rates):
    n, bound = int(parameters[0]), parameters[4]
    total = 0.0
    for i in range(n):
        at = 5 + 7 * i
        value = parameters[at]
        for k in range(3):
            power, is_odd = int(parameters[at + 1 + 2 * k]), parameters[at + 2 + 2 * k] != 0.0
            if power == 0 and not is_odd:
                continue
            along = motion[DISPLACEMENT]
            if k == 1:
                along = motion[VELOCITY]
            elif k == 2:
                along = motion[ACCELERATION]
            along /= parameters[1 + k]
            if bound > 0.0:
                along = min(max(along, -bound), bound)
            size = abs(along)
            for _ in range(power):
                value *= size
            if is_odd:
                # at a turn of the velocity the engine decides which way friction acts
                if k == 1 and power == 0:
                    value *= motion[DIRECTION]
                elif along < 0.0:
                    value = -value
        total += value
    return total


def _kind(name: str, *, jumps: bool, uses_acceleration: bool) -> ForceKind:
    return register(
        ForceKind(
            name,
            PLACES,
            (),
            _products,
            dry_friction=jumps,
            uses_acceleration=uses_acceleration,
            equation="Σ c |x|^i |v|^j |a|^l, each with or without the sign of the motion",
        )
    )


_KINDS: Final = {
    (jumps, accelerates): _kind(
        f"sum_of_products{'_with_friction' * jumps}{'_of_acceleration' * accelerates}",
        jumps=jumps,
        uses_acceleration=accelerates,
    )
    for jumps in (False, True)
    for accelerates in (False, True)
}


def sum_of_products(
    place: str,
    products: Sequence[Product],
    coefficients_n: Sequence[float],
    scales: Sequence[float],
    *,
    bound: float = 0.0,
) -> Term:
    """A force that is a sum of products.

    Parameters
    ----------
    place : {"structure", "tank"}
    products : sequence of Product
    coefficients_n : sequence of float
        Force of each where the motion has its scale [N].
    scales : sequence of float
        Of displacement, velocity and acceleration.
    bound : float
        In scales, beyond which the motion counts as at it; zero for no bound.

    Raises
    ------
    InputError
        If there are too many products, or scales or coefficients are none.
    """
    numbers = np.array([*coefficients_n, *scales], np.float64)
    if not 0 < len(products) <= MOST_PRODUCTS or len(coefficients_n) != len(products):
        raise InputError("sum of products", got=f"{len(products)} products", allowed=f"1 … {MOST_PRODUCTS}")
    if len(scales) != 3 or not np.isfinite(numbers).all() or min(scales) <= 0:
        raise InputError("sum of products", got=f"scales {tuple(scales)}", allowed="three sizes of the motion")
    table = [float(len(products)), *scales, bound]
    for coefficient, product in zip(coefficients_n, products, strict=True):
        table.append(float(coefficient))
        for factor in product.factors:
            table += [float(factor.power), float(factor.is_odd)]
    jumps = any(product.jumps for product in products)
    accelerates = any(not product.acceleration.is_one for product in products)
    return _KINDS[jumps, accelerates](place=place, table=table)

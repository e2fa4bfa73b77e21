"""Laws that no vocabulary has a name for: products of powers of the motion, their formula and their words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product as combinations
from typing import Final

from sloshlab.twin.product_forces import Factor, Product

_MOTIONS: Final = ("x", "v", "a")
_SUPERSCRIPTS: Final = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_POWERS: Final = (
    (0, False),
    (0, True),
    (1, True),
    (1, False),
    (2, False),
    (2, True),
    (3, True),
    (4, False),
    (5, True),
)
"""Of the displacement, of a tank's acceleration; with and without its sign."""
_POWERS_OF_VELOCITY: Final = ((0, False), (0, True), (1, True), (1, False), (2, False), (2, True), (3, True))
_LINEAR: Final = ((1, True), (0, False)), ((0, False), (1, True)), ((0, False), (0, False))
"""What the baseline's own numbers do, and a constant."""


def library(block: str) -> list[Product]:
    """Products that a law may have: of displacement and velocity, in a tank of acceleration and velocity.

    Parameters
    ----------
    block : {"structure", "tank"}

    Examples
    --------
    >>> len(library("structure")), len(library("tank"))
    (60, 60)
    """
    found = []
    for first, velocity in combinations(_POWERS, _POWERS_OF_VELOCITY):
        if (first, velocity) in _LINEAR:
            continue
        place = {"acceleration" if block == "tank" else "displacement": Factor(*first)}
        found.append(Product(velocity=Factor(*velocity), **place))
    return found


def formula_of(products: Sequence[Product], coefficients_n: Sequence[float], scales: Sequence[float]) -> str:
    """A law in SI units, upward positive.

    Parameters
    ----------
    products : sequence of Product
    coefficients_n : sequence of float
        Forces at the scales [N].
    scales : sequence of float
        Of displacement, velocity, acceleration.

    Examples
    --------
    >>> cubic, friction = Product(Factor(3, True)), Product(Factor(1), Factor(0, True))
    >>> formula_of([cubic, friction], [-2.0, -0.5], [0.01, 1.0, 1.0])
    'f = −2·10⁶ N m⁻³ · x³ − 50 N m⁻¹ · |x| · sgn v'
    """
    parts: list[str] = []
    for product, coefficient in zip(products, coefficients_n, strict=True):
        powers = [factor.power for factor in product.factors]
        value = coefficient / math.prod(scale**power for scale, power in zip(scales, powers, strict=True))
        sign = "−" if value < 0 else "+" if parts else ""
        parts.append(f"{sign} {_number(abs(value))} {_unit(powers)} · {variables_of(product)}".strip())
    return "f = " + " ".join(parts).replace("− ", "−", 1 if parts[0].startswith("−") else 0)


def _number(value: float) -> str:
    """Three digits, powers of ten beyond four."""
    exponent = math.floor(math.log10(value)) if value > 0 else 0
    if -3 <= exponent < 4:
        return f"{value:.3g}"
    return f"{value / 10**exponent:.3g}·10{str(exponent).translate(_SUPERSCRIPTS)}"


def _unit(powers: Sequence[int]) -> str:
    """Of a coefficient before powers of displacement, velocity and acceleration."""
    metres, seconds = -sum(powers), powers[1] + 2 * powers[2]
    words = ["N"]
    for letter, exponent in (("s", seconds), ("m", metres)):
        if exponent:
            words.append(letter + (str(exponent).translate(_SUPERSCRIPTS) if exponent != 1 else ""))
    return " ".join(words)


def variables_of(product: Product) -> str:
    """A product as a person writes it, such as x² · v."""
    words = []
    for letter, factor in zip(_MOTIONS, product.factors, strict=True):
        if not factor.is_one:
            words.append(_power(letter, factor))
    return " · ".join(words)


def _power(letter: str, factor: Factor) -> str:
    """A power with or without the sign of its motion.

    Examples
    --------
    >>> [_power("x", Factor(*each)) for each in ((0, True), (1, True), (1, False), (2, False), (2, True))]
    ['sgn x', 'x', '|x|', 'x²', 'x |x|']
    """
    if factor.power == 0:
        return f"sgn {letter}"
    if factor.is_odd is bool(factor.power % 2):
        return letter + _raised(factor.power)
    if not factor.is_odd:
        return f"|{letter}|{_raised(factor.power)}"
    return f"{letter} |{letter}|{_raised(factor.power - 1)}"


def _raised(power: int) -> str:
    return "" if power == 1 else str(power).translate(_SUPERSCRIPTS)


def words_of(products: Sequence[Product]) -> str:
    """What kind of force a law is.

    Parameters
    ----------
    products : sequence of Product

    Examples
    --------
    >>> words_of([Product(Factor(5, True))]), words_of([Product(Factor(2), Factor(1, True))])
    ('a nonlinear spring', 'a damping that depends on the displacement')
    """
    kinds = []
    for product in products:
        others = [
            name
            for name, factor in zip(("displacement", "acceleration"), product.factors[::2], strict=True)
            if not factor.is_one
        ]
        if product.velocity.is_odd:
            own = "dry friction" if product.jumps else "damping"
            kinds.append(f"a {own} that depends on the {others[0]}" if others else f"a nonlinear {own}")
        elif product.velocity.power:
            kinds.append(f"a force that depends on the speed{f' and the {others[0]}' if others else ''}")
        else:
            kinds.append("a nonlinear spring" if others == ["displacement"] else f"a force of the {others[0]}")
    return " and ".join(dict.fromkeys(kinds))

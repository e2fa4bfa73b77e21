"""The parameters of a bouncing ball and their non-dimensional form (2.19)."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.errors import InputError, RigError
from sloshlab.rig import Rig
from sloshlab.rig import Twin as RigTwin
from sloshlab.toml_file import read_toml
from sloshlab.twin.tank_forces import BOUNCING_BALL
from sloshlab.twin.terms import Term
from sloshlab.twin.twin import Twin


@dataclass(frozen=True)
class BouncingBall:
    """A ball in a tank, F_b = k̂ (1 + α s²/(r₀ − |s|)) s + c ν on the tank (2.2–2.5).

    Attributes
    ----------
    radius_m : float
        r₀, less than half the height of the tank.
    stiffness_n_per_m, damping_kg_per_s : float
        k̂ and c.
    hardening_per_m : float
        α of the penalty that keeps the ball in the tank.
    beta : float
        Share of the liquid that is frozen to the tank; the rest is the ball's mass.
    damping_in_flight : float
        Share of c that acts while the ball touches nothing: 0, or 1 as (2.3) is printed.
    """

    radius_m: float
    stiffness_n_per_m: float
    damping_kg_per_s: float
    hardening_per_m: float
    beta: float
    damping_in_flight: float = 0.0

    @classmethod
    def from_rig(cls, rig: Rig) -> BouncingBall:
        """The ball of a rig file's [twin] table.

        Raises
        ------
        RigError
            If the rig's twin is no bouncing ball, or its parameters are not those of one.
        """
        if rig.twin is None or rig.twin.tank_model != "bouncing_ball":
            raise RigError(
                "rig: twin.tank_model",
                got="nothing" if rig.twin is None else rig.twin.tank_model,
                allowed="bouncing_ball",
                remedy="identify one with `sloshlab ball`",
            )
        # through the twin, so that the same bounds and defaults hold as in a simulation
        (term,) = Twin.from_rig(rig).tank_alone().terms
        names = [parameter.name for parameter in dataclasses.fields(cls)]
        return cls(**{name: term.values[name] for name in names})

    @classmethod
    def from_toml(cls, path: Path, rig: Rig) -> BouncingBall:
        """The ball of a file of `sloshlab ball`, in the tank of a rig.

        Raises
        ------
        InputError
            If the file cannot be read, holds no table of a ball, or its ball does not fit into the tank.
        """
        document = read_toml(path, f"ball {path}")
        try:
            table = RigTwin.model_validate(document["twin"])
        except (KeyError, ValidationError) as error:
            reason = " ".join(str(error).split())[:120]
            raise InputError(
                f"ball {path}", got=f"no table of a ball ({reason})", allowed="a ball.toml of `sloshlab ball`"
            ) from None
        return cls.from_rig(rig.model_copy(update={"twin": table}))

    @classmethod
    def from_non_dimensional(
        cls, ball: NonDimensionalBall, rig: Rig, omega_bar: float, *, damping_in_flight: float = 0.0
    ) -> BouncingBall:
        """The ball of another tank with the same non-dimensional parameters, for motion at ω̄ (2.19)."""
        stiffness, damping = _scales(rig, omega_bar)
        return cls(
            radius_m=ball.radius * rig.tank.height_m,
            stiffness_n_per_m=ball.stiffness * stiffness,
            damping_kg_per_s=ball.damping * damping,
            hardening_per_m=ball.hardening / rig.tank.height_m,
            beta=ball.beta,
            damping_in_flight=damping_in_flight,
        )

    def non_dimensional(self, rig: Rig, omega_bar: float) -> NonDimensionalBall:
        """Its parameters by (2.19), for motion at ω̄."""
        stiffness, damping = _scales(rig, omega_bar)
        return NonDimensionalBall(
            radius=self.radius_m / rig.tank.height_m,
            stiffness=self.stiffness_n_per_m / stiffness,
            damping=self.damping_kg_per_s / damping,
            hardening=self.hardening_per_m * rig.tank.height_m,
            beta=self.beta,
        )

    def term(self, rig: Rig) -> Term:
        """The force of the ball in the tank of a rig, for a twin.

        Raises
        ------
        InputError
            If the ball does not fit into the tank, or its parameters are impossible.
        """
        return BOUNCING_BALL(
            liquid_mass_kg=rig.liquid_mass_kg, height_m=rig.tank.height_m, **dataclasses.asdict(self)
        )

    def in_tank(self, rig: Rig) -> Twin:
        """The tank with the ball on a prescribed motion."""
        return Twin(None, (self.term(rig),))

    def on_structure(self, rig: Rig) -> Twin:
        """The structure of a rig with the ball in its tank.

        Raises
        ------
        RigError
            If the rig has no structure.
        """
        # without the rig's own tank model, or two liquids would act at once
        frozen = rig.model_copy(update={"twin": None})
        twin = Twin.from_rig(frozen)
        if twin.structure is None:
            raise RigError("rig", got="no [structure]", remedy="give the rig on which the decay was measured")
        return twin.with_term(self.term(rig))

    def twin_table(self) -> str:
        """The [twin] table of a rig file, as text."""
        values: dict[str, Any] = dataclasses.asdict(self)
        lines = ["[twin]", 'tank_model = "bouncing_ball"', "", "[twin.parameters]"]
        # `repr`: read again, every number is the same
        return "\n".join([*lines, *(f"{name} = {value!r}" for name, value in values.items())]) + "\n"


@dataclass(frozen=True)
class NonDimensionalBall:
    """r̄₀ = r₀/h, k̄ = k̂/(ρgSω̄²), c̄ = c/(ρS√(gh) ω̄), ᾱ = αh, β̄ = β (2.19); S is the area of the tank's base."""

    radius: float
    stiffness: float
    damping: float
    hardening: float
    beta: float


def _scales(rig: Rig, omega_bar: float) -> tuple[float, float]:
    """Scales of stiffness [N/m] and damping [kg/s]."""
    if not (math.isfinite(omega_bar) and omega_bar > 0):
        raise InputError("omega_bar", got=str(omega_bar), allowed="> 0")
    area = rig.liquid.density_kg_per_m3 * rig.tank.length_m * rig.tank.width_m
    # (2.19) as printed. Table 2.3 seems to state its numbers without ω̄² and ω̄; ω̄ = 1 reads it so.
    return area * GRAVITY_M_PER_S2 * omega_bar**2, area * rig.velocity_scale_m_per_s * omega_bar

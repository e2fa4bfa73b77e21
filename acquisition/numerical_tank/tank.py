"""What is to be computed: box, liquid, resolution. What is impossible is refused here, in one line."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal

from sloshlab.errors import InputError

MOST_PARTICLES: Final = 200_000
# the kernel reaches three spacings: in fewer layers the floor and the surface act on every particle
FEWEST_LAYERS: Final = 4
STANDARD_GRAVITY_M_PER_S2: Final = 9.81


@dataclass(frozen=True)
class Box:
    """Inside of the tank; the cross-section is length × height, the depth is along the waves' crests.

    Attributes
    ----------
    length_m, height_m, depth_m : float
        Horizontal, vertical, and across the computed plane.
    """

    length_m: float
    height_m: float
    depth_m: float = 1.0


@dataclass(frozen=True)
class LiquidColumn:
    """Where the liquid stands before it is let go: a rectangle in the lower left corner.

    Attributes
    ----------
    length_m, height_m : float
        Its sides; a length equal to that of the box is a filled tank.
    """

    length_m: float
    height_m: float


@dataclass(frozen=True)
class Liquid:
    """What the liquid is.

    Attributes
    ----------
    density_kg_per_m3 : float
        ρ₀.
    viscosity_m2_per_s : float
        ν, kinematic.
    speed_of_sound_m_per_s : float
        c₀ of the computation, about ten times the largest speed; not that of the real liquid.
    """

    # Surface tension and the gas are not computed. Tension by attraction between pairs is at odds with the shifts;
    # gas as heavier particles needs a fiftieth of the liquid's density for a stable step, which cushions every
    # impact seventeen to forty times too much.
    density_kg_per_m3: float = 998.2
    viscosity_m2_per_s: float = 1.0e-6
    # about ten times the largest speed of the liquid on the shaker
    speed_of_sound_m_per_s: float = 12.0


@dataclass(frozen=True)
class Numerics:
    """How it is computed. The defaults are what the verification cases decided.

    Attributes
    ----------
    smoothing_over_spacing : float
        h/dx.
    courant_number : float
        Δt c₀/h.
    artificial_viscosity : float
        α; adds α h c₀/8 to the viscosity of the liquid.
    density_diffusion : float
        δ.
    packing_strength : float
        Rate at which the density relaxes towards the packing, over the root mean square of the
        particles' speed divided by h.
    shift_strength : float
        Speed of the shift, over (2h ∇C) times the root mean square of the particles' speed.
    n_slow : int
        Steps between two corrections of the arrangement.
    skin_over_spacing : float
        What is added to the support when neighbours are listed.
    jitter : float
        Random displacement of the particles at the start, over the spacing.
    precision : {"double", "single"}
        Floating-point type of the particles.
    """

    # with 1.33 a standing wave is 5 % too fast; with 2.0 the liquid at rest is never quiet (force scatter 6 % of
    # the weight) and particles collapse onto their images
    smoothing_over_spacing: float = 1.5
    courant_number: float = 0.7
    # with artificial viscosity the dissipated work depends on the speed of sound, and twice as much on the spacing
    # (0.02: W̄ at 3 g is 0.86, 1.00 and 1.34 with h/12, h/16 and h/24, and 1.18 … 0.89 with c₀ = 10 … 22 m/s)
    artificial_viscosity: float = 0.0
    # takes the energy of impacts, which in the real liquid goes into motion too small for any particle
    # and the energy that the packing correction gives: 10 % of the shaker's work at 3 g, 38 % at 5.5 g with h/16
    density_diffusion: float = 0.1
    # the rate is (rms speed)/h times this: a quarter of it loses the volume within twenty cycles of 3 g, a half
    # holds
    packing_strength: float = 1.0
    # never without the packing correction: the liquid then fills the whole box within seconds of 4 g
    shift_strength: float = 1.0
    n_slow: int = 8
    skin_over_spacing: float = 0.8
    # what the seed decides: repeats differ by this disturbance of the particles at the start
    jitter: float = 0.01
    precision: Literal["double", "single"] = "double"


@dataclass(frozen=True)
class TankSetup:
    """Everything that determines a run apart from the motion of the tank.

    Attributes
    ----------
    box : Box
    column : LiquidColumn
    liquid : Liquid
    numerics : Numerics
    spacing_m : float
        Wanted distance of the particles; the real ones divide the column into whole numbers.
    gravity_m_per_s2 : float
        g, downward.
    seed : int
        Of the disturbance at the start.
    sampling_rate_hz : float, optional
        If given, the time step is shortened so that a whole number of steps makes a sample.
    """

    box: Box
    column: LiquidColumn
    spacing_m: float
    liquid: Liquid = Liquid()
    numerics: Numerics = Numerics()
    gravity_m_per_s2: float = STANDARD_GRAVITY_M_PER_S2
    seed: int = 0
    sampling_rate_hz: float | None = None

    def __post_init__(self) -> None:
        _check(self)

    @property
    def n_columns(self) -> int:
        """Particles along the length."""
        return max(round(self.column.length_m / self.spacing_m), 1)

    @property
    def n_layers(self) -> int:
        """Particles over the height."""
        return max(round(self.column.height_m / self.spacing_m), 1)

    @property
    def n_particles(self) -> int:
        """Number of fluid particles."""
        return self.n_columns * self.n_layers

    @property
    def particle_volume_m2(self) -> float:
        """V₀, per depth."""
        return self.column.length_m * self.column.height_m / self.n_particles

    @property
    def particle_mass_kg_per_m(self) -> float:
        """Mass of a particle per depth of the tank."""
        return self.liquid.density_kg_per_m3 * self.particle_volume_m2

    @property
    def liquid_mass_kg(self) -> float:
        """Mass of the liquid in the whole depth of the tank."""
        return self.particle_mass_kg_per_m * self.n_particles * self.box.depth_m

    @property
    def smoothing_length_m(self) -> float:
        """Smoothing length h of the kernel."""
        return self.numerics.smoothing_over_spacing * math.sqrt(self.particle_volume_m2)

    @property
    def step_s(self) -> float:
        """Time step: in it sound crosses at most `courant_number` smoothing lengths."""
        longest = self.numerics.courant_number * self.smoothing_length_m / self.liquid.speed_of_sound_m_per_s
        if self.sampling_rate_hz is None:
            return longest
        # shortened so that a whole number of steps makes a sample
        return 1 / (self.sampling_rate_hz * math.ceil(1 / (self.sampling_rate_hz * longest)))

    @property
    def steps_per_sample(self) -> int:
        """Steps in one sample; 1 where no sampling rate was asked for."""
        return 1 if self.sampling_rate_hz is None else round(1 / (self.sampling_rate_hz * self.step_s))

    @property
    def effective_viscosity_m2_per_s(self) -> float:
        """ν + α h c₀/8."""
        artificial = self.numerics.artificial_viscosity * self.smoothing_length_m
        return self.liquid.viscosity_m2_per_s + artificial * self.liquid.speed_of_sound_m_per_s / 8


def filled_tank(
    box: Box,
    filling_level: float,
    layers_per_height: int,
    *,
    liquid: Liquid | None = None,
    numerics: Numerics | None = None,
    seed: int = 0,
    sampling_rate_hz: float | None = None,
) -> TankSetup:
    """Describe a tank filled to a level.

    Parameters
    ----------
    box : Box
    filling_level : float
        Height of the liquid over height of the tank, 0 … 1.
    layers_per_height : int
        Spacing of the particles is the height of the tank over this.
    liquid : Liquid, optional
    numerics : Numerics, optional
    seed : int
        Of the disturbance at the start.
    sampling_rate_hz : float, optional
        If given, a whole number of steps makes a sample.

    Examples
    --------
    >>> tank = filled_tank(Box(0.1172, 0.0272, 0.078), 0.5, 16)
    >>> tank.n_particles, round(tank.liquid_mass_kg, 4)
    (552, 0.1241)
    """
    if not 0 < filling_level < 1:
        raise InputError("filling level", got=f"{filling_level}", allowed="0 < level < 1")
    if not 1 <= layers_per_height <= 10_000:
        raise InputError("layers of particles over the height", got=f"{layers_per_height}", allowed="1 … 10000")
    return TankSetup(
        box,
        LiquidColumn(box.length_m, filling_level * box.height_m),
        box.height_m / layers_per_height,
        liquid or Liquid(),
        numerics or Numerics(),
        seed=seed,
        sampling_rate_hz=sampling_rate_hz,
    )


_POSITIVE: Final = {
    "box": ("length_m", "height_m", "depth_m"),
    "column": ("length_m", "height_m"),
    "liquid": ("density_kg_per_m3", "speed_of_sound_m_per_s"),
    "numerics": ("skin_over_spacing", "n_slow"),
}
_RANGES: Final = {
    "smoothing_over_spacing": (1.0, 2.5),
    "courant_number": (0.01, 0.8),
    "artificial_viscosity": (0.0, 1.0),
    "density_diffusion": (0.0, 0.2),
    "shift_strength": (0.0, 4.0),
    "packing_strength": (0.0, 10.0),
    "jitter": (0.0, 0.2),
}


def _check(setup: TankSetup) -> None:
    for part, names in _POSITIVE.items():
        for name in names:
            _check_range(f"{part}.{name}", getattr(getattr(setup, part), name), math.ulp(0.0), math.inf)
    for name, (low, high) in _RANGES.items():
        _check_range(f"numerics.{name}", getattr(setup.numerics, name), low, high)
    _check_range("liquid.viscosity_m2_per_s", setup.liquid.viscosity_m2_per_s, 0.0, 1.0)
    _check_range("spacing_m", setup.spacing_m, math.ulp(0.0), math.inf)
    if setup.sampling_rate_hz is not None:
        _check_range("sampling_rate_hz", setup.sampling_rate_hz, 1.0, 1e6)
    _check_range("gravity_m_per_s2", setup.gravity_m_per_s2, 0.0, 1e4)
    if setup.numerics.precision not in ("single", "double"):
        raise InputError("numerics.precision", got=repr(setup.numerics.precision), allowed="single, double")
    _check_sizes(setup)


def _check_range(what: str, value: float, low: float, high: float) -> None:
    if not (math.isfinite(value) and low <= value <= high):
        allowed = "a finite number above 0" if math.isinf(high) else f"{low:g} … {high:g}"
        raise InputError(what, got=f"{value}", allowed=allowed)


def _check_sizes(setup: TankSetup) -> None:
    box, column = setup.box, setup.column
    for name in ("length_m", "height_m"):
        if getattr(column, name) > getattr(box, name):
            raise InputError(
                f"column.{name}",
                got=f"{getattr(column, name):g}",
                allowed=f"at most box.{name} = {getattr(box, name):g}",
            )
    # by floating-point numbers: the number of particles itself may be beyond anything that can be counted
    ratio = column.length_m / setup.spacing_m * (column.height_m / setup.spacing_m)
    # written so that a ratio that is not a number is refused, too
    if not ratio <= MOST_PARTICLES:
        raise InputError(
            "particles", got=f"{ratio:.0f}", allowed=f"at most {MOST_PARTICLES}", remedy="take a larger spacing"
        )
    if min(setup.n_layers, setup.n_columns) < FEWEST_LAYERS:
        raise InputError(
            "layers of particles in the liquid",
            got=f"{min(setup.n_layers, setup.n_columns)}",
            allowed=f"at least {FEWEST_LAYERS}",
            remedy="take a smaller spacing",
        )
    _check_sound(setup)


def _check_sound(setup: TankSetup) -> None:
    depth = setup.column.height_m
    # the linear equation of state holds as long as s stays below a few per cent, which is (speed/c₀)²
    slowest = 10 * math.sqrt(setup.gravity_m_per_s2 * depth)
    if setup.liquid.speed_of_sound_m_per_s < slowest:
        raise InputError(
            "liquid.speed_of_sound_m_per_s",
            got=f"{setup.liquid.speed_of_sound_m_per_s:g}",
            allowed=f"at least 10 √(g h) = {slowest:.3g}",
            remedy="a slower one would compress the liquid visibly",
        )

"""A rig as it is and as its laboratory believes it to be."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from sealed_trial.laboratory import kernel_layout as at
from sealed_trial.laboratory.cantilever import Beam, beam_modes
from sealed_trial.laboratory.system import System

FloatArray = npt.NDArray[np.float64]

FREQUENCY_TOLERANCE: Final = 0.02
DAMPING_TOLERANCE: Final = 0.20
MASS_TOLERANCE: Final = 0.01
GAIN_TOLERANCE: Final = 0.01

_NEVER_ZERO = (at.HYSTERESIS_YIELD, at.FRICTION_STRIBECK, at.SLOSHING_THRESHOLD, at.EFFECTIVE_MASS_FADE)


@dataclass(frozen=True)
class Tank:
    """Box [m], mass beyond the force cells without liquid and of the liquid [kg]."""

    height_m: float
    length_m: float
    width_m: float
    dry_mass_kg: float
    fill_level: float

    @property
    def liquid_mass_kg(self) -> float:
        """ρ α h l₁ l₂ of water [kg]."""
        return 1000.0 * self.fill_level * self.height_m * self.length_m * self.width_m


@dataclass(frozen=True)
class HiddenRig:
    """What the laboratory states, and by which factors reality differs.

    Attributes
    ----------
    kind : str
        'sdof', 'beam' or 'shaker'.
    tank : Tank
        As believed.
    beam : Beam or None
        As believed, the tip mass with liquid.
    n_modes : int
        Of the beam.
    stiffness_n_per_m, damping_kg_per_s, coulomb_n : float
        Of the SDOF rig, as believed.
    damping_ratios : tuple of float
        Of the beam, as believed.
    tank_damping_kg_per_s : float
        Of a viscous liquid as believed; 0 where it is believed to be frozen.
    chaos : float
        Standard deviation of the relative fluctuation of the liquid's damping.
    factors : dict
        Reality over belief: 'frequency_1' …, 'damping_1' …, 'mass_1' …, 'dry_mass', 'liquid_mass', 'coulomb',
        'tank_damping'. Missing ones are 1.
    """

    kind: str
    tank: Tank
    beam: Beam | None = None
    n_modes: int = 1
    stiffness_n_per_m: float = 0.0
    damping_kg_per_s: float = 0.0
    coulomb_n: float = 0.0
    damping_ratios: tuple[float, ...] = ()
    tank_damping_kg_per_s: float = 0.0
    chaos: float = 0.0
    factors: dict[str, float] = field(default_factory=dict)

    def factor(self, name: str) -> float:
        """Reality over belief."""
        return self.factors.get(name, 1.0)

    def with_factor(self, name: str, factor: float) -> HiddenRig:
        """The same rig with one reality changed by a factor."""
        return replace(self, factors={**self.factors, name: self.factor(name) * factor})

    @property
    def carried_mass_kg(self) -> float:
        """M_dry + m_l as they are [kg]."""
        return self.tank.dry_mass_kg * self.factor("dry_mass") + self.liquid_mass_kg

    @property
    def liquid_mass_kg(self) -> float:
        """As it is [kg]."""
        return self.tank.liquid_mass_kg * self.factor("liquid_mass")

    @property
    def tunable(self) -> dict[str, float]:
        """Names of the factors that a laboratory may retune, with what is normal."""
        names: dict[str, float] = {"dry_mass": MASS_TOLERANCE, "liquid_mass": MASS_TOLERANCE}
        if self.kind != "shaker":
            for k in range(1, self.n_modes + 1):
                names[f"frequency_{k}"] = FREQUENCY_TOLERANCE
                names[f"damping_{k}"] = DAMPING_TOLERANCE
                if self.kind == "beam":
                    names[f"mass_{k}"] = MASS_TOLERANCE
        if self.coulomb_n:
            names["coulomb"] = DAMPING_TOLERANCE
        if self.tank_damping_kg_per_s:
            names["tank_damping"] = DAMPING_TOLERANCE
        return names

    def places_m(self) -> FloatArray:
        """Accelerometers along the beam, from the root."""
        assert self.beam is not None
        return self.beam.length_m * np.array([0.25, 0.5, 0.75, 1.0])

    def base_parameters(self) -> FloatArray:
        """The kernel's parameters without any hidden effect."""
        parameters = np.zeros(at.N_PARAMETERS)
        parameters[list(_NEVER_ZERO)] = 1.0
        parameters[at.CARRIED_MASS] = self.carried_mass_kg
        parameters[at.LIQUID_MASS] = self.liquid_mass_kg
        parameters[at.TANK_VISCOUS] = self.tank_damping_kg_per_s * self.factor("tank_damping")
        parameters[at.FRICTION_UP] = parameters[at.FRICTION_DOWN] = self.coulomb_n * self.factor("coulomb")
        return parameters

    def system(self, compliance_rad_per_n_m: float = 0.0) -> System:
        """The rig as it is, with the compliance of the base's rotation where there is one."""
        if self.kind == "shaker":
            empty = np.zeros((0, 0))
            return System(empty, empty, empty, np.zeros(0), np.zeros(0), self.base_parameters())
        if self.kind == "sdof":
            mass = self.carried_mass_kg
            # the frequency that is off, not the stiffness: mass and stiffness are believed separately
            stiffness = self.stiffness_n_per_m * self.factor("frequency_1") ** 2
            damping = self.damping_kg_per_s * self.factor("damping_1")
            unity = np.ones((1, 1))
            return System(
                mass * unity,
                damping * unity,
                stiffness * unity,
                np.array([mass]),
                np.ones(1),
                self.base_parameters(),
            )
        return self._beam_system(compliance_rad_per_n_m)

    def _beam_system(self, compliance: float) -> System:
        assert self.beam is not None
        beam, n = self.beam, self.n_modes
        modes = beam_modes(beam, n, self.places_m())
        heavier = np.array([self.factor(f"mass_{k + 1}") for k in range(n)])
        masses = modes.mass_kg * heavier
        rates = 2 * math.pi * modes.frequency_hz * [self.factor(f"frequency_{k + 1}") for k in range(n)]
        ratios = np.array(self.damping_ratios) * [self.factor(f"damping_{k + 1}") for k in range(n)]
        mass, stiffness = np.diag(masses), np.diag(masses * rates**2)
        damping = np.diag(2 * ratios * masses * rates)
        base, shape = modes.base_kg, np.ones(n)
        if compliance:
            line, length = beam.mass_per_length_kg_per_m, beam.length_m
            inertia = line * length**3 / 3 + beam.tip_mass_kg * length**2
            spring = 1.0 / compliance
            # What the modes have of the inertia, Σ r²/m, stays what it is: more than all of it would be unstable.
            rocking = modes.rocking_kg_m * np.sqrt(heavier)
            mass = np.block([[mass, rocking[:, None]], [rocking[None, :], np.array([[inertia]])]])
            stiffness = np.block([[stiffness, np.zeros((n, 1))], [np.zeros((1, n)), np.array([[spring]])]])
            own = 2 * 0.01 * math.sqrt(spring * inertia)
            damping = np.block([[damping, np.zeros((n, 1))], [np.zeros((1, n)), np.array([[own]])]])
            base = np.append(base, line * length**2 / 2 + beam.tip_mass_kg * length)
            shape = np.append(shape, length)
        return System(mass, damping, stiffness, base, shape, self.base_parameters())

    def shapes_at_places(self, n_coordinates: int) -> FloatArray:
        """Deflection of every accelerometer's place per coordinate, shape (n_places, n_coordinates)."""
        assert self.beam is not None
        shapes = beam_modes(self.beam, self.n_modes, self.places_m()).shape
        if n_coordinates > self.n_modes:
            shapes = np.column_stack([shapes, self.places_m()])
        return shapes


def rig_text(rig: HiddenRig) -> str:
    """The rig file: beliefs only, in one layout for all."""
    tank = rig.tank
    lines = [
        "[tank]",
        f"height_m = {tank.height_m:.6g}",
        f"length_m = {tank.length_m:.6g}",
        f"width_m = {tank.width_m:.6g}",
        f"dry_mass_kg = {tank.dry_mass_kg:.6g}",
        "",
        "[liquid]",
        'name = "water"',
        "density_kg_per_m3 = 1000.0",
        "surface_tension_n_per_m = 0.0728",
        "kinematic_viscosity_m2_per_s = 1.0e-6",
        f"fill_level = {tank.fill_level:.6g}",
        "",
    ]
    if rig.kind == "sdof":
        lines += [
            "[structure]",
            'kind = "sdof"',
            f"mass_kg = {tank.dry_mass_kg:.6g}",
            f"stiffness_n_per_m = {rig.stiffness_n_per_m:.6g}",
            f"coulomb_force_n = {rig.coulomb_n:.6g}",
            f"damping_kg_per_s = {rig.damping_kg_per_s:.6g}",
            "",
        ]
    if rig.beam is not None:
        modes = beam_modes(rig.beam, rig.n_modes, rig.places_m())
        lines += [
            "[structure]",
            'kind = "beam"',
            f"length_m = {rig.beam.length_m:.6g}",
            f"width_m = {rig.beam.width_m:.6g}",
            f"thickness_m = {rig.beam.thickness_m:.6g}",
            f"frequencies_hz = {_listed(modes.frequency_hz)}",
            f"damping_ratios = {_listed(rig.damping_ratios)}",
            f"modal_masses_kg = {_listed(modes.mass_kg)}",
            f"tip_mode_shape = {_listed(np.ones(rig.n_modes))}",
            "",
        ]
    lines += ["[twin]", f'tank_model = "{"viscous" if rig.tank_damping_kg_per_s else "frozen"}"', ""]
    if rig.tank_damping_kg_per_s:
        lines += ["[twin.parameters]", f"damping_kg_per_s = {rig.tank_damping_kg_per_s:.6g}", ""]
    return "\n".join(lines)


def _listed(values: object) -> str:
    return "[" + ", ".join(repr(float(f"{value:.5g}")) for value in np.asarray(values, dtype=float)) + "]"


def drawn_rig(kind: str, generator: np.random.Generator) -> HiddenRig:
    """A rig of a kind with everything that belongs to a laboratory: beliefs, and how far they are off."""
    uniform = generator.uniform
    viscous = generator.random() < 0.45
    if kind == "sdof":
        rig = _drawn_sdof(generator)
        rate = math.sqrt(rig.stiffness_n_per_m / (rig.tank.dry_mass_kg + rig.tank.liquid_mass_kg))
    elif kind == "beam":
        rig = _drawn_beam(generator)
        assert rig.beam is not None
        rate = 2 * math.pi * float(beam_modes(rig.beam, 1, rig.places_m()).frequency_hz[0])
    else:
        height = float(np.round(uniform(0.025, 0.04), 4))
        tank = Tank(
            height, 0.1172, 0.078, float(np.round(uniform(0.5, 0.7), 3)), float(np.round(uniform(0.3, 0.7), 2))
        )
        rig, rate = HiddenRig("shaker", tank), 2 * math.pi * 10.0
    believed_w_bar = uniform(0.4, 1.2)
    fluctuation = uniform(0.0, 0.2)
    if viscous:
        damping = float(f"{rig.tank.liquid_mass_kg * rate * believed_w_bar / math.pi:.4g}")
        rig = replace(rig, tank_damping_kg_per_s=damping, chaos=fluctuation)
    factors = {name: 1 + tolerance * uniform(-1, 1) for name, tolerance in rig.tunable.items()}
    return replace(rig, factors=factors)


def wrongly_believed(rig: HiddenRig, generator: np.random.Generator) -> HiddenRig:
    """The same beliefs about a rig of which one or two numbers are off by two to three tolerances.

    Losses are smaller than believed: a loss that is larger by as much is one that is missing.
    """
    names = list(rig.tunable)
    wrong = generator.choice(names, min(len(names), int(generator.integers(1, 3))), replace=False)
    factors = dict(rig.factors)
    for name in map(str, wrong):
        is_loss = name.startswith(("damping", "coulomb", "tank_damping"))
        sign = -1.0 if is_loss or generator.random() < 0.5 else 1.0
        factors[name] = 1 + sign * rig.tunable[name] * generator.uniform(2.0, 3.0)
    return replace(rig, factors=factors)


def _drawn_sdof(generator: np.random.Generator) -> HiddenRig:
    uniform = generator.uniform
    height = float(np.round(uniform(0.05, 0.07), 4))
    tank = Tank(height, 0.1, 0.06, float(np.round(uniform(1.5, 2.6), 3)), float(np.round(uniform(0.35, 0.65), 2)))
    mass = tank.dry_mass_kg + tank.liquid_mass_kg
    frequency, ratio = uniform(5.2, 7.8), uniform(0.006, 0.015)
    stiffness = float(f"{mass * (2 * math.pi * frequency) ** 2:.5g}")
    damping = float(f"{2 * ratio * math.sqrt(stiffness * mass):.4g}")
    has_friction = generator.random() < 0.25
    coulomb = float(f"{stiffness * uniform(1e-4, 3e-4):.3g}") if has_friction else 0.0
    return HiddenRig("sdof", tank, stiffness_n_per_m=stiffness, damping_kg_per_s=damping, coulomb_n=coulomb)


def _drawn_beam(generator: np.random.Generator) -> HiddenRig:
    uniform = generator.uniform
    tank = Tank(
        0.0272, 0.1172, 0.078, float(np.round(uniform(0.28, 0.36), 3)), float(np.round(uniform(0.4, 0.65), 2))
    )
    length, thickness = float(np.round(uniform(0.68, 0.82), 2)), float(np.round(uniform(0.009, 0.011), 4))
    beam = Beam(length, 0.1, thickness, tank.dry_mass_kg + tank.liquid_mass_kg)
    n_modes = 2 if generator.random() < 0.5 else 3
    ratios = tuple(float(f"{value:.3g}") for value in uniform(0.7, 1.3, 3) * [0.0045, 0.009, 0.0176])[:n_modes]
    return HiddenRig("beam", tank, beam, n_modes, damping_ratios=ratios)

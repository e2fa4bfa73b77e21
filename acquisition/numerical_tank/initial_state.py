"""What a run starts from: particles at rest, and the numbers that do not change."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from acquisition.numerical_tank.kernel import SUPPORT, gradient_factor_at_zero, kernel, kernel_at_zero
from acquisition.numerical_tank.particles import Constants
from acquisition.numerical_tank.tank import TankSetup

FloatArray = NDArray[np.float64]

# correcting the density at rest as well makes noise in the force of 0.6–2 % of the weight
QUIET_SPEED: Final = 0.01
"""Root mean square speed, over √(g h), below which the density is not corrected."""
CROWDING: Final = 0.2
"""R of Sun et al. (2017)."""


def particles_at_rest(setup: TankSetup) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return x [m], z [m] and s = ln ρ/ρ₀ of the liquid at rest, slightly disturbed.

    Parameters
    ----------
    setup : TankSetup
    """
    step_x = setup.column.length_m / setup.n_columns
    step_z = setup.column.height_m / setup.n_layers
    x, z = np.meshgrid((np.arange(setup.n_columns) + 0.5) * step_x, (np.arange(setup.n_layers) + 0.5) * step_z)
    generator = np.random.default_rng(setup.seed)
    x, z = x.ravel(), z.ravel()
    # the hydrostatic pressure, so that nothing moves when time starts
    s = setup.gravity_m_per_s2 * (setup.column.height_m - z) / setup.liquid.speed_of_sound_m_per_s**2
    shift = setup.numerics.jitter * math.sqrt(setup.particle_volume_m2)
    return x + shift * generator.uniform(-1, 1, x.size), z + shift * generator.uniform(-1, 1, x.size), s


def constants_of(setup: TankSetup) -> Constants:
    """Return the numbers that the compiled loops take, in the precision of the run.

    Parameters
    ----------
    setup : TankSetup
    """
    real = np.float32 if setup.numerics.precision == "single" else np.float64
    h, numerics = setup.smoothing_length_m, setup.numerics
    spacing, speed = math.sqrt(setup.particle_volume_m2), setup.liquid.speed_of_sound_m_per_s
    values = {
        "unity": 1.0,
        "half": 0.5,
        "two": 2.0,
        "step": setup.step_s,
        "length": setup.box.length_m,
        "height": setup.box.height_m,
        "support": SUPPORT * h,
        "skin": numerics.skin_over_spacing * spacing,
        "volume": setup.particle_volume_m2,
        "smoothing": h,
        "speed_squared": speed**2,
        "gradient": setup.particle_volume_m2 * gradient_factor_at_zero(h),
        "peak": setup.particle_volume_m2 * kernel_at_zero(h),
        "viscous": 8 * setup.effective_viscosity_m2_per_s,
        # so that two particles at one place do not divide by zero
        "softening": 0.01,
        "diffusion": 2 * numerics.density_diffusion * h * speed,
        "quiet_speed": QUIET_SPEED * math.sqrt(setup.gravity_m_per_s2 * setup.column.height_m),
        "spread": numerics.shift_strength * 2 * h * numerics.n_slow * setup.step_s,
        "crowding": CROWDING,
        # below it the neighbours lie on a line and define no gradient
        "smallest_determinant": 0.2,
        "spacing_kernel": setup.particle_volume_m2 * float(kernel(spacing, h)),
        "lattice_packing": _lattice_packing(setup),
        # of a correction every n_slow steps, so that its rate does not depend on how often it is made
        "relaxation": numerics.packing_strength * numerics.n_slow * setup.step_s / h,
        "largest_speed": speed,
    }
    typed: dict[str, Any] = {name: real(value) for name, value in values.items()}
    return Constants(n=setup.n_particles, n_slow=int(numerics.n_slow), **typed)


def _lattice_packing(setup: TankSetup) -> float:
    """Σ V₀ W at a particle of the undisturbed lattice."""
    step_x = setup.column.length_m / setup.n_columns
    step_z = setup.column.height_m / setup.n_layers
    # five spacings each way hold the support of the widest kernel that is allowed, 2 × 2.5 spacings
    x, z = np.meshgrid(np.arange(-5, 6) * step_x, np.arange(-5, 6) * step_z)
    return setup.particle_volume_m2 * float(kernel(np.hypot(x, z), setup.smoothing_length_m).sum())

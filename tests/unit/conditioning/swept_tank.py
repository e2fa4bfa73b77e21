"""A tank swept from 5 Hz upward, written down in closed form for these tests."""

import numpy as np
import xarray as xr

RATE_HZ = 2000.0


def sweep_phase(time, octave_per_s=1 / 20):
    return 2 * np.pi * 5 * 2 ** (octave_per_s * time) / (octave_per_s * np.log(2))


def swept_tank(
    *,
    masses_kg=(0.37, 0.36),
    damping_kg_per_s=0.0,
    gains=None,
    delays_s=None,
    noise=0.0,
    configuration="empty",
    seed=1,
    duration_s=30.0,
    level_m_per_s2=15.0,
):
    """Two force cells that carry `masses_kg`, two roof accelerometers and the control.

    `gains` and `delays_s` by channel name; `noise` relative to each channel's RMS.
    """
    time = np.arange(0, duration_s, 1 / RATE_HZ)
    gains, delays_s = gains or {}, delays_s or {}
    random = np.random.default_rng(seed)

    def motion(name):
        """ü and u̇ of a slow sweep, u̇ ≈ a₀ sin φ/Ω up to (R ln 2)/Ω ≈ 1e-3, which only damping sees."""
        t = time - delays_s.get(name, 0.0)
        omega = 2 * np.pi * 5 * 2 ** (t / 20)
        return level_m_per_s2 * np.cos(sweep_phase(t)), level_m_per_s2 * np.sin(sweep_phase(t)) / omega

    def measured(name, values, quantity):
        values = gains.get(name, 1.0) * values
        values = values + noise * values.std() * random.standard_normal(values.size)
        return ("time", values, {"quantity": quantity, "units": {"force": "N"}.get(quantity, "m s-2")})

    variables = {}
    for i, mass_kg in enumerate(masses_kg, start=1):
        name = f"force_cell_{i}"
        acceleration, velocity = motion(name)
        variables[name] = measured(name, mass_kg * acceleration + damping_kg_per_s * velocity, "force")
    for name in ("acceleration_roof_1", "acceleration_roof_2", "acceleration_control"):
        variables[name] = measured(name, motion(name)[0], "acceleration")
    attributes = {"run_id": f"{configuration}_{seed}", "configuration": configuration}
    return xr.Dataset(variables, coords={"time": time}, attrs=attributes)

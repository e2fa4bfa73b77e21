"""
# β, and why its sign

β says how much more mass than frozen liquid the tank feels: the fundamental of its force is
that of M_dry + (1 + β) m_l.
Mostly it is negative.
Does the liquid weigh less?

It does not: it moves against the tank.
A mass m on a spring of frequency f₁ and damping ζ answers a shaken tank with the apparent mass

    m (1 + 2jζr)/(1 − r² + 2jζr),    r = f/f₁

which is more than m below f₁ and less than m above it.
So 1 + β is its real part, over m.
"""

import numpy as np
import xarray as xr
from matplotlib import pyplot as plt

import sloshlab as sl

rig = sl.Rig.from_toml_text("""
[tank]
height_m = 0.0272
length_m = 0.1172
width_m = 0.0780
dry_mass_kg = 0.61
[liquid]
density_kg_per_m3 = 1000.0
fill_level = 0.5
""")

# %%
# ## A sweep of such a tank
#
# The liquid is a mass on a spring at 9 Hz that loses a tenth.
# The sweep of 5 to 20 Hz is slow enough for the answer to be the steady one, which is written down from the
# formula.
# W̄ and β are what the analysis makes of it.
F1, ZETA, RATE_HZ, DURATION_S, START_HZ = 9.0, 0.10, 512.0, 240.0, 5.0
octaves_per_s = 2.0 / DURATION_S


def apparent_share(frequency_hz):
    r = np.asarray(frequency_hz) / F1
    return (1 + 2j * ZETA * r) / (1 - r**2 + 2j * ZETA * r)


time = np.arange(round(DURATION_S * RATE_HZ)) / RATE_HZ
frequency = START_HZ * 2.0 ** (octaves_per_s * time)
phase = 2 * np.pi * frequency / (octaves_per_s * np.log(2))
turning = 3.0 * 9.81 * np.exp(1j * phase)
force = (rig.tank.dry_mass_kg + rig.liquid_mass_kg * apparent_share(frequency)) * turning
run = xr.Dataset(
    {
        "force_cell_1": ("time", force.real, {"units": "N", "quantity": "force"}),
        "acceleration_roof_1": ("time", turning.real, {"units": "m s-2", "quantity": "acceleration"}),
    },
    {"time": ("time", time, {"units": "s"})},
    {
        "sloshlab_format": "1",
        "run_id": "mass on a spring",
        "experiment": "shaker_sweep",
        "configuration": "sloshing",
        "rig": "rig.toml",
        "sampling_rate_hz": RATE_HZ,
        "start_time_utc": "2026-01-01T00:00:00Z",
        "sweep_start_hz": START_HZ,
        "sweep_rate_octave_per_s": octaves_per_s,
    },
)
windows = sl.analyse_sweep(run, rig).windows
closed_form = apparent_share(windows["frequency_hz"]).real - 1
largest_error = float(np.abs(windows["beta"] - closed_form).max())
print(f"largest difference between β and the closed form: {largest_error:.1e}")

# %%
# Below its own frequency the liquid swings further than the tank, and β > 0.
# Above it swings against the tank, and β < 0.
# Far above it stays where it is, and β comes to −1 from below: the tank moves alone.
figure, axes = plt.subplots(figsize=(7, 3.8), layout="constrained")
axes.plot(windows["frequency_hz"], windows["beta"], "o", ms=4, label="from the recording")
axes.plot(windows["frequency_hz"], closed_form, "k-", lw=0.9, label="closed form")
axes.axhline(0, color="0.6", lw=0.8)
axes.axvline(F1, color="0.6", lw=0.8, ls=":")
axes.set(xlabel="frequency [Hz]", ylabel="β")
axes.legend()
plt.show()

# %%
# ## And in a liquid that was computed
#
# The [numerical tank](../../numerical_tank.md) has no spring and knows no β.
# But a liquid that is thrown comes back after a time of its own: the harder it is thrown the later.
# If it strikes in phase with the acceleration, β > 0.
# Shaken faster, it comes too late, and β < 0.
# At 6 g the sign changes near 14 Hz; at 3 g it does below 10 Hz.
from pathlib import Path

raw_data = Path("../../raw_data")  # in docs/gallery of a checkout
numerical = raw_data / "numerical_tank" / "shaker"
names = ("frozen_3.00g", "sweep_1.50g", "sweep_3.00g", "sweep_6.00g")
files = [numerical / f"fill_0.50_{name}.nc" for name in names]
recorded = sl.analyse_sweep(files, numerical / "rig_fill_0.50.toml", keep_signals=False).windows
figure, axes = plt.subplots(figsize=(7, 3.8), layout="constrained")
means = {}
for run_id, of_run in recorded.groupby("run"):
    axes.plot(of_run["frequency_hz"], of_run["beta"], ".", label=run_id)
    for low_hz, high_hz in ((10, 13), (16, 20)):
        inside = of_run["frequency_hz"].values
        means[run_id, low_hz] = float(of_run["beta"].values[(inside > low_hz) & (inside < high_hz)].mean())
axes.axhline(0, color="0.6", lw=0.8)
axes.set(xlabel="frequency [Hz]", ylabel="β")
axes.legend()
plt.show()
print(*(f"{run_id}, from {low_hz} Hz: β = {mean:+.2f}" for (run_id, low_hz), mean in means.items()), sep="\n")

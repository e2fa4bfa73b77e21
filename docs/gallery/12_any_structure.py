"""
# Without a tank: work of any damper

Work per cycle is the area of a loop; that needs one force and one motion, and no tank.
A damper in a testing machine, swept from 1 to 8 Hz, is written here in closed form.
"""

import numpy as np
import xarray as xr
from matplotlib import pyplot as plt

import sloshlab as sl

# %%
# A viscous damper of 900 N s/m beside a spring of 20 kN/m, driven at 0.2 g.
DAMPING, STIFFNESS, RATE_HZ, DURATION_S, START_HZ = 900.0, 2.0e4, 500.0, 240.0, 1.0
octaves_per_s = 3.0 / DURATION_S
time = np.arange(round(DURATION_S * RATE_HZ)) / RATE_HZ
omega = 2 * np.pi * START_HZ * 2.0 ** (octaves_per_s * time)
phase = omega / (octaves_per_s * np.log(2))
amplitude = 0.2 * 9.81 / omega**2
# u = −u₀ cos φ, and u₀ falls with the square of the frequency
displacement = -amplitude * np.cos(phase)
velocity = amplitude * omega * np.sin(phase) + 2 * octaves_per_s * np.log(2) * amplitude * np.cos(phase)
run = xr.Dataset(
    {
        "force_damper": (
            "time",
            STIFFNESS * displacement + DAMPING * velocity,
            {"units": "N", "quantity": "force"},
        ),
        "displacement_machine": ("time", displacement, {"units": "m", "quantity": "displacement"}),
    },
    {"time": ("time", time, {"units": "s"})},
    {
        "sloshlab_format": "1",
        "run_id": "damper",
        "experiment": "other",
        "configuration": "empty",
        "rig": "",
        "sampling_rate_hz": RATE_HZ,
        "start_time_utc": "2026-01-01T00:00:00Z",
    },
)
windows = sl.analyse_sweep(run, force="force_damper", displacement="displacement_machine", p=3, m=6).windows

# %%
# In steady motion W = πcΩu₀².
# The spring, whose force is up to sixteen times that of the damper, does no work.
closed_form = np.pi * DAMPING * 2 * np.pi * windows["frequency_hz"] * windows["amplitude_m"] ** 2
error = float(np.abs(windows["work_j"] / closed_form - 1).max())
figure, axes = plt.subplots(figsize=(7, 3.8), layout="constrained")
axes.loglog(windows["frequency_hz"], windows["work_j"], "o", ms=4, label="from the recording")
axes.loglog(windows["frequency_hz"], closed_form, "k-", lw=0.9, label="πcΩu₀²")
axes.set(xlabel="frequency [Hz]", ylabel="work per cycle [J]", xticks=[1, 2, 4, 8], xticklabels=[1, 2, 4, 8])
axes.minorticks_off()
axes.legend()
plt.show()
print(f"largest difference: {100 * error:.2f} %")

"""
# From sweeps to a map

A tank on a shaker, swept from 5 to 20 Hz at ten levels.
How much energy does the liquid take per cycle, for every frequency and amplitude?
"""

from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

import sloshlab as sl

raw_data = Path("../../raw_data")  # in docs/gallery of a checkout
runs = sorted((raw_data / "shaker").glob("fill_0.50_*.nc"))
sweep = sl.analyse_sweep(runs, rig=raw_data / "shaker" / "rig_fill_0.50.toml")
print(*sweep.summary, sep="\n")

# %%
# Every window is the mean of twelve cycles: the area of the loop of force over displacement.
# W̄ = W/(m_l u₀²Ω²) compares it with the kinetic energy that the liquid has with the tank.
strongest = sweep.windows.isel(window=sweep.windows["w_bar"].values.argmax())
figure, (left, right) = plt.subplots(1, 2, figsize=(9.4, 4.4), layout="constrained")
sweep.plot.map("w_bar", ax=left)
sweep.plot.loop(strongest, ax=right)
plt.show()

# %%
# ## How far off is it?
#
# These recordings are of a virtual rig whose liquid follows a [known law](../../virtual_laboratory.md);
# force cells, accelerometers and their converters are imperfect, and so is what the rig file believes.
from acquisition.virtual_laboratory.liquid_law import dissipated_work

found = sweep.maps["w_bar"]
law = dissipated_work(found["omega_bar"].values[:, None], found["u_bar"].values[None, :], 0.5)
measured = np.isfinite(found.transpose("omega_bar", "u_bar").values)
error = (found.transpose("omega_bar", "u_bar").values - law)[measured]
map_error = np.sqrt(np.mean(error**2) / np.mean(law[measured] ** 2))
print(f"error of the map over the measured region: {100 * map_error:.1f} % (RMS)")

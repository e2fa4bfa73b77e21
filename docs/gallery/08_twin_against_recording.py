"""
# A twin against a recording

A tank on a guide between springs is let go 64 mm below its rest.
The twin of its rig file has the springs, friction and damping of the guide, and a liquid that is frozen.
One recording was made with such a liquid, and one with liquid that moves, that of the
[numerical tank](../../numerical_tank.md).
"""

from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

import sloshlab as sl

raw_data = Path("../../raw_data")  # in docs/gallery of a checkout
guide = raw_data / "numerical_tank" / "sdof"
simulations = {
    name: sl.simulate(guide / "rig_sdof.toml", guide / f"decay_{name}.nc") for name in ("frozen", "sloshing")
}
figure, panels = plt.subplots(1, 2, figsize=(9.4, 4), layout="constrained", sharey=True)
for axes, (name, simulation) in zip(panels, simulations.items(), strict=True):
    simulation.plot.channel("displacement_tank", ax=axes)
    axes.set_title(f"liquid {name}")
plt.show()

# %%
# With frozen liquid they nearly agree: the guide loses a little less than its rig file believes, and its
# springs are 1.6 % softer.
# With liquid that moves the recording dies out long before the simulation does.
# What is missing there is the liquid.
shares = {}
for name, simulation in simulations.items():
    recorded = sl.open_recording(guide / f"decay_{name}.nc")["displacement_tank"]
    n_samples = recorded.sizes["time"]
    late = slice(n_samples // 2, None)
    shares[name] = float(recorded[late].std() / simulation.recording["displacement_tank"][late].std())
    print(f"{name:<9} motion left in the second half, recorded over simulated: {shares[name]:.2f}")

# %%
# ## The frequency in closed form
#
# Frozen, the twin is one mass on springs: f = √(K/M)/2π.
# Friction stops it, but does not change its frequency.
rig = sl.Rig.from_toml(guide / "rig_sdof.toml")
closed_form_hz = np.sqrt(3808.8 / (2.061 + rig.liquid_mass_kg)) / (2 * np.pi)
position = simulations["frozen"].recording["displacement_tank"].values
rising = np.flatnonzero((position[:-1] < 0) & (position[1:] >= 0))
step_s = float(simulations["frozen"].recording["time"].diff("time").mean())
crossings_s = step_s * (rising + position[rising] / (position[rising] - position[rising + 1]))
found_hz = 1 / np.diff(crossings_s[:10]).mean()
print(f"closed form {closed_form_hz:.4f} Hz, simulated {found_hz:.4f} Hz")

"""
# The damping of a beam, three ways

A tank at the tip of a clamped beam is bent down and let go.
ζ is read from the decay by the logarithmic decrement, from the envelope of the analytic signal, and by
fitting a decaying sine to stretches of it.
Where all three agree, the number is of the beam and not of the method.
"""

from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

import sloshlab as sl

raw_data = Path("../../raw_data")  # in docs/gallery of a checkout
beam = raw_data / "numerical_tank" / "beam"
runs = [beam / "decay_frozen.nc", *sorted(beam.glob("decay_sloshing_*.nc"))]
found = sl.analyse_beam(runs, beam / "rig_beam.toml")
print(*found.summary, sep="\n")

# %%
# With the liquid frozen, damping is the same at every amplitude, and the three readings agree.
# With the liquid free it is ten times that near 3 g, where the liquid is thrown from floor to roof.
frozen = {}
for reading in found.experiment.free_runs[0].first_decay.readings:
    frozen[reading.method] = 100 * float(np.median(reading.damping_ratio[reading.used]))
    print(f"frozen, {reading.method}: ζ = {frozen[reading.method]:.4f} %")
names = [run.name for run in found.experiment.free_runs]
figure, panels = plt.subplots(1, 2, figsize=(9.4, 4.2), layout="constrained")
for axes, name in zip(panels, names[:2], strict=True):
    found.plot.decay(name, ax=axes)
plt.show()

# %%
# The liquid is chaotic: three releases from one deflection do not decay alike.
# Repeats show how far to trust one.
figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
found.plot.damping(ax=axes)
plt.show()

"""
# A network, and its ceiling

A small network learns the force of the liquid from the velocity of the tank.
How good can it become?
Not better than the liquid repeats itself: what the motion does not decide, no model of the motion can know.
"""

from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

import sloshlab as sl

raw_data = Path("../../raw_data")  # in docs/gallery of a checkout
tank = raw_data / "numerical_tank" / "shaker"
repeats = [tank / f"fill_0.50_sweep_3.00g{again}.nc" for again in ("", "_repeat_2", "_repeat_3")]

# %%
# ## Training
#
# Two sweeps train, one validates: it decides when to stop.
# The model has 20 past velocities and 8 neurons, a tenth of the model of `make rom`, so that this page is
# made in seconds.
model = sl.train(
    [tank / "fill_0.50_sweep_2.00g.nc", tank / "fill_0.50_sweep_4.00g.nc", tank / "fill_0.50_sweep_1.50g.nc"],
    tank / "rig_fill_0.50.toml",
    still=tank / "fill_0.50_frozen_3.00g.nc",
    delays=20,
    neurons=8,
    epochs=8,
)

# %%
# ## The ceiling
#
# Three sweeps at 3 g have one motion, and three forces.
# Each is simulated by the model, which saw none of them; and each is "predicted" by another of them,
# brought to the same cycles.
# A model that knew the mean of very many repeats would err by 1/√2 of what one repeat does: that is the
# ceiling.
from pipelines.inputs.recordings import run_sources
from pipelines.liquid_model.training_runs import signals_of, sloshing_run
from sloshlab.reduced_order_model.fit_quality import fit_quality
from sloshlab.reduced_order_model.repeat_ceiling import matched_repeats

of_training, rate_hz = model.trained.runs, model.model.sampling_rate_hz
signals = [
    signals_of(sloshing_run(source, of_training.still.reference)[0], of_training.rig, of_training.dry)
    for source in run_sources(repeats)
]
first, *others = signals
matched = [matched_repeats(first, other, rate_hz) for other in others]
simulated = model.model.simulate(first.at_rate(rate_hz).velocity_m_per_s)
fits = {
    "this model": fit_quality(matched[0].force_n, simulated).fit_percent,
    "a repeat in its place": np.mean([pair.fit().fit_percent for pair in matched]),
    "the ceiling": np.mean([pair.fit_of_ideal_model().fit_percent for pair in matched]),
}
print(*(f"{name:<22} fit {fit:5.1f} %" for name, fit in fits.items()), sep="\n")

# %%
# Five cycles of the test run: the force of the liquid beyond that of frozen liquid, as measured, as a
# repeat has it in the same cycles, and as the network says.
# What the two recordings have in common is what there is to learn.
pair, time = matched[0], np.arange(simulated.size) / rate_hz
middle = pair.cycle.max() // 2
shown = (pair.cycle >= middle) & (pair.cycle < middle + 5)
figure, axes = plt.subplots(figsize=(9, 4), layout="constrained")
for values, style, label in (
    (pair.force_n, {"color": "0.75", "lw": 2.5}, "measured"),
    (pair.other_force_n, {"color": "C0", "lw": 1.0}, "repeat"),
    (simulated, {"color": "C3", "lw": 1.2}, "network"),
):
    axes.plot(time[shown], values[shown], label=label, **style)
axes.set(xlabel="time [s]", ylabel="Δf [N]")
axes.legend(ncols=3)
plt.show()

"""
# A ball in place of the liquid

The cheapest model of a liquid that is thrown against the roof:
a ball of nearly its mass that bounces between floor and roof on springs and dampers.
Five numbers.
Where does it hold?

The ball is that of Table 2.3 of the [source](../../references.md), read as [its
page](../../bouncing_ball.md) explains.
"""

import numpy as np
from matplotlib import pyplot as plt
from scipy.integrate import trapezoid

import sloshlab as sl
from acquisition.virtual_laboratory.liquid_law import dissipated_work
from sloshlab.bouncing_ball.ball import BouncingBall, NonDimensionalBall
from sloshlab.bouncing_ball.harmonic_response import HarmonicRun, hysteresis, w_bar_at, work_per_cycle

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
table_2_3 = NonDimensionalBall(radius=0.3342, stiffness=25.28, damping=3.34, hardening=52.12, beta=0.0021)
ball = BouncingBall.from_non_dimensional(table_2_3, rig, 1.0, damping_in_flight=1.0)

# %%
# ## One loop
#
# The area of the loop of force over displacement is the work of a cycle.
# The engine that integrates the ball counts the same energy in another way, as what the force does at every
# step.
# Both are means of twenty cycles.
scale_hz = rig.frequency_scale_rad_per_s / (2 * np.pi)
amplitude_m, frequency_hz = 0.25 * rig.tank.height_m, 4.0 * scale_hz
run = HarmonicRun(20, 12, 80)
displacement, force = hysteresis(ball, rig, amplitude_m, frequency_hz)
area = -trapezoid(force, displacement) / 20
work, _ = work_per_cycle(ball, rig, amplitude_m, frequency_hz)
print(f"area of the loop {1e3 * area:.3f} mJ, work counted {1e3 * work:.3f} mJ")

# %%
# ## At and away from the frequency for which it was tuned
#
# At ω̄ = 4 the ball follows the law of the [virtual rig](../../virtual_laboratory.md).
# Elsewhere it does not: the ball has one way to bounce, and a liquid has many.
# That is why there is a network.
u_bar = np.linspace(0.1, 0.36, 6)
figure, (left, right) = plt.subplots(1, 2, figsize=(9.4, 4.6), layout="constrained")
left.plot(1e3 * displacement, force, lw=0.9)
left.set(xlabel="displacement [mm]", ylabel="force of the liquid on the tank [N]", title="ω̄ = 4, ū = 0.25")
errors = {}
for colour, omega_bar in zip(("C0", "C1", "C2"), (2.5, 4.0, 5.5), strict=True):
    of_ball = w_bar_at(ball, rig, np.full(u_bar.shape, omega_bar), u_bar, run)
    of_law = dissipated_work(omega_bar, u_bar, 0.5)
    errors[omega_bar] = float(np.sqrt(np.mean((of_ball - of_law) ** 2) / np.mean(of_law**2)))
    right.plot(u_bar, of_law, color=colour, label=f"law, ω̄ = {omega_bar:g}")
    right.plot(u_bar, of_ball, "o--", ms=4, lw=0.8, color=colour, label=f"ball, ω̄ = {omega_bar:g}")
right.set(xlabel="ū", ylabel="W̄")
figure.legend(*right.get_legend_handles_labels(), loc="outside lower right", ncols=3, frameon=False)
plt.show()
print(*(f"ω̄ = {omega_bar:g}: error of W̄ {100 * error:.0f} %" for omega_bar, error in errors.items()), sep="\n")

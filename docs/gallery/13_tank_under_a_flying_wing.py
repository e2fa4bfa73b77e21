"""
# A tank under a flying wing

mAEWing1 is a flying wing of 6.7 kg whose short-period motion and first bending flutter together.
A tank of 1.4 kg hangs below its centre of mass: how does it change the flutter,
if its liquid is frozen, and if it sloshes sideways?
"""

from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

from sloshlab.aeroelastic.generalised_forces import generalised_forces, usual_reduced_frequencies
from sloshlab.aeroelastic.rational_roger import roger_fit
from sloshlab.aeroelastic.root_locus import root_locus
from sloshlab.aircraft.flight_stability import flight_system
from sloshlab.aircraft.lifting_surfaces import lifting_surfaces
from sloshlab.aircraft.model import load_model

model = load_model(Path("../../raw_data/aircraft/maewing1/case_1.toml"))
print(f"{model.structure.n_modes} modes, the first at {model.structure.frequencies_hz[0]:.2f} Hz")
print(f"{model.liquid_mass_kg:.2f} kg of liquid; {model.structure.rigid_mass[0, 0]:.2f} kg without it")

# %%
# ## Forces of the air
#
# The surfaces are divided into boxes; the doublet lattice gives the pressure on each
# by the motion of all, at reduced frequencies k = ωb/U.
# Rational functions of k make them equations in time.
surfaces = lifting_surfaces(model.structure, n_boxes=450)
k = usual_reduced_frequencies(1.3, 15)
forces = generalised_forces(surfaces.boxes, surfaces.motion, k, semi_chord_m=surfaces.semi_chord_m, mach=0.0)
air = roger_fit(k, forces.motion, semi_chord_m=surfaces.semi_chord_m)
print(f"{surfaces.boxes.n} boxes; rational functions {100 * air.quality.rms:.2f} % RMS off")

# %%
# ## Root loci
#
# Every root is followed over the speed. Flutter is where one crosses to the right.
figure, (locus_axes, damping_axes) = plt.subplots(1, 2, figsize=(8, 3.6), layout="constrained")
flutter = {}
for colour, liquids in zip(("tab:blue", "tab:orange"), ("frozen", "lateral"), strict=True):
    system = flight_system(model, air, liquids, density_kg_per_m3=model.density_kg_per_m3)
    locus = root_locus(system.matrix_at, np.linspace(15, 38, 47), system.names, rigid=system.rigid)
    flutter[liquids] = locus.flutter
    pole = locus.pole_rad_per_s[:, locus.origin.index(locus.flutter.origin)]
    label = f"{liquids}: {locus.flutter.speed_m_per_s:.2f} m/s"
    locus_axes.plot(pole.real, pole.imag, color=colour, label=label)
    damping_axes.plot(locus.speed_m_per_s, -100 * pole.real / abs(pole), color=colour, label=label)
locus_axes.axvline(0, color="black", linewidth=0.8)
locus_axes.set_xlabel("growth Re s [1/s]")
locus_axes.set_ylabel("frequency Im s [rad/s]")
damping_axes.axhline(0, color="black", linewidth=0.8)
damping_axes.set_xlabel("speed U [m/s]")
damping_axes.set_ylabel("damping ratio ζ [%]")
damping_axes.legend()
plt.show()

# %%
# Sloshing masses swing nearly freely at this frequency: the aircraft is lighter in pitch,
# flutters a little earlier and a little faster.
# The source of these experiments found −0.8 % and +1.2 % on an aircraft of the same shape.
speed = flutter["lateral"].speed_m_per_s / flutter["frozen"].speed_m_per_s - 1
frequency = flutter["lateral"].frequency_rad_per_s / flutter["frozen"].frequency_rad_per_s - 1
print(f"{100 * speed:+.2f} % in speed, {100 * frequency:+.2f} % in frequency")

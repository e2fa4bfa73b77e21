"""
# From the shaker to flutter

A tank of 27 mm is shaken in a laboratory; a flying wing has one of 130 mm under its centre of mass.
Recordings of the first become a model of the second:
beyond the flutter speed the aircraft with frozen liquid diverges, with the liquid free it does not.
"""

from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

import sloshlab as sl

raw_data = Path("../../raw_data")  # in docs/gallery of a checkout
shaker = raw_data / "numerical_tank" / "shaker"

# %%
# ## A model of the laboratory's tank
#
# Sweeps at three levels train a small network, one between them decides when to stop.
# It says the force of the liquid from the velocity of the tank; 128 Hz are enough for the frequencies of flutter.
levels = ("0.50", "1.00", "4.00", "2.00")
trained = sl.train(
    [shaker / f"fill_0.50_sweep_{level}g.nc" for level in levels],
    shaker / "rig_fill_0.50.toml",
    still=shaker / "fill_0.50_frozen_3.00g.nc",
    delays=20,
    neurons=10,
    rate_hz=128.0,
    epochs=10,
)
rom = trained.model

# %%
# ## The same liquid in the aircraft's tank
#
# Equal ω̄ = Ω/√(g/h) and v̄ = v/√(gh) have equal W̄: times and velocities grow with √h, forces with the mass.
# What that law may be wrong by was computed with a numerical tank of several sizes.
from sloshlab.aircraft.model import load_model
from sloshlab.reduced_order_model.tank_scaling import TankScaling
from sloshlab.rig import Liquid, Rig, Tank

aircraft = load_model(raw_data / "aircraft" / "maewing1" / "case_1.toml")
box = aircraft.tanks[0].box
factors = TankScaling.of_facts(
    rom.facts,
    Rig(
        tank=Tank(height_m=box.height_m, length_m=box.length_m, width_m=box.width_m, dry_mass_kg=1.0),
        liquid=Liquid(density_kg_per_m3=box.density_kg_per_m3, fill_level=box.fill_level),
    ),
)
print(f"times and velocities × {factors.time:.3f}, forces × {factors.force:.2f}; {factors.error}")

# %%
# ## Where it flutters with the liquid frozen
from sloshlab.aeroelastic.generalised_forces import generalised_forces, usual_reduced_frequencies
from sloshlab.aeroelastic.root_locus import root_locus
from sloshlab.aircraft.air_of_free_flight import air_of_free_flight
from sloshlab.aircraft.flight_stability import flight_system
from sloshlab.aircraft.lifting_surfaces import lifting_surfaces

surfaces = lifting_surfaces(aircraft.structure, n_boxes=200)
k = usual_reduced_frequencies(1.3, 10)
forces = generalised_forces(surfaces.boxes, surfaces.motion, k, semi_chord_m=surfaces.semi_chord_m, mach=0.0)
air = air_of_free_flight(k, forces.motion, semi_chord_m=surfaces.semi_chord_m)
density = aircraft.density_kg_per_m3
system = flight_system(aircraft, air, "frozen", density_kg_per_m3=density)
flutter = root_locus(system.matrix_at, np.linspace(25, 36, 23), system.names, rigid=system.rigid).flutter
omega_bar = flutter.frequency_rad_per_s * np.sqrt(box.height_m / 9.81)
print(f"flutter at {flutter.speed_m_per_s:.2f} m/s, {flutter.frequency_rad_per_s:.1f} rad/s: ω̄ = {omega_bar:.2f}")

# %%
# ## Through a gust, beyond that speed
#
# The same small gust at three speeds beyond flutter.
# With the liquid frozen the motion grows for ever.
# The aircraft flies freely and may climb: what is slower than all that the network was trained on is kept from it.
from sloshlab.aeroelastic.gust import gust_fit, one_minus_cosine
from sloshlab.aircraft.drifting_tank import model_in_drifting_tank
from sloshlab.aircraft.linear_flight import linear_flight
from sloshlab.aircraft.tank_simulation import FlightResponse, simulate_flight

gust_air, tank = gust_fit(forces), aircraft.tanks[0]


def through_gust(speed_m_per_s: float, *, free: bool) -> FlightResponse:
    """20 s of flight through a gust of 0.3 m/s and 25 semi-chords."""
    flight = linear_flight(
        aircraft, "frozen", speed_m_per_s=speed_m_per_s, air=air, gust=gust_air, density_kg_per_m3=density
    )
    gust = one_minus_cosine(0.3, gust_length_m=25 * surfaces.semi_chord_m, speed_m_per_s=speed_m_per_s)
    tanks = {tank.name: model_in_drifting_tank(rom, tank)} if free else None
    return simulate_flight(flight, tanks, duration_s=20.0, gust=gust)


frozen = through_gust(1.01 * flutter.speed_m_per_s, free=False)
free = {share: through_gust(share * flutter.speed_m_per_s, free=True) for share in (1.01, 1.04, 1.07)}

figure, axes = plt.subplots(2, 2, sharex=True, figsize=(9, 5), layout="constrained")
for panel, (title, response) in zip(
    axes.flat,
    [
        ("frozen, 1 % beyond", frozen),
        *((f"free, {100 * share - 100:.0f} % beyond", free[share]) for share in free),
    ],
    strict=True,
):
    panel.plot(response.time_s, response.tank_acceleration_m_per_s2[:, 0] / 9.81, linewidth=0.7)
    panel.set(title=title, ylim=(-4, 4))
figure.supxlabel("time [s]")
figure.supylabel("acceleration of the tank [g]")
plt.show()

# %%
# A little beyond flutter the liquid damps more than the air feeds.
# Farther on, motion grows until the liquid, shaken by more than 1 g, takes what the air gives: a limit cycle.
# Still farther the motion grows on, past everything that the network was trained on.
for share, response in free.items():
    in_g = abs(response.tank_acceleration_m_per_s2[response.time_s > response.time_s[-1] - 2, 0]).max() / 9.81
    print(f"{100 * share - 100:.0f} % beyond: {in_g:.3f} g at the end", response.ending)

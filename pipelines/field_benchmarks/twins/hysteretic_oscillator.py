"""The oscillator of the Bouc–Wen benchmark without its hysteresis: m ÿ + c ẏ + k y = u.

Its spring is believed from a frequency response, 35.6 ± 3.6 Hz; the mass is documented.
"""

from __future__ import annotations

from collections.abc import Mapping

from sloshlab.user_twin import Compared, MechanicalTwin, Mechanism, Parameter, Reading, TwinRun


def oscillator(run: TwinRun, values: Mapping[str, float]) -> Mechanism:
    """The linear oscillator, from rest."""
    return Mechanism(
        mass_kg=2.0,
        stiffness_n_per_m=values["stiffness"],
        damping_n_s_per_m=values["damping"],
        driving_force_n=run.channels["force_drive"],
        readings={"displacement_mass": Reading(1.0)},
    )


TWIN = MechanicalTwin(
    parameters=(
        Parameter("stiffness", 1.0e5, 2.0e4, "N m-1"),
        Parameter("damping", 10.0, 4.0, "N s m-1"),
    ),
    driving=("force_drive",),
    compared={"displacement_mass": Compared("m", gain_tolerance=0.0)},
    mechanism=oscillator,
)

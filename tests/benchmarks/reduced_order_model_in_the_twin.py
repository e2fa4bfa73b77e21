"""Speed of the closed loop of beam and trained model.

`python -m tests.benchmarks.reduced_order_model_in_the_twin` prints JSON. A model of 60 delays and 20 neurons at
512 Hz, as trained on the numerical tank, with random parameters: they do not change the time. Steps are those of a
diagnosis: 9 per period of the highest mode, with the structure that such steps move as the beam moves by itself
(`Structure.for_steps_of`). Their error is stated, over one second against 32 times smaller steps.
"""

from __future__ import annotations

import json

import numpy as np

from sloshlab.reduced_order_model.model import ReducedOrderModel, Scaling
from sloshlab.reduced_order_model.networks.radial_basis import NormalisedRadialBasis
from sloshlab.reduced_order_model.regressors import Delays
from sloshlab.reduced_order_model.tank_scaling import tank_facts
from sloshlab.rig import Rig
from sloshlab.twin.excitation import free
from sloshlab.twin.reduced_order_model_force import term_of
from sloshlab.twin.twin import Twin
from tests.benchmarks.measurements import best_of
from tests.benchmarks.twin import DEFLECTION_M, beam

N_DELAYS, N_NEURONS, MODEL_RATE_HZ = 60, 20, 512.0
OUTPUT_RATE_HZ, N_STEPS = 1024.0, 2
LOOP_LABEL = "twin: 10 s of beam and model 60×20 [s]"
ERROR_LABEL = "twin: its error over 1 s, over the largest velocity"
RIG = Rig.from_toml_text(
    "[tank]\nheight_m = 0.0272\nlength_m = 0.1172\nwidth_m = 0.078\ndry_mass_kg = 0.314\n"
    "[liquid]\ndensity_kg_per_m3 = 1000.0\nfill_level = 0.5\n"
)


def modelled_beam(n_steps: int = N_STEPS) -> Twin:
    """The beam of Table 2.4, as moved by so many steps per sample, with a model of the size wanted in its tank."""
    network = NormalisedRadialBasis(N_DELAYS, N_NEURONS)
    theta = np.random.default_rng(5).normal(size=network.n_parameters) / np.sqrt(N_DELAYS)
    model = ReducedOrderModel(
        network, theta, Delays.tapped(N_DELAYS), Scaling(0.0, 0.5, 0.0, 1.0), MODEL_RATE_HZ, tank_facts(RIG)
    )
    return Twin(beam().for_steps_of(1.0 / (OUTPUT_RATE_HZ * n_steps)), (term_of(model, RIG),))


def loop_figures() -> dict[str, float]:
    """Time, compiled before, and error."""
    twin, run, second = modelled_beam(), free(10.0, OUTPUT_RATE_HZ), free(1.0, OUTPUT_RATE_HZ)

    def velocity(n_steps: int) -> np.ndarray:
        finer = modelled_beam(n_steps)
        done = finer.simulate(second, initial_displacement_m=DEFLECTION_M, n_substeps=n_steps).require_done()
        return done.velocity_m_per_s

    coarse, fine = velocity(N_STEPS), velocity(32 * N_STEPS)
    taken = best_of(
        lambda: twin.simulate(run, initial_displacement_m=DEFLECTION_M, n_substeps=N_STEPS).require_done(), 15
    )
    return {LOOP_LABEL: taken, ERROR_LABEL: float(np.abs(coarse - fine).max() / np.abs(fine).max())}


if __name__ == "__main__":
    print(json.dumps(loop_figures(), ensure_ascii=False))

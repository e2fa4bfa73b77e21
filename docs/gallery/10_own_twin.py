"""
# A twin of your own

Any machine can be diagnosed with a twin that you write yourself.
This one is a cart of 2 kg on a spring, pushed by a shaker:
a function of its state gives the rates and what is read.
`force` is what a diagnosis tries.
"""

import tempfile
from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib import pyplot as plt
from scipy.integrate import solve_ivp

import sloshlab as sl

CART_TWIN = """
from sloshlab.user_twin import EquationTwin, Parameter


def cart(state, inputs, parameters, force):
    x, v = state
    acceleration = (inputs.force_push + force - parameters.stiffness * x - 3.0 * v) / 2.0
    return (v, acceleration), (x,)


TWIN = EquationTwin(
    cart,
    states={"x": "displacement_cart", "v": 0.0},
    parameters=[Parameter("stiffness", 3000.0, 60.0, "N m-1")],
    driving=["force_push"],
    compared={"displacement_cart": "m"},
)
"""

# %%
# ## Recordings
#
# The "machine" is integrated by SciPy, with 0.02 mm of noise.
# Its spring hardens: k x + k₃ x³ with k₃ = 4·10⁶ N/m³, which the twin does not know.
# Three levels of a slow sweep are recorded; one of them will choose nothing.
K3, RATE_HZ, NOISE_M = 4.0e6, 250.0, 2e-5
time = np.arange(round(8.0 * RATE_HZ)) / RATE_HZ
rng = np.random.default_rng(1)


def push(t):
    return np.sin(2 * np.pi * (4.0 * t + 0.25 * t**2))


def recorded(level_n):
    def rates(t, state):
        x, v = state
        return v, (level_n * push(t) - 3000.0 * x - K3 * x**3 - 3.0 * v) / 2.0

    found = solve_ivp(rates, (0, time[-1]), (0, 0), t_eval=time, rtol=1e-9, atol=1e-12)
    return xr.Dataset(
        {
            "force_push": ("time", level_n * push(time), {"units": "N", "quantity": "force"}),
            "displacement_cart": (
                "time",
                found.y[0] + NOISE_M * rng.normal(size=time.size),
                {"units": "m", "quantity": "displacement", "noise_std": NOISE_M},
            ),
        },
        {"time": ("time", time, {"units": "s"})},
        {
            "sloshlab_format": "1",
            "run_id": f"sweep of {level_n:g} N",
            "experiment": "other",
            "configuration": "frozen",
            "rig": "cart",
            "sampling_rate_hz": RATE_HZ,
            "start_time_utc": "2026-01-01T00:00:00Z",
        },
    )


runs = [recorded(level_n) for level_n in (3.0, 6.0, 9.0)]

# %%
# ## Diagnosis
with tempfile.TemporaryDirectory() as made:
    module = Path(made) / "cart_twin.py"
    module.write_text(CART_TWIN, encoding="utf-8")
    verdict = sl.diagnose(runs, twin=module, name="cart")
print(verdict.headline)
for effect in verdict.effects:
    for name, number in effect["parameters"].items():
        print(f"{effect['name']}: {name} = {number['estimate']:.3g} ({number['low']:.3g} … {number['high']:.3g})")

# %%
figure, (above, below) = plt.subplots(2, 1, figsize=(8, 6), layout="constrained", height_ratios=(2, 1))
verdict.plot.before_after(ax=above)
verdict.plot.errors(ax=below)
plt.show()

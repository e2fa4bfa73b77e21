"""
# A friction that nobody knew of

A tank on springs was let go four times.
The simulation has springs, a damper and frozen liquid, and does not fit.
What was left out?

The case is one of the [demonstration](../../demo.md):
a laboratory that shares no code with the analysis drew a rig, hid something in it, recorded, and locked the
truth away before the search began.
"""

from pathlib import Path

from matplotlib import pyplot as plt

import sloshlab as sl

raw_data = Path("../../raw_data")  # in docs/gallery of a checkout
case = raw_data / "cases" / "friction"

# %%
# The diagnosis gets the rig as it is believed to be, and the recordings.
# It retunes the simulation's own numbers, tries what could be missing, and judges by runs that chose
# nothing.
# This takes about half a minute.
verdict = sl.diagnose(case / "case")
print(verdict.headline)

# %%
# Left:
# a run that nothing was fitted to, where it is missed most.
# Below: the error on that run in multiples of the noise.
# At 1 only noise is left.
figure, (above, below) = plt.subplots(2, 1, figsize=(8, 6), layout="constrained", height_ratios=(2, 1))
verdict.plot.before_after(ax=above)
verdict.plot.errors(ax=below)
plt.show()

# %%
# ## What was hidden
#
# The key to the truth follows from the seed of the case, which the diagnosis did not have.
# The file is opened here, after the answer.
from sealed_trial.demonstrations import DOMAIN
from sealed_trial.sealing.sealed_case import key_of, opened_truth, read_published

truth = opened_truth(case, read_published(case), key_of(DOMAIN, "friction", 1))
[hidden], [found] = truth["effects"], verdict.effects
number = found["parameters"]["force_n"]
print(f"hidden: {hidden['name']}, {hidden['parameters']['force_n']:.3f} N")
print(f"found:  {found['name']}, {number['estimate']:.3f} N ({number['low']:.3f} … {number['high']:.3f} N)")

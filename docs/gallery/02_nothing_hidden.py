"""
# When nothing is missing

A diagnosis that always finds something is worth nothing.
Here the believed numbers of the rig are a little wrong, and physics is complete.
"""

from pathlib import Path

from matplotlib import pyplot as plt

import sloshlab as sl

raw_data = Path("../../raw_data")  # in docs/gallery of a checkout
verdict = sl.diagnose(raw_data / "cases" / "nothing-hidden" / "case")
print(verdict.headline)

# %%
# As believed, the simulation misses the run that nothing was fitted to by 3.4 times the noise, and retuned by 2.5.
# So something is left, and one might be tempted to name it.
# But none of the effects that were tried takes enough of it to be worth its numbers.
figure, axes = plt.subplots(figsize=(6, 3.6), layout="constrained")
verdict.plot.errors(ax=axes)
plt.show()

# %%
# The probabilities of all explanations add up to one; these are the most probable ones.
for explanation, probability in sorted(verdict.probabilities.items(), key=lambda item: -item[1])[:3]:
    print(f"{probability:6.3f}  {explanation}")

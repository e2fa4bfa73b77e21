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
# The error is large as long as the rig's numbers are those of its file.
# Retuned within what a laboratory knows of them, they leave two and a half times the noise of the sensors.
# Every explanation that could take the rest was tried, and none of them is worth its numbers.
figure, axes = plt.subplots(figsize=(6, 3.6), layout="constrained")
verdict.plot.errors(ax=axes)
plt.show()

# %%
# The probabilities of all explanations add up to one; these are the most probable ones.
for explanation, probability in sorted(verdict.probabilities.items(), key=lambda item: -item[1])[:3]:
    print(f"{probability:6.3f}  {explanation}")

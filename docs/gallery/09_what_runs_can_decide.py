"""
# What can these runs decide?

What a run does not show, no analysis finds.
Before a search, and before a day in the laboratory, the runs of a case say which questions they can answer,
and what to record for the others.
"""

from pathlib import Path

from matplotlib import pyplot as plt

from pipelines.diagnosis.case_builder import check_case

raw_data = Path("../../raw_data")  # in docs/gallery of a checkout
decays = check_case(raw_data / "cases" / "friction" / "case")
print(*decays["lines"][1:], sep="\n")

# %%
# ## With one run less, and less again
#
# The same case with fewer of its recordings.
# One run alone leaves none that nothing was fitted to: then nothing can be called missing.
import shutil
import tempfile

checked = {}
with tempfile.TemporaryDirectory() as made:
    for n_runs in (4, 2, 1):
        fewer = Path(made) / f"{n_runs}_runs"
        shutil.copytree(raw_data / "cases" / "friction" / "case", fewer)
        for file in sorted((fewer / "recordings").glob("*.nc"))[n_runs:]:
            file.unlink()
        checked[n_runs] = check_case(fewer)
for n_runs, found in checked.items():
    print(f"{n_runs} of the runs; to record besides:", *found["lacking"], sep="\n  - ")

# %%
# A dot is a question that can be answered.
questions = checked[4]["possible"] + checked[4]["impossible"]
figure, axes = plt.subplots(figsize=(9, 3.8), layout="constrained")
for column, found in enumerate(checked.values()):
    rows = [row for row, question in enumerate(questions) if question in found["possible"]]
    axes.plot([column] * len(rows), rows, "o", ms=10, color="C2")
axes.set(xlim=(-0.5, 2.5), ylim=(len(questions) - 0.5, -0.5), xlabel="runs of the case")
axes.set_xticks(range(3), list(checked))
axes.set_yticks(range(len(questions)), questions)
axes.grid(alpha=0.4)
plt.show()

"""
# What can these runs decide?

What a run does not show, no analysis finds.
Before a search, and before a day in the laboratory, the runs of a case say which questions they can answer,
and what to record for the others.
"""

from pathlib import Path

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

lacking = {}
with tempfile.TemporaryDirectory() as made:
    for n_runs in (4, 2, 1):
        fewer = Path(made) / f"{n_runs}_runs"
        shutil.copytree(raw_data / "cases" / "friction" / "case", fewer)
        for file in sorted((fewer / "recordings").glob("*.nc"))[n_runs:]:
            file.unlink()
        lacking[n_runs] = check_case(fewer)["lacking"]
for n_runs, wanted in lacking.items():
    print(f"{n_runs} of the runs; to record besides:", *wanted, sep="\n  - ")

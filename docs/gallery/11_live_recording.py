"""
# A live recording, with a simulated device

A recording of `raw_data` is played as a serial device on a pseudo-terminal, and recorded by another program
that knows nothing of it but what comes over the line.
Does it come back?

In a shell it would be `sloshlab replay` in one terminal and `sloshlab record` in the other.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib import pyplot as plt

raw_data = Path("../../raw_data")  # in docs/gallery of a checkout
played = raw_data / "shaker" / "fill_0.50_sweep_3.00g.nc"
rig = raw_data / "shaker" / "rig_fill_0.50.toml"
sloshlab = [sys.executable, "-m", "pipelines.command_line"]


def counts_of(file):
    with xr.open_dataset(file, mask_and_scale=False, decode_times=False) as opened:
        return opened.load()


# %%
# ## Play and record
#
# Once over a good line, once over one that loses a frame in two hundred.
# The recorder says by its exit code whether anything is missing:
# 0 is complete, 3 is done but with losses.
recordings, exit_codes = {}, {}
with tempfile.TemporaryDirectory() as made:
    bad = Path(made, "faults.toml")
    bad.write_text("seed = 1\n[drop]\nprobability = 0.005\n", encoding="utf-8")
    for line, faults in (("good", []), ("bad", ["--faults", bad])):
        output = Path(made, f"{line}.nc")
        play = ["replay", played, "--as", f"serial:{made}/tty", "--speed", "max", *faults]
        with subprocess.Popen([*sloshlab, *play], stdout=subprocess.PIPE, text=True) as device:
            url = device.stdout.readline().removeprefix("ready ").strip()
            record = ["record", "--source", url, "--rig", rig, "-o", output]
            done = subprocess.run([*sloshlab, *record], capture_output=True, text=True)
            device.stdout.read()
        exit_codes[line], recordings[line] = done.returncode, counts_of(output)
        print(f"{line} line: exit code {done.returncode}")

# %%
# ## Compare
#
# Over the good line every count of every channel is that of the file.
# Over the bad one, those that came are in their place, and those that did not are flagged: nothing is
# joined, nothing is filled.
original = counts_of(played)
channels = [name for name in original.data_vars if name != "quality"]
lost = recordings["bad"]["quality"].values & 1 > 0
for line, recording in recordings.items():
    n_samples = recording.sizes["time"]
    kept = recording["quality"].values & 1 == 0
    wrong = sum(
        int((recording[name].values != original[name].values[:n_samples])[kept].sum()) for name in channels
    )
    print(f"{line} line: {n_samples} samples, {int((~kept).sum())} flagged as lost, {wrong} counts wrong")

# %%
figure, axes = plt.subplots(figsize=(9, 3.6), layout="constrained")
first = int(np.flatnonzero(lost)[0])
shown, counts = slice(first - 60, first + 90), recordings["bad"]["force_cell_1"].values.astype(float)
time = original["time"].values
axes.plot(time[shown], original["force_cell_1"].values[shown], color="0.75", lw=3, label="played")
axes.plot(time[shown], np.where(lost, np.nan, counts)[shown], "C0.-", lw=0.8, label="recorded over the bad line")
axes.set(xlabel="time [s]", ylabel="force_cell_1 [counts]")
axes.margins(y=0.25)
axes.legend(loc="upper right", ncols=2)
plt.show()

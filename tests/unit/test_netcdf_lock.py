"""Recordings are read and written in several threads at once; the netCDF library alone would end the process."""

import subprocess
import sys

import pytest

AT_ONCE = """
import sys, threading
from pathlib import Path
import numpy as np
import xarray as xr
from acquisition.devices.recorded_signal import RecordedSignal
from pipelines.report.outputs import write_dataset
from sloshlab.recording import read_recording, write_recording

attributes = {
    "sloshlab_format": "1", "run_id": "r", "experiment": "other", "configuration": "empty", "rig": "rig.toml",
    "sampling_rate_hz": 500.0, "start_time_utc": "2026-01-12T09:00:00Z",
}
values = np.arange(20_000, dtype=np.float64)
force = ("time", values, {"quantity": "force", "units": "N"})
run = xr.Dataset({"force_1": force}, {"time": ("time", values / 500.0, {"units": "s"})}, attributes)
folder = Path(sys.argv[2])
write_recording(run, folder / "run.nc")
actions = {
    "write_recording": lambda k: write_recording(run, folder / f"written_{k}.nc"),
    "write_dataset": lambda k: write_dataset(run, folder / f"result_{k}.nc"),
    "played": lambda k: RecordedSignal(folder / "run.nc").piece(0, 10),
    "read_recording": lambda k: read_recording(folder / "run.nc"),
}
chosen = actions[sys.argv[1]]
failures = []

def repeated(action, k):
    try:
        for _ in range(60):
            action(k)
    except Exception as error:
        failures.append(repr(error))

# the recording is read beside it, as by a source that is recorded
jobs = [(chosen, 0), (chosen, 1), (actions["read_recording"], 2), (actions["read_recording"], 3)]
threads = [threading.Thread(target=repeated, args=job) for job in jobs]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
print(failures or "done")
"""


@pytest.mark.slow
@pytest.mark.parametrize("action", ["write_recording", "write_dataset", "played", "read_recording"])
def test_several_threads_may_do_it_at_once(tmp_path, action):
    command = [sys.executable, "-c", AT_ONCE, action, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert (done.returncode, done.stdout) == (0, "done\n"), done.stderr

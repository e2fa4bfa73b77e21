"""A second, independent client of a CAN bus: python-can's own logger beside the recorder, one recording."""

from __future__ import annotations

import os
import shutil
import signal
import sys
from pathlib import Path
from urllib.parse import parse_qs

import netCDF4
import numpy as np
import pytest
from live_commands import Command, cut_recording, n_bytes, playing, running, stored, wait_until

from pipelines.command_line import run

pytestmark = [
    pytest.mark.skipif(os.name != "posix", reason="the logger is ended by SIGINT"),
    pytest.mark.usefixtures("programs_are_forks"),
]

N_SAMPLES = 2048
FORCE = {"range_min": -20.0, "range_max": 20.0, "noise_std": 0.01875, "block_from": "shaker", "block_to": "tank"}
ACCELERATION = {"range_min": -50.0, "range_max": 50.0, "noise_std": 0.06696428571428571}
# what the DBC file says of the sensors has to be said again in the map of an import
STATED = {
    "force_cell_1": FORCE,
    "force_cell_2": FORCE,
    "acceleration_roof_1": ACCELERATION,
    "acceleration_roof_2": ACCELERATION,
    "acceleration_control": ACCELERATION,
}
# what either program says about its own work
OF_THE_RECORDER = {"acquisition"}
OF_THE_IMPORT = {"import_map", "source_files", "source_sha256"}
OF_AN_IMPORTED_CHANNEL = {"source_column", "source_units"}


def channel_map(database: str, start_time_utc: str) -> str:
    lines = [
        "[run]",
        'experiment = "other"',
        'configuration = "sloshing"',
        'run_id = "bus"',
        f'start_time_utc = "{start_time_utc}"',
        "[source]",
        f'database = "{database}"',
    ]
    for name, attributes in STATED.items():
        lines += [f"[channels.{name}]", f'column = "{name}"']
        lines += [f"{key} = {value!r}".replace("'", '"') for key, value in attributes.items()]
    return "\n".join(lines) + "\n"


def logger(url: str, log: Path, folder: Path) -> Command:
    """python-can's logger as its documentation says to start it."""
    options = {key: values[0] for key, values in parse_qs(url.partition("?")[2]).items()}
    place = ["--bus-kwargs", f"host={options['host']}", f"port={options['port']}"]
    command = [sys.executable, "-m", "can.logger", "-i", "socketcand", "-c", options["channel"], *place]
    return Command([*command, "-f", str(log)], folder)


@pytest.mark.slow
def test_the_log_of_another_program_is_the_same_recording(repository: Path, tmp_path: Path) -> None:
    """Frames are lost by the device on the way to both: both recordings must miss the same samples."""
    lab = tmp_path / "lab"
    lab.mkdir()
    campaign = repository / "raw_data" / "shaker"
    original = cut_recording(campaign / "fill_0.50_sweep_3.00g.nc", tmp_path / "run.nc", N_SAMPLES)
    rig = shutil.copy(campaign / "rig_fill_0.50.toml", lab / "rig.toml")
    (lab / "faults.toml").write_text("[drop]\nprobability = 0.01\n[duplicate]\nprobability = 0.01\n")
    options = ["--speed", "4", "--wait-clients", "2", "--faults", lab / "faults.toml"]
    attributes = ["experiment=other", "configuration=sloshing", "run_id=bus"]
    told = [part for text in attributes for part in ("--attribute", text)]
    with playing(original, lab, "socketcand", options=options) as devices:
        independent = logger(devices.sources[1], lab / "bus.blf", tmp_path)
        try:
            arguments = ["record", *devices.sources, "--rig", rig, "-o", lab / "new.nc", *told]
            with running(arguments, lab) as recorder:
                wait_until(lambda: recorder.poll() or independent.poll(), "the end of either")
                assert not independent.poll(), independent.stderr
                assert recorder.exit_code() == 3, recorder.stderr
            # the logger does not notice the end; its file is complete once it is interrupted
            assert devices.command.exit_code() == 0
            independent.send(signal.SIGINT)
            wait_until(independent.poll, "the end of the logger")
            assert n_bytes(lab / "bus.blf") > 8 * N_SAMPLES
        finally:
            independent.close()
    with netCDF4.Dataset(lab / "new.nc") as recording:
        start = str(recording.start_time_utc)
    (lab / "map.toml").write_text(channel_map("socketcand.dbc", start), encoding="utf-8")
    imported = ["import", str(lab / "bus.blf"), "--map", str(lab / "map.toml"), "--rig", str(rig)]
    assert run([*imported, "-o", str(lab / "imported.nc")]) == 3
    assert_same_recording(lab / "new.nc", lab / "imported.nc")
    lost = stored(lab / "new.nc")["quality"].values & 1
    assert 0.01 * N_SAMPLES < np.count_nonzero(lost) < 0.1 * N_SAMPLES


def assert_same_recording(recorded: Path, imported: Path) -> None:
    """Counts, type, times, flags and attributes, bit by bit; the exceptions are named above."""
    ours, theirs = stored(recorded), stored(imported)
    assert {*ours.variables} == {*theirs.variables}
    for name in ours.variables:
        assert ours[name].dtype == theirs[name].dtype, name
        np.testing.assert_array_equal(ours[name].values, theirs[name].values, err_msg=str(name))
        if name == "time":
            assert ours[name].attrs["units"] == theirs[name].attrs["units"] == "s"
        elif name != "quality":  # its legend is longer where the recorder may set more bits
            expected = {"add_offset": 0.0, **ours[name].attrs}
            found = {key: value for key, value in theirs[name].attrs.items() if key not in OF_AN_IMPORTED_CHANNEL}
            np.testing.assert_equal(found, expected, err_msg=str(name))
    assert {*ours.attrs} - {*theirs.attrs} <= OF_THE_RECORDER
    assert {*theirs.attrs} - {*ours.attrs} <= OF_THE_IMPORT
    for key in {*ours.attrs} & {*theirs.attrs}:
        assert ours.attrs[key] == theirs.attrs[key], key

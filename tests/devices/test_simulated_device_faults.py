"""Every fault of frames, lines and plugs, on every transport: what does not arrive is what the truth says."""

import contextlib
import json
from pathlib import Path

import can
import pytest
from independent_host import Heard, heard_on, listen_can, listen_serial, open_bus, playing
from slow_cases import slow_but

N_SAMPLES, RATE_HZ = 2000, 500.0
PATTERN = f"pattern:channels=2&sampling_rate_hz={RATE_HZ:g}&bits=16&duration_s={N_SAMPLES / RATE_HZ:g}"
TRANSPORTS = ("serial", "socketcand", "slcan", "virtual")


def count(sample, channel):
    """The published pattern, in Python's own integers."""
    z = (256 * sample + channel + 0x9E3779B97F4A7C15) % 2**64
    z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9 % 2**64
    z = (z ^ z >> 27) * 0x94D049BB133111EB % 2**64
    upper = (z ^ z >> 31) >> 48
    return upper - 2**16 if upper >= 2**15 else upper


EXPECTED = {sample: [count(sample, 0), count(sample, 1)] for sample in range(N_SAMPLES)}


def played(tmp_path, transport, faults, **settings):
    """What an independent host hears, and the truth of the device."""
    file, truth = tmp_path / "faults.toml", tmp_path / "truth.json"
    file.write_text(faults)
    dbc = tmp_path / "device.dbc"
    url = {
        "serial": f"serial:{tmp_path / 'tty'}",
        "socketcand": f"can:socketcand?port=0&dbc={dbc}",
        "slcan": f"can:slcan?channel={tmp_path / 'tty'}&dbc={dbc}",
        "virtual": f"can:virtual?channel={tmp_path.name}&dbc={dbc}",
    }[transport]
    with playing(PATTERN, url, faults=[file], truth=truth, **settings) as (ready, _):
        heard = listen_serial(ready[0]) if transport == "serial" else listen_can(ready[0])
    return heard, json.loads(truth.read_text())["device_1"]


def places(truth, *faults):
    """Counters that these faults struck."""
    struck = [entry for entry in truth["places"] if entry["fault"] in faults]
    return {entry["counter"] + k for entry in struck for k in range(entry["n_samples"])}


@pytest.mark.parametrize("transport", TRANSPORTS)
@pytest.mark.parametrize("probability", slow_but([0.03], [0.003, 0.03, 0.2]))
@pytest.mark.parametrize("fault", ["drop", "duplicate", "reorder", "corrupt", "garbage"])
def test_what_is_missing_is_what_the_truth_says(tmp_path, transport, fault, probability):
    more = "\ndistance = 3" if fault == "reorder" else ""
    more += "\nat_counters = [0, 777, 1999]"
    heard, truth = played(tmp_path, transport, f"[{fault}]\nprobability = {probability}{more}\n")
    found, struck = heard.counts_by_counter(), places(truth, fault)
    assert {0, 777, 1999} <= struck
    missing = struck if fault in ("drop", "corrupt") else set()
    assert found == {sample: row for sample, row in EXPECTED.items() if sample not in missing}
    assert truth["samples_sent"] == N_SAMPLES - len(missing)
    assert heard.ends[0][1] == N_SAMPLES
    order = [counter for _, _, counter, _ in heard.samples]
    assert (order == sorted(order)) == (fault != "reorder")
    assert (len(set(order)) < len(order)) == (fault == "duplicate")
    assert (heard.n_bad > 0) == (fault == "corrupt" or (fault == "garbage" and transport == "serial"))
    if fault == "garbage" and transport != "serial":
        assert heard.n_foreign == 4 * truth["garbage"]  # 32 bytes, 8 in each
        assert heard.n_error_frames == (0 if transport == "slcan" else truth["garbage"])


def test_faults_strike_the_same_frames_whatever_the_blocks_are(tmp_path):
    text = "[drop]\nprobability = 0.1\n[corrupt]\nprobability = 0.1\n"
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    _, fast = played(tmp_path / "a", "socketcand", text)
    _, paced = played(tmp_path / "b", "socketcand", text, speed="8")
    assert fast["places"] == paced["places"]
    assert fast["drop"] == pytest.approx(200, abs=50)  # 2000 frames, 10 %, 3.7 standard deviations


@pytest.mark.parametrize("transport", TRANSPORTS)
def test_a_host_that_does_not_read_overruns_the_device(tmp_path, transport):
    small = (
        "fifo_bytes = 600\nbaud_rate = 115200" if transport == "serial" else "queue_frames = 20\nbit_rate = 1e6"
    )
    text = f"[overrun]\n{small}\n[[overrun.stalls]]\nat_s = 1.5\nfor_s = 0.25\n"
    heard, truth = played(tmp_path, transport, text)
    lost = places(truth, "overrun")
    assert heard.counts_by_counter() == {s: row for s, row in EXPECTED.items() if s not in lost}
    assert heard.n_overrun >= 1
    assert min(lost) >= 750  # the stall begins with sample 750 and lasts 125 samples
    assert max(lost) < 950
    assert 20 <= len(lost) <= 140


@pytest.mark.parametrize("transport", ["serial", "slcan", "socketcand"])
@pytest.mark.parametrize("restart", [False, True])
def test_the_counter_runs_on_while_the_plug_is_out_or_starts_anew(tmp_path, transport, restart):
    file, truth = tmp_path / "faults.toml", tmp_path / "truth.json"
    file.write_text(f"[[disconnect]]\nat_s = 1.0\nfor_s = 0.5\nrestart = {str(restart).lower()}\n")
    dbc = tmp_path / "device.dbc"
    url = {
        "serial": f"serial:{tmp_path / 'tty'}",
        "slcan": f"can:slcan?channel={tmp_path / 'tty'}&dbc={dbc}",
        "socketcand": f"can:socketcand?port=0&dbc={dbc}",
    }[transport]
    with playing(PATTERN, url, faults=[file], truth=truth) as (ready, _):
        if transport == "serial":
            first, second = listen_serial(ready[0], until_end=False), listen_serial(ready[0])
        else:
            first, second = (heard_until_lost(ready[0], dbc), listen_can(ready[0], near=0 if restart else 750))
    assert first.counts_by_counter() == {s: EXPECTED[s] for s in range(500)}
    base = 750 if restart else 0
    assert second.counts_by_counter() == {s - base: EXPECTED[s] for s in range(750, 2000)}
    assert second.ends[0][1] == 2000 - base
    assert (second.samples[0][0] != first.samples[0][0]) == restart
    told = json.loads(truth.read_text())["device_1"]
    assert places(told, "disconnect") == set(range(500, 750))


def heard_until_lost(url, dbc):
    """python-can's clients do not notice that the device has gone; they fall silent."""
    bus = open_bus(url)
    heard = Heard()
    try:
        heard_on(bus, dbc, until_silent_s=0.4, heard=heard)
    except can.CanError:
        pass
    finally:
        with contextlib.suppress(can.CanError):
            bus.shutdown()
    return heard


def test_the_32_bit_counter_wraps(tmp_path):
    heard, _ = played(tmp_path, "serial", "[clock]\ncounter_start = 4294967000\n")
    counters = [counter for _, _, counter, _ in heard.samples]
    assert counters[0] == 4294967000
    assert max(counters) < 2**32
    assert counters[-1] == 4294967000 + N_SAMPLES - len(heard.samples[-1][3]) - 2**32
    assert heard.ends[0][1] == 4294967000 + N_SAMPLES


def test_an_announced_exchange_of_sensors_is_in_the_calibration(tmp_path):
    text = '[[swapped]]\nchannels = ["voltage_pattern_1", "voltage_pattern_2"]\nfrom_s = 2.0\nannounced = true\n'
    heard, _ = played(tmp_path, "serial", text)
    serials = [[c["sensor_serial"] for c in told["channels"]] for told in heard.calibrations]
    assert serials[0] == ["sensor-1", "sensor-2"]
    assert serials[-1] == ["sensor-2", "sensor-1"]
    found = heard.counts_by_counter()
    assert all(found[s] == (EXPECTED[s] if s < 1000 else EXPECTED[s][::-1]) for s in range(N_SAMPLES))


def test_the_example_of_the_documentation_is_a_device_that_plays(tmp_path, repository):
    text = Path(repository, "docs/examples/faults.toml").read_text()
    heard, truth = played(tmp_path, "serial", text.replace("force_cell", "voltage_pattern"))
    assert heard.samples
    assert truth["samples_taken"] > 0

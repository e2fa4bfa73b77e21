"""Whatever stands in a map or a file, an import ends in a result or in one `InputError`."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from number_of_examples import examples

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "unit" / "acquisition" / "files"))
from import_scenarios import RUN, SCENARIOS, Scenario
from one_process import in_one_process

from acquisition.files import describe_source, import_recording
from acquisition.files.channel_map import ChannelMap, channel_map_from_document, channel_map_from_text
from acquisition.files.delay_compensation import delay_compensated
from acquisition.files.time_base import uniform_grid
from sloshlab.errors import ChannelMapError, InputError

_N_DAMAGED = 8
"""Of each format; `make fuzz` goes on for as long as asked."""
FUZZ = settings(
    max_examples=examples(30),
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
SCALARS = (
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=20)
    | st.sampled_from(["N", "F", "s"])
)
KEYS = st.sampled_from(
    [
        "run",
        "source",
        "channels",
        "column",
        "units",
        "sign",
        "delay_s",
        "calibration",
        "factor",
        "from",
        "to",
        "time",
        "format",
        "join",
        "range_min",
        "experiment",
        "configuration",
        "force_cell_1",
        "acceleration_tip",
        "attributes",
        "start_time_utc",
        "sampling_rate_hz",
        "quality",
    ]
) | st.text(max_size=8)
DOCUMENTS = st.dictionaries(
    KEYS,
    st.recursive(SCALARS, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=5)),
    max_size=5,
)


def outcome_of(action: Callable[[], Any]) -> Any:
    """The result, or the one-line refusal; any other exception passes through and fails the test."""
    try:
        return action()
    except InputError as error:
        refusal = error
    assert "\n" not in str(refusal)
    return refusal


@pytest.fixture(scope="module")
def csv_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("csv")
    return SCENARIOS[0].write(folder)[0]


@FUZZ
@given(document=DOCUMENTS)
def test_any_document_is_a_map_or_a_map_error(document: dict[str, Any]) -> None:
    outcome = outcome_of(lambda: channel_map_from_document(document))
    assert isinstance(outcome, (ChannelMap, ChannelMapError))


@FUZZ
@given(text=st.text(max_size=300) | st.text(alphabet="[]=.\"'#{}, \nabrun0", max_size=300))
def test_any_text_is_a_map_or_a_map_error(text: str) -> None:
    outcome = outcome_of(lambda: channel_map_from_text(text))
    assert isinstance(outcome, (ChannelMap, ChannelMapError))


@pytest.mark.parametrize("text", ["a=" + "[" * 20_000, "[" + "a." * 20_000 + "a]", "a=" + "9" * 10_000])
def test_deep_and_long_toml(text: str) -> None:
    with pytest.raises(ChannelMapError):
        channel_map_from_text(text)


CHANNEL_VALUES = st.dictionaries(
    st.sampled_from(
        [
            "column",
            "units",
            "units_override",
            "sign",
            "delay_s",
            "delay",
            "calibration",
            "range_min",
            "range_max",
            "noise_std",
            "x_m",
            "source",
        ]
    ),
    st.one_of(
        st.sampled_from(
            ["F", "a", "time", "N", "kN", "g", "V", "m s-2", "record", "°C", "s since 2000-01-01", "1", "%"]
        ),
        st.integers(-3, 5),
        st.floats(),
        st.booleans(),
        st.just({"factor": 2.0, "from": "V", "to": "N"}),
        st.tuples(st.sampled_from(["F", "a"]), st.integers(0, 3)).map(list),
    ),
    max_size=6,
)
SOURCE_VALUES = st.dictionaries(
    st.sampled_from(
        [
            "time",
            "sampling_rate_hz",
            "sampling_rate_variable",
            "jitter_allowed_steps",
            "quality",
            "delimiter",
            "decimal",
            "header_rows",
            "names_row",
            "units_row",
            "encoding",
            "group",
            "segment",
            "database",
            "format",
            "time_units",
            "accept_truncated",
        ]
    ),
    st.one_of(
        st.sampled_from(["time", "F", ",", ";", ".", "csv", "mat", "tdms", "utf-8", "ms", "cp1252", "x.dbc"]),
        st.integers(-2, 70),
        st.floats(),
        st.booleans(),
    ),
    max_size=4,
)


@FUZZ
@given(channel=CHANNEL_VALUES, source=SOURCE_VALUES)
def test_any_map_of_a_good_file(channel: dict[str, Any], source: dict[str, Any], csv_file: Path) -> None:
    lines = [RUN, "[source]"]
    lines += [f"{key} = {_toml(value)}" for key, value in {"time": "time", **source}.items()]
    lines += ["[channels.force_cell_1]"]
    lines += [f"{key} = {_toml(value)}" for key, value in {"column": "F", "units": "N", **channel}.items()]
    map_path = csv_file.parent / "fuzzed.toml"
    map_path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    result = outcome_of(lambda: import_recording([csv_file], map_path))
    if isinstance(result, InputError):
        return
    values = result.recording["force_cell_1"].values
    flags = (
        result.recording["quality"].values if "quality" in result.recording else np.zeros(values.size, dtype=int)
    )
    assert not np.isinf(values).any()
    np.testing.assert_array_equal(np.isnan(values), (flags & 1) > 0)


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {_toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return '"' + value + '"' if isinstance(value, str) else repr(value)


def _check_damaged(scenario: Scenario, contents: list[bytes], folder: Path) -> None:
    """All but the last within one process, as processes take most of the time; that of the last is its own."""
    path = folder / scenario.file_name

    def check(some: list[bytes]) -> None:
        for content in some:
            path.write_bytes(content)
            outcome_of(lambda: describe_source(path))
            outcome_of(lambda: import_recording([path], folder / "map.toml"))

    in_one_process(lambda: check(contents[:-1]))
    check(contents[-1:])


@pytest.mark.parametrize("scenario", SCENARIOS, ids=[scenario.name for scenario in SCENARIOS])
def test_truncated_files(scenario: Scenario, tmp_path: Path) -> None:
    whole = scenario.write(tmp_path)[0].read_bytes()
    rng = np.random.default_rng(20260131)
    lengths = [*range(1, 12), *rng.integers(12, len(whole), 12).tolist(), len(whole) - 1]
    _check_damaged(scenario, [whole[:length] for length in lengths], tmp_path)


@pytest.mark.parametrize("scenario", SCENARIOS, ids=[scenario.name for scenario in SCENARIOS])
def test_damaged_files(scenario: Scenario, tmp_path: Path) -> None:
    whole = scenario.write(tmp_path)[0].read_bytes()
    rng = np.random.default_rng(20260131)
    n_head = min(len(whole), 600)
    contents = []
    for number in range(_N_DAMAGED):
        content = bytearray(whole)
        reach = n_head if number % 2 else len(whole)
        for _ in range(1 + number % 4):
            content[int(rng.integers(reach))] = int(rng.choice([0, 255, 128, 32, int(rng.integers(256))]))
        contents.append(bytes(content))
    _check_damaged(scenario, contents, tmp_path)


@FUZZ
@given(
    rate_hz=st.sampled_from([1.0, 30.3, 400.0, 1024.0, 25600.0, 65536.0]),
    start_s=st.floats(-100, 100),
    lost=st.sets(st.integers(1, 298), max_size=100),
)
def test_grid_recovers_what_was_sampled(rate_hz: float, start_s: float, lost: set[int]) -> None:
    index = np.setdiff1d(np.arange(300), list(lost))
    grid = uniform_grid(start_s + index / rate_hz, name="x")
    # float64 time stamps near 100 s are good to 1.4e-14 s
    assert grid.rate_hz == pytest.approx(rate_hz, rel=1e-9)
    np.testing.assert_array_equal(grid.index, index)


@FUZZ
@given(values=st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=100), steps=st.integers(-120, 120))
def test_whole_delays_there_and_back(values: list[float], steps: int) -> None:
    given_values = np.array(values)
    back = delay_compensated(delay_compensated(given_values, float(steps)), float(-steps))
    kept = np.isfinite(back)
    assert kept.sum() == max(0, given_values.size - abs(steps))
    np.testing.assert_array_equal(back[kept], given_values[kept])

"""What a map may say, and what it costs to say it wrongly."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquisition.files import ImportResult, import_recording
from sloshlab.errors import ChannelMapError, FileFormatError, InputError, RecordingError, UnitsError

RUN = """
[run]
experiment = "other"
configuration = "frozen"
start_time_utc = "2026-01-31T12:00:00Z"
"""
TIME_S = np.arange(200) / 100.0


def imported(
    folder: Path, columns: dict[str, np.ndarray], body: str, *, source: str = 'time = "t"'
) -> ImportResult:
    """Import columns written as CSV through a map whose channels are `body`."""
    path = written(folder / "run.csv", columns)
    return import_recording([path], written_map(folder, body, source=source))


def written(path: Path, columns: dict[str, np.ndarray]) -> Path:
    rows = [",".join(columns)]
    rows += [
        ",".join("" if np.isnan(v) else repr(float(v)) for v in row) for row in zip(*columns.values(), strict=True)
    ]
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return path


def written_map(folder: Path, body: str, *, source: str = 'time = "t"', run: str = RUN) -> Path:
    path = folder / "map.toml"
    path.write_text(f"{run}\n[source]\n{source}\n{body}\n", encoding="utf-8")
    return path


def force(extra: str = "", units: str = 'units = "N"') -> str:
    return f'[channels.force_cell_1]\ncolumn = "F"\n{units}\n{extra}\n'


def signal() -> dict[str, np.ndarray]:
    return {"t": TIME_S, "F": np.sin(2 * np.pi * 5 * TIME_S)}


class TestUnits:
    def test_missing_units_are_refused(self, tmp_path: Path) -> None:
        with pytest.raises(ChannelMapError, match=r"force_cell_1\.units: got nothing"):
            imported(tmp_path, signal(), force(units=""))

    def test_units_of_another_quantity_are_refused(self, tmp_path: Path) -> None:
        with pytest.raises(UnitsError, match=r"force_cell_1.*'m s-2'; allowed: units convertible to N"):
            imported(tmp_path, signal(), force(units='units = "m s-2"'))

    def test_units_in_the_header_are_used(self, tmp_path: Path) -> None:
        columns = {"t [s]": TIME_S, "F [kN]": signal()["F"]}
        body = '[channels.force_cell_1]\ncolumn = "F"\n'
        recording = imported(tmp_path, columns, body).recording
        np.testing.assert_array_equal(recording["force_cell_1"].values, signal()["F"] * 1000)

    def test_contradicting_units_are_refused_without_override(self, tmp_path: Path) -> None:
        columns = {"t": TIME_S, "F (g)": signal()["F"]}
        with pytest.raises(ChannelMapError, match=r"labels column 'F' 'g'.*units_override"):
            imported(tmp_path, columns, force())

    def test_overridden_units_are_reported(self, tmp_path: Path) -> None:
        columns = {"t": TIME_S, "F (g)": signal()["F"]}
        result = imported(tmp_path, columns, force("units_override = true"))
        assert any("force labelled 'g'" in trap and "'N'" in trap for trap in result.report.traps)
        np.testing.assert_array_equal(result.recording["force_cell_1"].values, signal()["F"])

    def test_acceleration_in_g_is_read_as_gravity_and_reported(self, tmp_path: Path) -> None:
        columns = {"t": TIME_S, "a (g)": signal()["F"]}
        body = '[channels.acceleration_tip]\ncolumn = "a"\nunits = "gravity"\n'
        result = imported(tmp_path, columns, body)
        np.testing.assert_allclose(
            result.recording["acceleration_tip"].values, signal()["F"] * 9.80665, rtol=1e-15
        )
        assert any("read as gravity" in trap for trap in result.report.traps)


class TestCalibration:
    def test_volts_to_newtons(self, tmp_path: Path) -> None:
        extra = 'calibration = { factor = 250.0, offset = 3.0, from = "V", to = "N" }'
        result = imported(tmp_path, signal(), force(extra, units='units = "mV"'))
        expected = 250.0 * (signal()["F"] / 1000) + 3.0
        np.testing.assert_allclose(result.recording["force_cell_1"].values, expected, rtol=1e-14)

    def test_calibration_from_other_units_than_the_column(self, tmp_path: Path) -> None:
        extra = 'calibration = { factor = 250.0, from = "V", to = "N" }'
        with pytest.raises(UnitsError, match="'V' for a column in 'm'"):
            imported(tmp_path, signal(), force(extra, units='units = "m"'))

    def test_sign_turns_ranges_round(self, tmp_path: Path) -> None:
        extra = "sign = -1\nrange_min = -2.0\nrange_max = 5.0\nnoise_std = 0.5"
        channel = imported(tmp_path, signal(), force(extra, units='units = "kN"')).recording["force_cell_1"]
        assert channel.attrs["range_min"] == -5000.0
        assert channel.attrs["range_max"] == 2000.0
        assert channel.attrs["noise_std"] == 500.0
        np.testing.assert_array_equal(channel.values, signal()["F"] * -1000.0)


class TestClipping:
    def test_samples_at_the_limits_are_flagged_and_counted(self, tmp_path: Path) -> None:
        columns = {"t": TIME_S, "F": np.clip(2 * signal()["F"], -1.0, 1.5)}
        result = imported(tmp_path, columns, force("range_min = -1.0\nrange_max = 1.5"))
        limited = (columns["F"] <= -1.0) | (columns["F"] >= 1.5)
        np.testing.assert_array_equal(result.recording["quality"].values, np.where(limited, 2, 0))
        assert result.report.n_clipped == limited.sum() > 10
        assert result.report.is_flagged


class TestTime:
    def test_gap_becomes_lost_samples(self, tmp_path: Path) -> None:
        kept = np.r_[0:50, 57:200]
        columns = {name: values[kept] for name, values in signal().items()}
        result = imported(tmp_path, columns, force())
        values = result.recording["force_cell_1"].values
        np.testing.assert_array_equal(np.flatnonzero(np.isnan(values)), np.arange(50, 57))
        np.testing.assert_array_equal(values[kept], columns["F"])
        np.testing.assert_array_equal(np.flatnonzero(result.recording["quality"].values), np.arange(50, 57))
        assert result.report.n_lost == 7
        assert any("7 of 200 samples are missing" in trap for trap in result.report.traps)

    def test_empty_cells_become_lost_samples(self, tmp_path: Path) -> None:
        columns = signal()
        columns["F"][[3, 4, 90]] = np.nan
        result = imported(tmp_path, columns, force())
        np.testing.assert_array_equal(np.flatnonzero(result.recording["quality"].values), [3, 4, 90])
        assert result.report.mapped[0].n_not_a_number == 3

    def test_rounded_times_with_a_gap_give_the_true_rate(self, tmp_path: Path) -> None:
        index = np.r_[0:1500, 1600:3000]
        columns = {"t": np.round(index / 1024.0, 3), "F": np.cos(index / 7.0)}
        result = imported(tmp_path, columns, force())
        # 2.93 s written to a millisecond: rates within 0.035 % of each other cannot be told apart
        assert result.recording.attrs["sampling_rate_hz"] == pytest.approx(1024.0, rel=3.5e-4)
        assert result.recording.sizes["time"] == 3000
        assert result.report.n_lost == 100
        assert any("rounded steps" in trap for trap in result.report.traps)

    def test_jitter_is_an_error_that_names_its_size(self, tmp_path: Path) -> None:
        columns = signal()
        columns["t"] = TIME_S + 0.001 * np.sin(np.arange(200.0))
        with pytest.raises(RecordingError, match=r"not uniform: got jitter of 0\.\d+ steps"):
            imported(tmp_path, columns, force())

    def test_accepted_jitter_is_reported(self, tmp_path: Path) -> None:
        columns = signal()
        columns["t"] = TIME_S + 0.001 * np.sin(np.arange(200.0))
        columns["t"][[0, -1]] = TIME_S[[0, -1]]
        result = imported(tmp_path, columns, force(), source='time = "t"\njitter_allowed_steps = 0.2')
        assert result.recording.attrs["sampling_rate_hz"] == pytest.approx(100.0, rel=1e-6)
        assert any("jittering time stamps" in trap for trap in result.report.traps)

    def test_time_running_back_is_refused(self, tmp_path: Path) -> None:
        columns = signal()
        columns["t"] = np.r_[TIME_S[:100], TIME_S[:100]]
        with pytest.raises(RecordingError, match=r"a step back from 0\.99 s to 0 s after sample 99"):
            imported(tmp_path, columns, force())

    def test_no_rate_is_refused(self, tmp_path: Path) -> None:
        with pytest.raises(ChannelMapError, match="sampling rate: got nothing in the file"):
            imported(tmp_path, signal(), force(), source="")

    def test_time_in_milliseconds(self, tmp_path: Path) -> None:
        columns = {"t": TIME_S * 1000, "F": signal()["F"]}
        recording = imported(tmp_path, columns, force(), source='time = "t"\ntime_units = "ms"').recording
        assert recording.attrs["sampling_rate_hz"] == 100.0

    def test_stated_rate_that_contradicts_the_times(self, tmp_path: Path) -> None:
        with pytest.raises(RecordingError, match="time"):
            imported(tmp_path, signal(), force(), source='time = "t"\nsampling_rate_hz = 99.0')

    def test_gigantic_gap_is_refused_before_allocation(self, tmp_path: Path) -> None:
        columns = signal()
        columns["t"] = np.r_[TIME_S[:199], 1e12]
        with pytest.raises(RecordingError, match="gap"):
            imported(tmp_path, columns, force())

    def test_quality_column_is_kept(self, tmp_path: Path) -> None:
        columns = {**signal(), "q": np.where(np.arange(200) == 7, 4.0, 0.0)}
        result = imported(tmp_path, columns, force(), source='time = "t"\nquality = "q"')
        np.testing.assert_array_equal(np.flatnonzero(result.recording["quality"].values == 4), [7])

    def test_legend_of_quality_is_that_of_the_format(self, tmp_path: Path) -> None:
        columns = {"t": np.arange(100) / 100, "F": np.arange(100.0), "q": 4.0 * (np.arange(100) == 7)}
        legend = (
            imported(tmp_path, columns, force(), source='time = "t"\nquality = "q"').recording["quality"].attrs
        )
        masks = dict(zip(legend["flag_meanings"].split(), legend["flag_masks"].tolist(), strict=True))
        assert masks == {"lost": 1, "clipped": 2, "crc_repaired": 4, "out_of_order": 8, "stuck": 16}


class TestDelay:
    def test_whole_steps_are_a_pure_shift(self, tmp_path: Path) -> None:
        result = imported(tmp_path, signal(), force("delay_s = 0.03"))
        values = result.recording["force_cell_1"].values
        np.testing.assert_array_equal(values[:197], signal()["F"][3:])
        assert np.isnan(values[197:]).all()
        assert result.report.n_lost == 3

    @pytest.mark.parametrize("frequency_hz", [0.7, 11.0, 40.0])
    def test_fraction_of_a_step_restores_the_undelayed_sine(self, frequency_hz: float, tmp_path: Path) -> None:
        delay_s = 0.0234
        omega_rad_per_s = 2 * np.pi * frequency_hz
        columns = {"t": TIME_S, "F": np.sin(omega_rad_per_s * (TIME_S - delay_s))}
        values = imported(tmp_path, columns, force(f"delay_s = {delay_s}")).recording["force_cell_1"].values
        inside = np.isfinite(values)
        assert inside.sum() == 200 - 64
        # bound of the windowed sinc stated in its docstring
        np.testing.assert_allclose(values[inside], np.sin(omega_rad_per_s * TIME_S[inside]), atol=1e-5)

    def test_recorded_delay_leaves_the_samples_alone(self, tmp_path: Path) -> None:
        channel = imported(tmp_path, signal(), force('delay_s = 0.0234\ndelay = "record"')).recording[
            "force_cell_1"
        ]
        np.testing.assert_array_equal(channel.values, signal()["F"])
        assert channel.attrs["delay_s"] == 0.0234


class TestJoin:
    def test_several_sources_need_a_rule(self, tmp_path: Path) -> None:
        paths = [written(tmp_path / name, signal()) for name in ("a.csv", "b.csv")]
        with pytest.raises(ChannelMapError, match=r"source\.join: got nothing for 2 source files"):
            import_recording(paths, written_map(tmp_path, force()))

    def test_channels_of_one_clock(self, tmp_path: Path) -> None:
        first = written(tmp_path / "a.csv", signal())
        second = written(tmp_path / "b.csv", {"t": TIME_S + 0.02, "a": np.arange(200.0)})
        body = force() + '[channels.acceleration_tip]\ncolumn = "a"\nunits = "m s-2"\n'
        source = 'time = "t"\njoin = "channels"'
        result = import_recording([first, second], written_map(tmp_path, body, source=source))
        values = result.recording["acceleration_tip"].values
        assert values.size == 202
        np.testing.assert_array_equal(values[2:], np.arange(200.0))
        np.testing.assert_array_equal(result.recording["quality"].values[[0, 1, 200, 201]], [1, 1, 1, 1])
        assert result.report.n_lost == 4

    def test_same_column_in_two_sources_needs_a_choice(self, tmp_path: Path) -> None:
        paths = [written(tmp_path / name, signal()) for name in ("a.csv", "b.csv")]
        with pytest.raises(ChannelMapError, match="2 columns are called"):
            import_recording(paths, written_map(tmp_path, force(), source='time = "t"\njoin = "channels"'))
        chosen = written_map(tmp_path, force("source = 2"), source='time = "t"\njoin = "channels"')
        assert import_recording(paths, chosen).report.mapped[0].source == "b.csv"

    def test_files_in_sequence_keep_the_pause_between_them(self, tmp_path: Path) -> None:
        whole = signal()
        first = written(tmp_path / "a.csv", {name: values[:80] for name, values in whole.items()})
        second = written(tmp_path / "b.csv", {name: values[90:] for name, values in whole.items()})
        result = import_recording(
            [first, second], written_map(tmp_path, force(), source='time = "t"\njoin = "time"')
        )
        expected = whole["F"].copy()
        expected[80:90] = np.nan
        np.testing.assert_array_equal(result.recording["force_cell_1"].values, expected)

    def test_two_rates_are_both_named(self, tmp_path: Path) -> None:
        first = written(tmp_path / "a.csv", signal())
        second = written(tmp_path / "b.csv", {"t": TIME_S / 2, "a": np.arange(200.0)})
        body = force() + '[channels.acceleration_tip]\ncolumn = "a"\nunits = "m s-2"\n'
        with pytest.raises(ChannelMapError, match="200 Hz beside 100 Hz"):
            import_recording([first, second], written_map(tmp_path, body, source='time = "t"\njoin = "channels"'))


class TestMapText:
    @pytest.mark.parametrize(
        ("text", "match"),
        [
            (force("untis = 'N'"), r"channels\.force_cell_1\.untis: got an unknown key.*did you mean 'units'"),
            ("[soruce]\n" + force(), r"soruce: got an unknown key.*did you mean 'source'"),
            (force("sign = 2"), r"sign: got 2; allowed: 1 or -1"),
            (force("range_min = 2.0\nrange_max = 1.0"), "range_min must be below range_max"),
            (force("x_m = nan"), "x_m"),
            (force('quantity = "voltage"'), "says quantity 'voltage'"),
            ('[channels.cell_1]\ncolumn = "F"\n', "must be <quantity>_<place>"),
            ("", r"channels: got nothing"),
            ("[channels]\n", "channels"),
            (force('calibration = { factor = 0.0, from = "V", to = "N" }'), "factor must not be 0"),
            (force("attributes = { units = 'm' }"), "not a free attribute"),
        ],
    )
    def test_wrong_maps_are_explained(self, text: str, match: str, tmp_path: Path) -> None:
        path = tmp_path / "map.toml"
        path.write_text(RUN + text, encoding="utf-8")
        with pytest.raises(ChannelMapError, match=match):
            import_recording([written(tmp_path / "run.csv", signal())], path)

    def test_unknown_column_names_the_nearest(self, tmp_path: Path) -> None:
        body = '[channels.force_cell_1]\ncolumn = "Forze"\nunits = "N"\n'
        with pytest.raises(ChannelMapError, match="did you mean 'Force'"):
            imported(tmp_path, {"t": TIME_S, "Force": signal()["F"]}, body)

    def test_missing_start_time(self, tmp_path: Path) -> None:
        run = '[run]\nexperiment = "other"\nconfiguration = "frozen"\n'
        path = written(tmp_path / "run.csv", signal())
        with pytest.raises(ChannelMapError, match="start_time_utc"):
            import_recording([path], written_map(tmp_path, force(), run=run))

    def test_left_out_columns_are_listed(self, tmp_path: Path) -> None:
        result = imported(tmp_path, {**signal(), "temperature": TIME_S}, force())
        assert any(line.startswith("temperature") for line in result.report.left_out)

    def test_provenance_and_free_attributes(self, tmp_path: Path) -> None:
        import hashlib

        run = RUN + 'repeat = 3\n[run.attributes]\noperator = "third shift"\n'
        path = written(tmp_path / "run.csv", signal())
        attributes = import_recording([path], written_map(tmp_path, force(), run=run)).recording.attrs
        assert (attributes["repeat"], attributes["operator"]) == (3, "third shift")
        assert attributes["source_sha256"] == hashlib.sha256(path.read_bytes()).hexdigest()
        assert attributes["run_id"] == "run"

    def test_all_refusals_are_input_errors(self) -> None:
        assert issubclass(ChannelMapError, InputError)
        assert issubclass(FileFormatError, InputError)

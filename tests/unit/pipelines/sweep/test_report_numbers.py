"""What the report computes, against closed forms."""

from __future__ import annotations

import dataclasses
import math
import re

import numpy as np
import pytest
from synthetic_experiment import (
    MASS_KG,
    PEAK_ACCELERATION_G,
    PEAK_OMEGA_BAR,
    PEAK_W_BAR,
    beta_law,
    resonance_hz,
    rig,
    shaker_experiment,
    shaker_run,
    work_experiment,
)

from pipelines.report.figure import NothingToDrawError
from pipelines.report.style import drawing_style, new_figure
from pipelines.report.tables import channel_table, provenance_table
from pipelines.sweep import figures_maps, figures_quality, figures_viscous, selection, summary, tables
from pipelines.sweep.figures_response import responses
from pipelines.sweep.figures_signals import signal_panels
from pipelines.sweep.figures_work import fill_curves, work_bars
from pipelines.sweep.planes import dimensional_plane, iso_levels_g, scaled_plane
from pipelines.sweep.results import RunResult


def runs_at(*levels: float, **options: object) -> list[RunResult]:
    return [shaker_run(f"run {level}", level, rig(), "rig.toml", **options) for level in levels]  # type: ignore[arg-type]


def test_accelerance_peak_of_a_softening_oscillator_per_level() -> None:
    stiffness = (82_000.0, 78_000.0, 74_000.0)
    found = responses(selection.by_level(work_experiment(stiffness).runs))
    assert [round(response.peak_hz, 3) for response in found] == pytest.approx(
        [resonance_hz(k) for k in stiffness], abs=0.004
    )
    assert found[0].peak_hz > found[1].peak_hz > found[2].peak_hz
    # the work of a viscous damper under a constant force, πcΩu₀² with u₀ = F/|Z|, is largest near ω₀
    natural = [math.sqrt(k / MASS_KG) / (2 * math.pi) for k in stiffness]
    assert [response.work_peak_hz for response in found] == pytest.approx(natural, rel=0.002)


def test_peaks_of_other_modes_do_not_count() -> None:
    [run] = work_experiment().runs[:1]
    spike = run.windows.copy(deep=True)
    spike["apparent_mass_kg"][10], spike["gamma_kg_per_s"][10] = (
        1e-6,
        1e-6,
    )  # a force that almost vanishes, far off
    spike["work_j"][10] = 1e3
    [response] = responses([dataclasses.replace(run, windows=spike)])
    assert response.peak_hz == pytest.approx(resonance_hz(82_000.0), abs=0.004)
    assert response.work_peak_hz == pytest.approx(response.peak_hz, rel=0.01)


def test_accelerance_tends_to_one_over_the_mass_far_above_resonance() -> None:
    # ü/F = 1/(m − k/Ω² − jc/Ω): its phase is above zero, which is acceleration ahead of a mass's
    response = responses(work_experiment((8_000.0, 7_000.0, 6_000.0)).runs)[0]
    top = int(np.argmax(response.frequency_hz))
    omega = 2 * math.pi * 15.0
    expected = 1 / complex(MASS_KG - 8_000.0 / omega**2, -60.0 / omega)
    assert response.accelerance_per_kg[top] == pytest.approx(expected, rel=1e-9)
    assert response.accelerance_per_kg[top].imag > 0


def test_summary_says_that_the_mode_softens() -> None:
    text = " ".join(summary.sentences(work_experiment()))
    assert f"{resonance_hz(82_000.0):.2f} Hz" in text
    assert f"{resonance_hz(74_000.0):.2f} Hz" in text
    assert "the mode softens" in text


def test_largest_w_bar_of_the_summary_is_the_top_of_the_law() -> None:
    text = summary.sentences(shaker_experiment((0.5,)))[1]
    value, omega, u = (float(text.split(mark)[1].split()[0].strip(",")) for mark in ("largest, ", "ω̄ = ", "ū = "))
    assert value == pytest.approx(PEAK_W_BAR, rel=0.02)
    assert omega == pytest.approx(PEAK_OMEGA_BAR, abs=0.2)
    assert u == pytest.approx(PEAK_ACCELERATION_G / PEAK_OMEGA_BAR**2, abs=0.03)


def test_onset_is_interpolated_between_levels_by_their_logarithm() -> None:
    runs = runs_at(0.5, 1.0)
    means = [float(run.windows["w_bar"].mean()) for run in runs]
    middle = 0.5 * (means[0] + means[1])
    assert summary.onset_g(runs, middle) == pytest.approx(math.sqrt(0.5), rel=1e-9)
    assert math.isnan(summary.onset_g(runs, 100.0))


def test_beta_table_is_the_mean_over_the_windows_of_a_level() -> None:
    table = tables.beta_table(shaker_experiment((0.5, 0.25), (0.5, 1.5)))
    assert table.header == ("level [g]", "α = 0.50", "α = 0.25")
    assert table.rows[0][0] == "0.5"
    expected = float(beta_law(np.array(0.5)))  # 0.5 g is below the stroke limit everywhere
    assert float(table.rows[0][1].replace("−", "-")) == pytest.approx(expected, abs=5e-4)


def test_free_surface_table_has_the_published_frequencies_table_1_1() -> None:
    table = tables.free_surface_table(shaker_experiment((0.5, 0.25), (2.0,)).rigs)
    row = next(row for row in table.rows if row[:2] == ("2", "0"))
    assert [float(cell) for cell in row[2:]] == pytest.approx([2.909, 2.179], rel=0.0013)


def test_viscous_table_states_c2_of_the_maximum() -> None:
    table = tables.viscous_table(shaker_experiment((0.5,), (2.0,)).rigs[0])
    # E.4 by hand: c = m_l/π √(g/h) ω̄ W̄
    expected = 0.124323 / math.pi * 18.991 * PEAK_OMEGA_BAR * PEAK_W_BAR
    assert [float(row[3]) for row in table.rows] == pytest.approx([expected] * 3, rel=0.05)


def test_the_rule_that_names_smooth_windows_is_told_and_counted() -> None:
    """By hand: three of six windows are called Faraday; of two of these another share is larger."""
    windows = shaker_experiment((0.5,), (2.0,)).windows.isel(window=slice(6)).copy(deep=True)
    labels = ["Faraday", "Faraday", "Faraday", "impacts", "chaotic", "quiet"]
    shares = {
        "subharmonic_share": [0.8, 0.026, 0.0, 0.1, 0.1, 0.0],
        "harmonic_share": [0.1, 0.9, 0.0, 0.8, 0.2, 0.0],
        "unrepeated_share": [0.1, 0.074, 1.0, 0.1, 0.7, 1.0],
    }
    windows["regime"] = ("window", np.array(labels))
    for name, values in shares.items():
        windows[name] = ("window", np.array(values))
    caption = tables.regime_table(windows).caption
    assert "2 of the 3 windows called Faraday, whatever their largest share" in caption
    assert "dissipates smoothly, with less than 0.05 of m_l ü beside the fundamental" in caption
    only_by_shares = tables.regime_table(windows.isel(window=[0, 3, 4, 5])).caption
    assert "whatever their largest share" not in only_by_shares


@pytest.mark.parametrize("rms_kg", [0.015, 0.49, 2.0])
def test_errors_of_masses_are_not_in_a_g_beside_contours_in_g(rms_kg: float) -> None:
    maps = shaker_experiment((0.5,), (2.0, 3.0)).rigs[0].maps
    result = dataclasses.replace(maps.validation["work_j"], left_out_windows_rms=rms_kg, left_out_runs_rms=rms_kg)
    shown = dataclasses.replace(maps, validation={"work_j": result})
    text = figures_maps.error_text(shown, "work_j", "W/(u₀Ω)²", "kg")
    assert re.findall(r"left out: (\S+) (\S+)", text) == [(f"{rms_kg:#.2g}", "kg")] * 2
    assert " g" not in text.replace(" kg", "")


def test_every_table_row_is_as_long_as_its_header() -> None:
    experiment = shaker_experiment(extra=True)
    shown = [
        tables.run_table(experiment.runs), tables.dry_mass_table(experiment.rigs), tables.beta_table(experiment),
        tables.regime_table(experiment.windows), tables.settings_table(experiment),
        channel_table(experiment.runs), tables.agreement_table(experiment.runs),
        tables.identity_table(experiment), tables.validation_table(experiment),
        provenance_table(experiment.provenance),
        tables.resonance_table(work_experiment().runs), tables.work_level_table(work_experiment().runs),
    ]  # fmt: skip
    for table in shown:
        assert table is not None
        assert table.rows
        assert {len(row) for row in table.rows} == {len(table.header)}, table.title


def test_dry_mass_without_identified_gain_says_so() -> None:
    [rig_result] = shaker_experiment((0.5,), (2.0,)).rigs
    identified = rig_result.dry_mass
    assert identified is not None
    alone = dataclasses.replace(rig_result, dry_mass=dataclasses.replace(identified, gain_ratio_std=math.nan))
    unknown = dataclasses.replace(rig_result, dry_mass=None)
    rows = tables.dry_mass_table([alone, unknown]).rows
    assert rows[0][4] == "taken as 1"
    assert rows[1][1:3] == ("0.6100", "–")


def test_identity_difference_compares_with_w_bar() -> None:
    experiment = shaker_experiment((0.5,), (1.5, 3.0))
    difference, _, unit = figures_quality.identity_difference(experiment.windows)
    # the fundamental does 99 % of the work in these windows
    assert difference == pytest.approx(0.01 * experiment.windows["w_bar"].values, rel=1e-9)
    assert unit == "1"


def test_reference_runs_are_the_nearest_levels_each_once() -> None:
    chosen = selection.reference_runs(runs_at(0.5, 1.4, 2.9, 6.0))
    assert [selection.level_g(run) for run in chosen] == [1.4, 2.9]
    assert [selection.level_g(run) for run in selection.reference_runs(runs_at(2.0))] == [2.0]
    assert [selection.level_g(run) for run in selection.reference_runs(runs_at(0.2, 20.0))] == [0.2]
    assert selection.reference_runs([]) == ()


def test_reference_runs_prefer_upward_sweeps_to_others_of_the_level() -> None:
    down = shaker_run("down", 3.0, rig(), "rig.toml", down=True)
    vfa = shaker_run("vfa", 3.0, rig(), "rig.toml", experiment="shaker_vfa")
    up = shaker_run("up", 3.0, rig(), "rig.toml")
    assert [run.attributes.run_id for run in selection.reference_runs([down, vfa, up], [3.0])] == ["up"]


def test_reference_points_are_where_the_excerpts_were_taken() -> None:
    points = selection.reference_points(runs_at(1.5, 3.0))
    assert len(points) == 6
    # 3 g at 9 Hz is u₀ = 9.2 mm
    assert points[3].amplitude_m * 1e3 == pytest.approx(9.2, abs=0.8)


def test_signals_are_normalised_by_the_inertia_and_the_amplitude() -> None:
    panels = signal_panels(runs_at(1.5, 3.0), rig().liquid_mass_kg)
    assert (panels.n_rows, panels.n_columns) == (3, 2)
    for panel in panels.panels:
        assert np.abs(panel.force).max() == pytest.approx(1.0, abs=2e-3)
        assert np.abs(panel.displacement).max() == pytest.approx(1.0, abs=2e-3)
        # the force lags by 0.6 rad: W = −∮ F_S du = π sin 0.6 per period, dissipated; the trapezia of 50
        # samples per period take (2π/50)²/6 = 0.26 % off
        area = -np.trapezoid(panel.force, panel.displacement) / 12
        assert area == pytest.approx(math.pi * math.sin(0.6), rel=3e-3)


def test_signals_without_excerpts_are_not_drawn() -> None:
    bare = [dataclasses.replace(run, excerpts=()) for run in runs_at(1.5)]
    with pytest.raises(NothingToDrawError, match="no run keeps an excerpt"):
        signal_panels(bare, 0.1)


def test_bars_mark_the_reference_points_and_carry_the_standard_error() -> None:
    bars = work_bars(runs_at(1.5, 3.0))
    assert [int(bar.is_reference.sum()) for bar in bars] == [3, 3]
    assert bars[0].work_std_j == pytest.approx(0.1 * bars[0].work_j / math.sqrt(12))


def test_fill_curves_hold_one_point_per_fill_in_order() -> None:
    curves = fill_curves(shaker_experiment((0.5, 0.25), (1.5, 3.0)))
    assert {level for level, _ in curves} == {1.5, 3.0}
    assert all([row[0] for row in rows] == [0.25, 0.5] for rows in curves.values())
    rows = curves[(3.0, 13.0)]
    # same W̄ law at both fills, half the liquid: half the work
    assert rows[0][1] / rows[1][1] == pytest.approx(0.5, rel=1e-6)


def test_iso_levels_are_the_stated_ones_or_round_ones() -> None:
    assert iso_levels_g(runs_at(0.5, 1.5, 6.0)) == [0.5, 1.5, 6.0]
    many = runs_at(*np.linspace(0.5, 6, 12).tolist())
    assert set(iso_levels_g(many)) <= {0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0}


def test_planes_put_a_point_where_the_definitions_do() -> None:
    # 3 g at 13 Hz: u₀ = 4.411 mm, ū = 0.1622, ω̄ = 4.301, v̄ = 0.6974 by hand from (1.16), (1.17)
    assert dimensional_plane().abscissa(13.0, 3.0) == pytest.approx(4.411, rel=2e-4)
    plane = scaled_plane(rig())
    assert plane.abscissa(13.0, 3.0) == pytest.approx(0.1622, rel=4e-4)
    assert plane.ordinate(13.0) == pytest.approx(4.301, rel=2e-4)
    assert scaled_plane(rig(), "v_bar").abscissa(13.0, 3.0) == pytest.approx(0.6974, rel=3e-4)
    assert plane.abscissa(13.0, 3.0) * plane.ordinate(13.0) ** 2 == pytest.approx(3.0, rel=1e-9)


def test_a_map_is_drawn_inside_the_measured_region_only() -> None:
    [rig_result] = shaker_experiment((0.5,), (2.0,)).rigs
    field = figures_maps.scaled_field(rig_result.maps.dataset, "w_bar", rig_result.rig, "W̄")
    with drawing_style():
        figure = new_figure(4.0)
        axes = figure.subplots()
        figures_maps.arrange_plane(axes, field.plane, field.abscissa, field.ordinate)
        figures_maps.draw_map(figure, axes, field, figures_maps.shades(field.values, signed=False))
        pixels = _rendered(figure)
        top = axes.transData.transform((PEAK_ACCELERATION_G / PEAK_OMEGA_BAR**2, PEAK_OMEGA_BAR))
        outside = axes.transData.transform((0.4, 6.0))
    height = pixels.shape[0]
    bright = pixels[height - 1 - int(top[1]), int(top[0])].astype(int)
    empty = pixels[height - 1 - int(outside[1]), int(outside[0])].astype(int)
    assert bright[0] > 200  # the yellow end of the colours
    assert bright[2] < 80
    assert np.ptp(empty) < 6  # grey
    assert empty.min() > 225


def test_viscous_damping_of_the_map_is_that_of_its_work() -> None:
    """A damper c takes π c u₀² Ω per cycle (E.2); the work of the map is W̄ m_l u₀² Ω²."""
    [rig_result] = shaker_experiment((0.5,), (2.0,)).rigs
    field = figures_viscous.viscous_field(rig_result)
    w_bar = rig_result.maps.dataset["w_bar"].transpose("omega_bar", "u_bar")
    omega = rig_result.maps.dataset["omega_bar"].values[:, None] * np.sqrt(9.81 / rig_result.rig.tank.height_m)
    work = w_bar.values * rig_result.rig.liquid_mass_kg * omega**2  # per u₀²
    assert np.isfinite(field.values).any()
    np.testing.assert_allclose(np.pi * field.values * omega, work, rtol=1e-9)


def _rendered(figure: object) -> np.ndarray:
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = FigureCanvasAgg(figure)  # type: ignore[arg-type]
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def test_a_map_without_a_finite_value_gives_a_reason() -> None:
    [rig_result] = shaker_experiment((0.5,), (2.0,)).rigs
    empty = rig_result.maps.dataset.assign(w_bar=rig_result.maps.dataset["w_bar"] * np.nan)
    with pytest.raises(NothingToDrawError, match="no finite value"):
        figures_maps.scaled_field(empty, "w_bar", rig_result.rig, "W̄")


def test_shades_keep_zero_in_the_middle_for_both_signs_and_contain_the_range() -> None:
    both = figures_maps.shades(np.array([-1.0, 0.7]), signed=True)
    assert both["levels"][0] == pytest.approx(-both["levels"][-1])
    assert both["levels"][-1] >= 1.0
    negative = figures_maps.shades(np.array([-0.6, -0.1]), signed=True)["levels"]
    assert negative[0] <= -0.6
    assert -0.1 <= negative[-1] < 0.0
    constant = figures_maps.shades(np.array([2.0, 2.0]), signed=False)["levels"]
    assert (np.diff(constant) > 0).all()

"""The numbers of the study as Markdown tables, as `docs/scaling.md` shows them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from studies.tank_scaling.campaign import LAYERS, RESOLUTION, RESOLUTION_POINT, Run
from studies.tank_scaling.changes import Mean, left_out_shares, measured, size_change
from studies.tank_scaling.harmonic_runs import Point
from studies.tank_scaling.networks import ModelError
from studies.tank_scaling.similarity import SimilarTank

Results = Mapping[Run, Mapping[str, Any]]


def tank_table(sizes: Sequence[float]) -> Iterator[str]:
    """Sizes and their numbers without dimension.

    Parameters
    ----------
    sizes : sequence of float
    """
    yield "| λ | h | times, velocities × | Re = h√(gh)/ν | Bo = ρgh²/σ |"
    yield "|---|---|---|---|---|"
    for size in sizes:
        tank = SimilarTank(size)
        yield (
            f"| {size:.3g} | {1e3 * tank.height_m:.4g} mm | {tank.time_ratio:.3g} |"
            f" {tank.reynolds_number:.3g} | {tank.bond_number:.3g} |"
        )


def point_table(results: Results, points: Sequence[Point], sizes: Sequence[float]) -> Iterator[str]:
    """W̄ and β of every point in every tank.

    Parameters
    ----------
    results : mapping
    points : sequence of Point
    sizes : sequence of float
    """
    yield "| ω̄, a₀ | | " + " | ".join(f"λ = {size:.3g}" for size in sizes) + " |"
    yield "|---|---|" + "---|" * len(sizes)
    for point in points:
        found = [measured(results, point, size) for size in sizes]
        yield f"| {point.omega_bar:g}, {point.level_g:g} g | W̄ | " + _row([one.w_bar for one in found], 2)
        # narrower, for lines of the page must not grow beyond 120 characters
        yield "| … | β | " + _row([one.beta for one in found], 3).replace(" ± ", "±")


def change_table(results: Results, points: Sequence[Point], sizes: Sequence[float]) -> Iterator[str]:
    """How far sizes differ from the training tank.

    Parameters
    ----------
    results : mapping
    points : sequence of Point
    sizes : sequence of float
    """
    yield "| λ | W̄: mean change | rms | of chance | β: mean change | rms | of chance |"
    yield "|---|---|---|---|---|---|---|"
    for size in sizes:
        found = size_change(results, points, size)
        yield _minus(
            f"| {size:.3g} | {100 * found.work_mean:+.1f} % | {100 * found.work_rms:.1f} % |"
            f" {100 * found.work_noise:.1f} % | {found.beta_mean:+.3f} | {found.beta_rms:.3f} |"
            f" {found.beta_noise:.3f} |"
        )


def resolution_table(results: Results) -> Iterator[str]:
    """One point with finer particles.

    Parameters
    ----------
    results : mapping
    """
    yield "| spacing | λ | W̄ | β |"
    yield "|---|---|---|---|"
    for layers, size in ((LAYERS, 1.0), (LAYERS, 25.0), *RESOLUTION):
        found = measured(results, RESOLUTION_POINT, size, layers)
        yield f"| h/{layers} | {size:g} | " + _row([found.w_bar], 2)[:-1] + "| " + _row([found.beta], 3)


def left_out_table(results: Results, points: Sequence[Point]) -> Iterator[str]:
    """What is not computed, in shares of W̄ in the training tank.

    Parameters
    ----------
    results : mapping
    points : sequence of Point
    """
    yield "| ω̄, a₀ | wall layers | surface tension |"
    yield "|---|---|---|"
    for point in points:
        found = measured(results, point, 1.0)
        shares = (found.wall_layers / found.w_bar.value, found.surface_tension / found.w_bar.value)
        yield (
            f"| {point.omega_bar:g}, {point.level_g:g} g | "
            + " | ".join(f"{100 * s:.1f} %" for s in shares)
            + " |"
        )
    yield "| of the sums | " + " | ".join(f"{100 * s:.1f} %" for s in left_out_shares(results, points)) + " |"


def model_table(errors: Sequence[ModelError]) -> Iterator[str]:
    """Scaled models beside what was computed.

    Parameters
    ----------
    errors : sequence of ModelError
    """
    yield "| λ | W̄ at the points, rms | β, rms | force in the varied motion | of another seed | energy |"
    yield "|---|---|---|---|---|---|"
    for one in errors:
        yield _minus(
            f"| {one.size:g} | {100 * one.w_bar_rms:.1f} % | {one.beta_rms:.3f} | {100 * one.force_rms:.1f} % |"
            f" {_percent(one.other_seed_rms)} | {100 * one.energy:+.1f} % |"
        )


def _percent(share: float) -> str:
    return "–" if math.isnan(share) else f"{100 * share:.1f} %"


def _row(means: Sequence[Mean], digits: int) -> str:
    return _minus(" | ".join(f"{mean.value:.{digits}f} ± {mean.error:.{digits}f}" for mean in means) + " |")


def _minus(text: str) -> str:
    return text.replace("-", "−")

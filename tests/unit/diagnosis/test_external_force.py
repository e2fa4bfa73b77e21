"""Forces that no motion makes: answers to pulses in closed form, and what a missing force shows of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from recorded_oscillators import (
    RATE_HZ,
    decays,
    effect,
    rig,
    surroundings,
)

from sloshlab.diagnosis.selection import fitted_runs
from sloshlab.diagnosis.selection.fitted_runs import _refined, places_in_runs, values_of_runs
from sloshlab.identification.free_run_problem import FreeRunFit, FreeRunProblem
from sloshlab.identification.observations import observations
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import Candidate, MissingForce, Surroundings, candidates
from sloshlab.twin.excitation import free
from sloshlab.twin.external_forces import HARMONIC_FORCE, PULSE_TRAIN
from sloshlab.twin.structure import single_degree_of_freedom
from sloshlab.twin.twin import Twin

assert effects.__all__
FORCE_N, WIDTH_S, PERIOD_S, START_S = 3.0, 0.06, 0.5, 0.2


@pytest.mark.parametrize("alternates", [0.0, 1.0])
def test_a_train_of_pulses_leaves_the_sum_of_their_impulse_responses(alternates: float) -> None:
    """A haversine leaves F sin(ωw/2) Ω²/(m ω² (Ω² − ω²)) sin ω(t − t_k − w/2) behind, Ω = 2π/w."""
    m, k = 2.0, 3200.0
    omega, big = 40.0, 2 * np.pi / WIDTH_S
    term = PULSE_TRAIN(
        place="structure",
        size_n=FORCE_N,
        start_s=START_S,
        period_s=PERIOD_S,
        width_s=WIDTH_S,
        alternates=alternates,
    )
    run = Twin(single_degree_of_freedom(m, k)).with_term(term).simulate(free(2.5, 1000.0), n_substeps=4)
    time = np.arange(run.displacement_m.size) / 1000.0
    one = FORCE_N * np.sin(0.5 * omega * WIDTH_S) * big**2 / (m * omega**2 * (big**2 - omega**2))
    starts = START_S + PERIOD_S * np.arange(5)
    signs = (-1.0) ** np.arange(5) if alternates else np.ones(5)
    for n in range(1, 6):
        after = (time > starts[n - 1] + WIDTH_S) & (time < START_S + PERIOD_S * n)
        expected = sum(
            sign * one * np.sin(omega * (time[after] - start - 0.5 * WIDTH_S))
            for sign, start in zip(signs[:n], starts[:n], strict=True)
        )
        # Runge–Kutta of order 4 with 4000 steps a second
        np.testing.assert_allclose(run.displacement_m[after], expected, atol=1e-6 * one)
    assert np.abs(run.displacement_m[time < START_S]).max() == 0.0


def test_a_machine_shakes_a_mass_by_its_dynamic_stiffness() -> None:
    """F/|k − m ω² + i c ω| and its phase, once the start has died away."""
    m, k, frequency, phase, reference = 2.0, 3200.0, 9.0, 0.15, 5.0
    c = 2 * 0.05 * np.sqrt(k * m)
    term = HARMONIC_FORCE(
        place="structure", frequency_hz=frequency, size_n=2.0, phase=phase, reference_s=reference
    )
    run = Twin(single_degree_of_freedom(m, k, c)).with_term(term).simulate(free(10.0, 1000.0), n_substeps=2)
    time = np.arange(run.displacement_m.size) / 1000.0
    w = 2 * np.pi * frequency
    answer = 2.0 / (k - m * w**2 + 1j * c * w) * np.exp(2j * np.pi * (frequency * (time - reference) + phase))
    late = time > 8.0
    np.testing.assert_allclose(run.displacement_m[late], answer.imag[late], atol=2e-6 * abs(answer[0]))


@pytest.fixture(scope="module")
def pulsed(tmp_path_factory: pytest.TempPathFactory) -> RigModel:
    """Two decays with a train that begins at another instant in each, integrated by scipy."""
    folder = tmp_path_factory.mktemp("pulsed")
    runs = [
        replace(decays((0.01,), 4.0, noise={}, force=pulses(start))[0], name=name)
        for name, start in (("first", 0.37), ("second", 0.81))
    ]
    return RigModel(rig(folder), folder, runs)


def pulses(
    start_s: float, every_other: float = 1.0, period_s: float = PERIOD_S
) -> Callable[[float, float, float], float]:
    def force(t: float, x: float, v: float) -> float:
        n, within = divmod(t - start_s, period_s)
        inside = t >= start_s and within < WIDTH_S
        sign = every_other if n % 2 else 1.0
        return sign * FORCE_N * 0.5 * (1 - np.cos(2 * np.pi * within / WIDTH_S)) if inside else 0.0

    return force


def of_runs(model: RigModel) -> Surroundings:
    return replace(surroundings(model), runs=tuple(run.name for run in model.runs))


def test_every_run_has_instants_of_its_own(pulsed: RigModel) -> None:
    at = of_runs(pulsed)
    [train] = [candidate for candidate in candidates(at) if candidate.key == "structure.external_force"]
    names = [parameter.name for parameter in train.effect.parameters]
    assert names == ["size_n", "period_s", "width_s", "start_s in first", "start_s in second"]
    numbers = dict(zip(names, (FORCE_N, PERIOD_S, WIDTH_S, 0.37, 0.81), strict=True))
    extension = train.extension(numbers)
    for run in pulsed.runs:
        x = pulsed.simulate(run, pulsed.believed, extension)["displacement_tank"]
        # a pulse is rounded where the samples of the engine's steps fall
        np.testing.assert_allclose(x, run.recording["displacement_tank"].values, atol=2e-6)
    exchanged = train.extension(numbers | {"start_s in first": 0.81, "start_s in second": 0.37})
    for run in pulsed.runs:
        x = pulsed.simulate(run, pulsed.believed, exchanged)["displacement_tank"]
        assert np.abs(x - run.recording["displacement_tank"].values).max() > 1e-3


def test_a_missing_force_shows_the_train_that_is_in_it(pulsed: RigModel) -> None:
    generator = np.random.default_rng(5)
    time = np.arange(2000) / RATE_HZ
    missing = {
        name: MissingForce(
            np.array([pulses(start)(t, 0.0, 0.0) for t in time]) + 0.3 * generator.standard_normal(time.size)
        )
        for name, start in (("first", 0.37), ("second", 0.21))
    }
    train = Candidate(effect("structure.external_force").of_runs(("first", "second")), of_runs(pulsed))
    best = train.proposed(missing)[0]
    key = "structure.external_force"
    # within half a width over eight seconds
    assert best[f"{key}.period_s"] == pytest.approx(PERIOD_S, abs=0.5 * WIDTH_S * PERIOD_S / 8.0)
    assert best[f"{key}.size_n"] == pytest.approx(FORCE_N, rel=0.25)
    for name, start in (("first", 0.37), ("second", 0.21)):
        off = (best[f"{key}.start_s in {name}"] - start + 0.5 * PERIOD_S) % PERIOD_S - 0.5 * PERIOD_S
        assert abs(off) < WIDTH_S


def test_pulses_show_beside_what_accelerometers_do_not_tell(pulsed: RigModel) -> None:
    """A slow force stronger than the pulses is noise of a double integral, whose power falls with f⁴."""
    generator, starts, key = np.random.default_rng(8), {"first": 0.37, "second": 0.21}, "structure.external_force"
    time, n = np.arange(2000) / RATE_HZ, 2000
    frequency_hz = np.fft.rfftfreq(2 * n, 1 / RATE_HZ)
    noise_power = n * 0.35**2 * (1.0 + (5.0 / np.maximum(frequency_hz, 0.3)) ** 4)
    of_noise = np.sqrt(noise_power / n)
    missing = {}
    for name, start in starts.items():
        slow = np.fft.irfft(of_noise * np.fft.rfft(generator.standard_normal(2 * n)), 2 * n)[:n]
        force = np.array([pulses(start)(t, 0.0, 0.0) for t in time]) + slow
        assert np.std(slow) > FORCE_N
        missing[name] = MissingForce(force, noise_power)
    train = Candidate(effect(key).of_runs(tuple(starts)), of_runs(pulsed))
    best = train.proposed(missing)[0]
    assert best[f"{key}.period_s"] == pytest.approx(PERIOD_S, abs=0.5 * WIDTH_S * PERIOD_S / 8.0)
    assert best[f"{key}.size_n"] == pytest.approx(FORCE_N, rel=0.25)
    for name, start in starts.items():
        assert best[f"{key}.start_s in {name}"] == pytest.approx(start, abs=WIDTH_S)


def test_a_force_along_a_shape_is_its_size_with_the_noise_of_its_power() -> None:
    """As a matched filter (North 1943): A p where a shape of size A begins, and p is the variance of the noise."""
    generator, n, rate_hz = np.random.default_rng(9), 2000, 250.0
    noise_power = n * 0.3**2 * (1.0 + (np.fft.rfftfreq(2 * n, 1 / rate_hz) / 20.0) ** 2)
    shape = 0.5 * (1 - np.cos(2 * np.pi * np.arange(40) / 40))
    pulse = np.zeros(n)
    pulse[700:740] = 2.5 * shape
    along, power = MissingForce(pulse, noise_power).along(shape)
    assert along.size == n - shape.size + 1
    assert np.argmax(along) == 700
    assert along[700] == pytest.approx(2.5 * power)
    white = generator.standard_normal((20, 2 * n))
    coloured = np.fft.irfft(np.sqrt(noise_power / n) * np.fft.rfft(white), 2 * n)[:, :n]
    of_noise = [MissingForce(force, noise_power).along(shape)[0] for force in coloured]
    assert np.var(of_noise) == pytest.approx(power, rel=0.1)


@pytest.mark.parametrize("key", ["structure.external_force", "structure.alternating_pulses"])
@pytest.mark.parametrize("size_n", [FORCE_N, -FORCE_N])
def test_a_train_may_begin_later_than_its_period_or_before_the_run(
    pulsed: RigModel, key: str, size_n: float
) -> None:
    """Folded by the period, both fall on one instant; what alternates begins there with another sign."""
    alternates = key.endswith("alternating_pulses")
    starts = {"first": 0.13, "second": PERIOD_S + 0.08} | ({"third": 0.27 - PERIOD_S} if alternates else {})
    time = np.arange(2000) / RATE_HZ
    missing = {
        name: MissingForce(
            np.array([size_n / FORCE_N * pulses(start, -1.0 if alternates else 1.0)(t, 0.0, 0.0) for t in time])
        )
        for name, start in starts.items()
    }
    train = Candidate(effect(key).of_runs(tuple(starts)), of_runs(pulsed))
    best = train.proposed(missing)[0]
    # the pulses' own width is none of those that are tried: 0.25 of a period is nearest
    assert best[f"{key}.size_n"] == pytest.approx(size_n, rel=0.25)
    assert best[f"{key}.period_s"] == pytest.approx(PERIOD_S, abs=0.5 * WIDTH_S * PERIOD_S / 8.0)
    for name, start in starts.items():
        assert best[f"{key}.start_s in {name}"] == pytest.approx(start, abs=WIDTH_S)


def test_alternating_pulses_are_told_by_the_first_that_is_seen(pulsed: RigModel) -> None:
    """Reversed they would have begun before the runs, and in a run that they begin late one pulse too many."""
    starts, key = {"first": 0.13, "second": 0.21}, "structure.alternating_pulses"
    time = np.arange(2000) / RATE_HZ
    missing = {
        name: MissingForce(np.array([pulses(start, -1.0)(t, 0.0, 0.0) for t in time]))
        for name, start in starts.items()
    }
    train = Candidate(effect(key).of_runs(tuple(starts)), of_runs(pulsed))
    [only] = train.proposed(missing)
    assert only[f"{key}.size_n"] == pytest.approx(FORCE_N, rel=0.25)
    assert all(
        only[f"{key}.start_s in {name}"] == pytest.approx(start, abs=WIDTH_S) for name, start in starts.items()
    )


def test_a_missing_force_shows_the_line_that_is_in_it(pulsed: RigModel) -> None:
    generator = np.random.default_rng(6)
    at = of_runs(pulsed)
    time = np.arange(1000) / RATE_HZ
    middle = 0.5 * at.longest_run_s
    phases = {"first": 0.8, "second": 0.3}
    missing = {
        name: MissingForce(
            1.7 * np.sin(2 * np.pi * (11.3 * (time - middle) + phase)) + 0.3 * generator.standard_normal(1000)
        )
        for name, phase in phases.items()
    }
    line = Candidate(effect("structure.harmonic_force").of_runs(tuple(phases)), at)
    best = line.proposed(missing)[0]
    assert best["structure.harmonic_force.frequency_hz"] == pytest.approx(11.3, abs=0.05)
    assert best["structure.harmonic_force.size_n"] == pytest.approx(1.7, rel=0.05)
    for name, phase in phases.items():
        off = (best[f"structure.harmonic_force.phase in {name}"] - phase + 0.5) % 1.0 - 0.5
        assert abs(off) < 0.03


def test_forces_of_runs_are_not_sought_where_runs_have_no_names(pulsed: RigModel) -> None:
    assert not [found for found in candidates(surroundings(pulsed)) if found.effect.known_as == "external_force"]


def test_numbers_of_runs_that_were_not_fitted_leave_those_of_the_fitted_alone(pulsed: RigModel) -> None:
    line = Candidate(effect("structure.harmonic_force").of_runs(("first", "second")), of_runs(pulsed))
    key = line.key
    _, second = (observations(run, pulsed.compared(run)) for run in pulsed.runs)
    numbers = {f"{key}.size_n": 0.4, f"{key}.frequency_hz": 9.4, f"{key}.phase in first": 0.37}
    fit = FreeRunFit((line,), {**pulsed.believed, **numbers}, 0.0, 0.0)
    found = values_of_runs(pulsed, [second], fit)
    assert found[f"{key}.phase in first"] == 0.37
    assert f"{key}.phase in second" in found
    assert found[f"{key}.size_n"] == 0.4


def test_an_instant_has_six_places_in_a_period_of_the_motion(pulsed: RigModel) -> None:
    at = of_runs(pulsed)
    train = Candidate(effect("structure.external_force").of_runs(("first", "second")), at)
    problem = FreeRunProblem(pulsed, [observations(run, pulsed.compared(run)) for run in pulsed.runs], [train])
    found = places_in_runs(problem, train)
    assert found == pytest.approx(
        {f"{train.key}.start_s in {run}": 1 / (6 * at.frequency_hz) for run in ("first", "second")}
    )


@pytest.mark.parametrize("is_shown", [True, False])
def test_the_instant_of_pulses_is_found_in_a_run_that_was_not_fitted(
    pulsed: RigModel, monkeypatch: pytest.MonkeyPatch, is_shown: bool
) -> None:
    """From the start of the run no step leads to a pulse many widths away; by draws where no force is known."""
    if not is_shown:
        monkeypatch.setattr(fitted_runs, "latent_forces", lambda *_: {})
    train = Candidate(effect("structure.external_force").of_runs(("first", "second")), of_runs(pulsed))
    key = train.key
    _, second = (observations(run, pulsed.compared(run)) for run in pulsed.runs)
    numbers = {"size_n": FORCE_N, "period_s": PERIOD_S, "width_s": WIDTH_S, "start_s in first": 0.37}
    fit = FreeRunFit((train,), {**pulsed.believed, **{f"{key}.{n}": v for n, v in numbers.items()}}, 0.0, 0.0)
    found = values_of_runs(pulsed, [second], fit)
    assert found[f"{key}.start_s in second"] == pytest.approx(0.81, abs=0.002)


def test_of_a_known_train_a_missing_force_shows_the_instants_alone(pulsed: RigModel) -> None:
    """Beside twice as strong blows of another train, of which it would show those otherwise."""
    time, key = np.arange(1000) / RATE_HZ, "structure.external_force"
    other = pulses(0.05, period_s=0.7)
    missing = {
        "second": MissingForce(np.array([pulses(0.81)(t, 0.0, 0.0) + 2.0 * other(t, 0.0, 0.0) for t in time]))
    }
    train = Candidate(effect(key).of_runs(("first", "second")), of_runs(pulsed))
    known = {f"{key}.size_n": FORCE_N, f"{key}.period_s": PERIOD_S, f"{key}.width_s": WIDTH_S}
    [only] = train.proposed(missing, {**known, f"{key}.start_s in first": 0.37, "frequency of mode 1": 1.0})
    assert only == pytest.approx({**known, f"{key}.start_s in second": 0.81}, abs=0.25 * WIDTH_S)
    assert train.proposed(missing)[0][f"{key}.period_s"] != pytest.approx(PERIOD_S, rel=0.1)
    line = Candidate(effect("structure.harmonic_force").of_runs(("first", "second")), of_runs(pulsed))
    middle = 0.5 * of_runs(pulsed).longest_run_s
    weak, strong = (size * np.sin(2 * np.pi * f * (time - middle)) for size, f in ((1.0, 11.3), (5.0, 4.0)))
    known = {f"{line.key}.size_n": 1.2, f"{line.key}.frequency_hz": 11.3}
    [only] = line.proposed({"second": MissingForce(weak + strong)}, known)
    assert {name: only[name] for name in known} == known
    assert abs((only[f"{line.key}.phase in second"] + 0.5) % 1.0 - 0.5) < 0.03


def test_an_instant_is_refined_where_a_pulse_explains_less_than_none(pulsed: RigModel) -> None:
    train = Candidate(effect("structure.external_force").of_runs(("first", "second")), of_runs(pulsed))
    _, second = (observations(run, pulsed.compared(run)) for run in pulsed.runs)
    start = f"{train.key}.start_s in second"
    numbers = {
        f"{train.key}.{n}": v for n, v in (("size_n", FORCE_N), ("period_s", PERIOD_S), ("width_s", WIDTH_S))
    }
    problem = FreeRunProblem(pulsed, [second], (train,), numbers)
    beside, after_the_run = ({**pulsed.believed, **numbers, start: at} for at in (0.81 + 0.5 * WIDTH_S, 3.99))
    costs = problem.costs([beside, after_the_run])
    assert costs[0] > costs[1]
    found = _refined(problem, [beside, after_the_run], {start: WIDTH_S})
    assert found[start] == pytest.approx(0.81, abs=0.001)


def test_all_runs_show_an_effect_that_has_a_number_in_each_of_them(pulsed: RigModel) -> None:
    line = Candidate(effect("structure.harmonic_force").of_runs(("first", "second")), of_runs(pulsed))
    problem = FreeRunProblem(pulsed, [observations(run, pulsed.compared(run)) for run in pulsed.runs], [line])
    theta = problem.theta_of({**pulsed.believed, f"{line.key}.size_n": 0.4})
    at = problem.residual(theta)
    own = [i for i, name in enumerate(problem.names) if name.startswith(f"{line.key}.phase")]
    moved = theta.copy()
    moved[own] += 0.1
    [found] = problem.residuals_moved([moved], own, at)
    np.testing.assert_array_equal(found, problem.residual(moved))
    [one] = problem.residuals_moved([moved], own[:1], at)
    assert not np.array_equal(one, found)

"""A user's own twin: what it simulates, by closed forms and by scipy; what it finds; what it refuses."""

from __future__ import annotations

from collections.abc import Mapping
from math import tanh
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from progress_lines import without_progress
from recorded_oscillators import fitted_from
from scipy.integrate import solve_ivp

from pipelines.command_line import run as command
from sloshlab.errors import AnalysisError, InputError
from sloshlab.identification.case import CaseRun
from sloshlab.identification.free_run_problem import FreeRunProblem
from sloshlab.identification.observations import observations
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import Candidate, Surroundings, candidates, extension_of, known_effects
from sloshlab.missing_physics.extension import NOTHING, Extension, SensorFault
from sloshlab.recording import run_attributes, write_recording
from sloshlab.twin.rate_independent_forces import HYSTERESIS, STRUCTURAL_DAMPING
from sloshlab.twin.structure_forces import (
    ASYMMETRIC_FRICTION,
    CLEARANCE,
    COULOMB_FRICTION,
    CUBIC_STIFFNESS,
    MASS_ERROR,
    MISSING_MODE,
)
from sloshlab.user_twin import (
    AddedForce,
    Compared,
    FreeTwin,
    MechanicalTwin,
    Mechanism,
    Parameter,
    Reading,
    Response,
    TwinRun,
    UserTwinModel,
    load_extended,
    load_user_twin,
)

assert effects.__all__
RATE_HZ, N = 250.0, 500
MASS_KG, STIFFNESS, DAMPING, FRICTION_N = 2.0, 3000.0, 1.2, 0.6
TIME = np.arange(N) / RATE_HZ


def case_run(name: str = "run", *, repeat: int = 0, **channels: tuple[np.ndarray, str]) -> CaseRun:
    """A run of some channels, each with its quantity."""
    units = {"force": "N", "acceleration": "m s-2", "velocity": "m s-1", "displacement": "m"}
    variables = {
        key: ("time", values, {"units": units[quantity], "quantity": quantity})
        for key, (values, quantity) in channels.items()
    }
    n = len(next(iter(channels.values()))[0])
    attributes = {
        "sloshlab_format": "1",
        "run_id": name,
        "experiment": "other",
        "configuration": "frozen",
        "rig": "own",
        "sampling_rate_hz": RATE_HZ,
        "start_time_utc": "2026-01-01T00:00:00Z",
        "repeat": repeat,
    }
    dataset = xr.Dataset(variables, coords={"time": np.arange(n) / RATE_HZ}, attrs=attributes)
    return CaseRun(name, dataset, run_attributes(dataset))


def pushed_run(displacement: np.ndarray | None = None) -> CaseRun:
    """A run that a band-limited force drives."""
    force = 8 * np.sin(2 * np.pi * 5.2 * TIME) * np.sin(np.pi * TIME / 2) ** 2
    shown = np.zeros(N) if displacement is None else displacement
    return case_run(force_push=(force, "force"), displacement_cart=(shown, "displacement"))


def cart(run: TwinRun, values: Mapping[str, float]) -> Mechanism:
    start = run.attributes.get("released_m", 0.0)
    return Mechanism(
        MASS_KG,
        values["stiffness"],
        DAMPING,
        {"displacement_cart": Reading(1.0)},
        driving_force_n=run.channels["force_push"],
        initial_displacement_m=float(start),  # type: ignore[arg-type]
    )


CART = MechanicalTwin(
    (Parameter("stiffness", STIFFNESS, 30.0, "N m-1"),), ("force_push",), {"displacement_cart": "m"}, cart
)


def by_scipy(rates, start: list[float], n: int = N) -> np.ndarray:  # type: ignore[no-untyped-def]
    return solve_ivp(rates, (0, n / RATE_HZ), start, t_eval=TIME[:n], rtol=1e-9, atol=1e-12, max_step=0.01).y


def push(t: float) -> float:
    return float(8 * np.sin(2 * np.pi * 5.2 * t) * np.sin(np.pi * t / 2) ** 2)


class TestMechanism:
    def test_one_mass_with_an_added_spring_follows_its_equation(self) -> None:
        model = UserTwinModel(CART, [pushed_run()])
        extension = Extension((CUBIC_STIFFNESS(stiffness_n_per_m3=4e5),), key=(("cubic",),))
        found = model.simulate(model.runs[0], {"stiffness": 2900.0}, extension)["displacement_cart"]
        expected = by_scipy(
            lambda t, y: [y[1], (push(t) - DAMPING * y[1] - 2900 * y[0] - 4e5 * y[0] ** 3) / MASS_KG], [0, 0]
        )[0]
        assert np.abs(expected).max() > 0.01
        np.testing.assert_allclose(found, expected, atol=2e-4 * np.abs(expected).max())

    def test_force_and_joint_at_different_coordinates(self) -> None:
        """Driven at the first mass; between the two a spring hardens, and mass is added to that coordinate."""
        m1, m2, k1, k2 = 2.0, 0.7, 3000.0, 1500.0
        mass, stiffness = np.diag([m1, m2]), np.array([[k1 + k2, -k2], [-k2, k2]])
        damping = 4e-4 * stiffness + 0.3 * mass

        def two(run: TwinRun, values: Mapping[str, float]) -> Mechanism:
            return Mechanism(
                mass, stiffness, damping, {"displacement_cart": Reading([0.0, 1.0]),
                                           "acceleration_first": Reading(acceleration=[1.0, 0.0])},
                driving_force_n=run.channels["force_push"], driven_along=[1.0, 0.0], acts_along=[1.0, -1.0],
            )  # fmt: skip

        run = case_run(
            force_push=(np.array([push(t) for t in TIME]), "force"),
            displacement_cart=(np.zeros(N), "displacement"),
            acceleration_first=(np.zeros(N), "acceleration"),
        )
        twin = MechanicalTwin((), ("force_push",), {"displacement_cart": "m", "acceleration_first": "m s-2"}, two)
        model = UserTwinModel(twin, [run])
        extension = Extension((CUBIC_STIFFNESS(stiffness_n_per_m3=8e5), MASS_ERROR(mass_kg=0.2)), key=(("both",),))
        found = model.simulate(run, {}, extension)
        whole = mass + 0.2 * np.array([[1, -1], [-1, 1]])
        inverse = np.linalg.inv(whole)

        def acceleration(t: float, y: np.ndarray) -> np.ndarray:
            joint = -8e5 * (y[0] - y[1]) ** 3
            return inverse @ (np.array([push(t) + joint, -joint]) - stiffness @ y[:2] - damping @ y[2:])

        y = by_scipy(lambda t, y: [*y[2:], *acceleration(t, y)], [0, 0, 0, 0])
        np.testing.assert_allclose(found["displacement_cart"], y[1], atol=1e-3 * np.abs(y[1]).max())
        first = np.array([acceleration(t, state)[0] for t, state in zip(TIME, y.T, strict=True)])
        np.testing.assert_allclose(found["acceleration_first"], first, atol=3e-3 * np.abs(first).max())

    def test_a_command_that_is_not_obeyed_acts_on_what_the_twin_is_fed(self) -> None:
        """Limit 4 N and dead zone 1 N of a push of up to 8 N, integrated by scipy."""
        run = case_run(
            force_push=(np.array([push(t) for t in TIME]), "force"),
            displacement_cart=(np.zeros(N), "displacement"),
        )
        model = UserTwinModel(CART, [run])
        saturation = next(known for known in known_effects() if known.name == "actuator_saturation")
        assert saturation.block in model.blocks
        numbers = {"limit": 4.0, "dead_zone": 1.0}
        extension = saturation.extension(numbers, None, "force_push")  # type: ignore[arg-type]
        found = model.simulate(run, {}, Extension(drives=extension.drives, key=(("saturates", 4.0, 1.0),)))

        def acting(t: float) -> float:
            return float(np.sign(push(t)) * min(max(abs(push(t)) - 1.0, 0.0), 4.0))

        y = by_scipy(lambda t, y: [y[1], (acting(t) - STIFFNESS * y[0] - DAMPING * y[1]) / MASS_KG], [0, 0])
        # corners of what acts, between samples of the command
        np.testing.assert_allclose(found["displacement_cart"], y[0], atol=5e-3 * np.abs(y[0]).max())
        plain = model.simulate(run, {}, NOTHING)["displacement_cart"]
        assert np.abs(plain - y[0]).max() > 0.3 * np.abs(y[0]).max()

    def test_a_moving_base_drives_relative_coordinates(self) -> None:
        def shaken(run: TwinRun, values: Mapping[str, float]) -> Mechanism:
            base = run.channels["acceleration_base"]
            return Mechanism(
                MASS_KG, STIFFNESS, DAMPING, {"acceleration_mass": Reading(acceleration=1.0, plus=base)},
                base_acceleration_m_per_s2=base,
            )  # fmt: skip

        base = np.array([push(t) for t in TIME])
        run = case_run(acceleration_base=(base, "acceleration"), acceleration_mass=(np.zeros(N), "acceleration"))
        model = UserTwinModel(
            MechanicalTwin((), ("acceleration_base",), {"acceleration_mass": "m s-2"}, shaken), [run]
        )
        y = by_scipy(lambda t, y: [y[1], -push(t) - (DAMPING * y[1] + STIFFNESS * y[0]) / MASS_KG], [0, 0])
        absolute = -(DAMPING * y[1] + STIFFNESS * y[0]) / MASS_KG
        found = model.simulate(run, {}, NOTHING)["acceleration_mass"]
        np.testing.assert_allclose(found, absolute, atol=1e-3 * np.abs(absolute).max())

    def test_dry_friction_stops_where_the_closed_form_does(self) -> None:
        """x = (x₀ − (2n+1) F/k) cos ωt + (−1)ⁿ F/k in the n-th half cycle, until |x| ≤ F/k at a turn."""
        run = released(np.zeros(N))
        model = UserTwinModel(RELEASED, [run])
        extension = Extension((COULOMB_FRICTION(force_n=FRICTION_N),), key=(("coulomb",),))
        found = model.simulate(run, {}, extension)["displacement_cart"]
        np.testing.assert_allclose(found, decay(), atol=2e-7)
        assert found[-1] == pytest.approx(found[-20], abs=1e-12)


START_M = 0.0043


def decay(force_n: float = FRICTION_N) -> np.ndarray:
    omega, offset = np.sqrt(STIFFNESS / MASS_KG), force_n / STIFFNESS
    half = np.floor(omega * TIME / np.pi)
    last = np.ceil((START_M / offset - 1) / 2)
    phase = np.where(half < last, omega * TIME, last * np.pi)
    half = np.minimum(half, last - 1)
    return np.asarray((START_M - (2 * half + 1) * offset) * np.cos(phase) + (-1) ** half * offset)


def released(displacement: np.ndarray, name: str = "run", repeat: int = 0) -> CaseRun:
    return case_run(name, repeat=repeat, displacement_cart=(displacement, "displacement"))


def undriven(run: TwinRun, values: Mapping[str, float]) -> Mechanism:
    del run
    return Mechanism(
        MASS_KG, values.get("stiffness", STIFFNESS), 0.0, {"displacement_cart": Reading(1.0)},
        initial_displacement_m=START_M,
    )  # fmt: skip


STIFF = Parameter("stiffness", STIFFNESS, 30.0, "N m-1")
RELEASED = MechanicalTwin((STIFF,), (), {"displacement_cart": Compared("m")}, undriven)


def own_simulation(run: TwinRun, values: Mapping[str, float], added: AddedForce) -> Response:
    """Runge–Kutta of order 4 in plain Python, four steps per sample, with the force that is added."""
    step, mass = 0.25 / run.sampling_rate_hz, MASS_KG + added.mass_kg
    state = np.concatenate([[START_M, 0.0], added.start(START_M)])

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        force, memory = added.with_rates(t, y[0], y[1], y[2:])
        return np.concatenate([[y[1], (force - values["stiffness"] * y[0]) / mass], memory])

    motion = np.empty((run.n_samples, 3))
    for i in range(run.n_samples):
        motion[i] = state[0], state[1], rates(i * 4 * step, state)[1]
        for j in range(4):
            t = (4 * i + j) * step
            k1 = rates(t, state)
            k2 = rates(t + step / 2, state + step / 2 * k1)
            k3 = rates(t + step / 2, state + step / 2 * k2)
            k4 = rates(t + step, state + step * k3)
            state = state + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return Response({"displacement_cart": motion[:, 0]}, motion)


ITSELF = FreeTwin((STIFF,), (), {"displacement_cart": "m"}, own_simulation, MASS_KG, STIFFNESS, 2e-3)


class TestAddedForce:
    def test_forces_of_closed_forms(self) -> None:
        at = (0.0, 0.02, 0.5)
        assert AddedForce([COULOMB_FRICTION(force_n=3.0)], 1e-4)(*at) == pytest.approx(-3.0)
        assert AddedForce([COULOMB_FRICTION(force_n=3.0)], 1e-4)(0.0, 0.02, -0.5) == pytest.approx(3.0)
        lopsided = AddedForce([ASYMMETRIC_FRICTION(force_up_n=1.0, force_down_n=2.0)], 1e-4)
        assert (lopsided(*at), lopsided(0.0, 0.0, -0.5)) == pytest.approx((-1.0, 2.0))
        gap = AddedForce([CLEARANCE(gap_m=0.015, stiffness_n_per_m=100.0)], 1e-4)
        assert gap(*at) == pytest.approx(-100 * 0.005)
        assert gap(0.0, 0.01, 0.0) == 0.0
        assert gap(0.0, -0.016, 0.0) == pytest.approx(100 * 0.001)
        lossy = AddedForce([STRUCTURAL_DAMPING(loss_factor=0.1, stiffness_n_per_m=50.0)], 1e-4)
        assert lossy(*at) == pytest.approx(-0.5 * np.pi * 0.1 * 50 * 0.02)

    def test_friction_turns_smoothly(self) -> None:
        added = AddedForce([COULOMB_FRICTION(force_n=3.0)], 0.01)
        assert added(0.0, 0.0, 0.004) == pytest.approx(-3 * tanh(0.4))
        assert added(0.0, 0.0, 0.0) == 0.0

    def test_memory_is_integrated_by_the_twin(self) -> None:
        added = AddedForce(
            [
                COULOMB_FRICTION(force_n=1.0),
                MISSING_MODE(frequency_hz=2.0, damping_ratio=0.1, participation=0.3),
                HYSTERESIS(stiffness_n_per_m=50.0, beta_gamma=3.0, beta_delta=2.0),
            ],
            1e-4,
        )
        assert added.n_states == 3
        np.testing.assert_array_equal(added.start(0.2, 0.4), [0.2, 0.4, 0.0])
        states = np.array([0.25, 0.1, 0.7])
        force, rates = added.with_rates(0.0, 0.2, 0.4, states)
        omega = 2 * np.pi * 2.0
        pull = 0.3 * (omega**2 * 0.05 + 2 * 0.1 * omega * (0.1 - 0.4))
        assert force == pytest.approx(-1.0 + pull - 0.7)
        np.testing.assert_allclose(rates, [0.1, -pull / 0.3, 50 * 0.4 - 3 * 0.4 * 0.7 - 2 * 0.4 * 0.7])
        with pytest.raises(AnalysisError, match="memory"):
            added(0.0, 0.2, 0.4)


def surroundings(model: UserTwinModel) -> Surroundings:
    motion = np.abs(model.motion(model.runs[0], {})).max(axis=0)
    return Surroundings(
        None,  # type: ignore[arg-type]
        model.twin,
        *motion.tolist(),
        frequency_hz=6.2,
        force_n=MASS_KG * float(motion[2]),
        channels={"displacement_cart": 1e-3},
        driving=(),
        sampling_rate_hz=RATE_HZ,
        longest_run_s=2.0,
        blocks=model.blocks,
    )


@pytest.mark.parametrize(
    "twin",
    [pytest.param(RELEASED, id="engine"), pytest.param(ITSELF, id="simulates by itself", marks=pytest.mark.slow)],
)
def test_friction_of_a_closed_form_is_found(twin: MechanicalTwin | FreeTwin) -> None:
    """The decay is the closed form with noise; the stiffness is believed 0.6 % too large."""
    noise = np.random.default_rng(5).normal(0, 1e-5, N)
    n = 260
    run = released((decay() + noise)[:n])
    wrong = [Parameter("stiffness", 1.006 * STIFFNESS, 30.0, "N m-1")]
    described = type(twin)(
        **{**vars(twin), "parameters": wrong, "compared": {"displacement_cart": Compared("m", 0.0)}}
    )
    model = UserTwinModel(described, [run])
    [effect] = [
        effect for effect in known_effects() if (effect.name, effect.block) == ("coulomb_friction", "structure")
    ]
    candidate = Candidate(effect, surroundings(model))
    problem = FreeRunProblem(model, [observations(run, model.compared(run))], (candidate,))
    fit = fitted_from(problem, [{**model.believed, **start} for start in candidate.starts()[1:]], n_iterations=4)
    name = "structure.coulomb_friction.force_n"
    width = max(4 * fit.standard_error(name), 0.01 * FRICTION_N)
    assert fit.values[name] == pytest.approx(FRICTION_N, abs=width)
    assert fit.values["stiffness"] == pytest.approx(STIFFNESS, rel=1e-3)


class TestModel:
    def test_gain_offset_and_faults_of_a_channel(self) -> None:
        twin = MechanicalTwin((STIFF,), (), {"displacement_cart": Compared("m", 0.02, 1e-4)}, undriven)
        model = UserTwinModel(twin, [released(np.zeros(N), "one"), released(np.zeros(N), "two")])
        assert [(parameter.name, parameter.tolerance) for parameter in model.parameters] == [
            ("stiffness", 30.0),
            ("gain of displacement_cart", 0.02),
            ("offset of displacement_cart in one", 1e-4),
            ("offset of displacement_cart in two", 1e-4),
        ]
        plain = model.simulate(model.runs[1], {}, NOTHING)["displacement_cart"]
        values = {"gain of displacement_cart": 1.1, "offset of displacement_cart in two": 3e-4}
        np.testing.assert_allclose(
            model.simulate(model.runs[1], values, NOTHING)["displacement_cart"], 1.1 * plain + 3e-4
        )
        fault = SensorFault("displacement_cart", lambda v, rate, others, seen: v**2, None, ("square",))
        squared = model.simulate(model.runs[1], {}, Extension(faults=(fault,), key=(("square",),)))
        np.testing.assert_allclose(squared["displacement_cart"], plain**2)

    def test_a_fault_of_a_driving_channel_is_undone(self) -> None:
        model = UserTwinModel(CART, [pushed_run()])
        plain = model.simulate(model.runs[0], {}, NOTHING)["displacement_cart"]
        fault = SensorFault(
            "force_push", lambda v, *rest: 2 * v, lambda v, *rest: v / 2, ("sensor.sensor_gain.force_push", 1.0)
        )
        halved = model.simulate(model.runs[0], {}, Extension(faults=(fault,), key=(fault.key,)))
        np.testing.assert_allclose(halved["displacement_cart"], plain / 2, atol=1e-12)

    def test_parameters_of_single_runs(self) -> None:
        def cart_of(run: TwinRun, values: Mapping[str, float]) -> Mechanism:
            del run
            return Mechanism(1.0, 100.0, 0.0, {"displacement_cart": Reading(1.0)},
                             initial_displacement_m=values["release"])  # fmt: skip

        twin = MechanicalTwin(
            (Parameter("release", 0.01, 0.001, "m", each_run=True),), (), {"displacement_cart": "m"}, cart_of
        )
        model = UserTwinModel(twin, [released(np.zeros(N), "one"), released(np.zeros(N), "two")])
        values = {"release in two": 0.02}
        starts = [model.simulate(run, values, NOTHING)["displacement_cart"][0] for run in model.runs]
        assert starts == pytest.approx([0.01, 0.02])

    def test_only_blocks_that_it_has_are_offered(self) -> None:
        model = UserTwinModel(RELEASED, [released(np.zeros(N))])
        offered = {candidate.effect.block for candidate in candidates(surroundings(model))}
        assert offered == {"structure", "sensor"}
        assert model.moving_mass_kg == pytest.approx(MASS_KG)

    def test_it_is_saved_and_loaded(self, tmp_path: Path) -> None:
        model = UserTwinModel(RELEASED, [released(np.zeros(N))])
        pool = {candidate.key: candidate for candidate in candidates(surroundings(model))}
        keys = ("structure.coulomb_friction", "sensor.sensor_gain.displacement_cart")
        chosen = [pool[key] for key in keys]
        numbers = {f"{keys[0]}.force_n": 0.25, f"{keys[1]}.ratio": 0.1}
        extension = extension_of(chosen, numbers)
        assert extension.faults
        model.save_extended({"stiffness": 2990.0, **numbers}, chosen, tmp_path / "extended.toml")
        values, loaded = load_extended(tmp_path / "extended.toml")
        expected = model.simulate(model.runs[0], {"stiffness": 2990.0}, extension)["displacement_cart"]
        found = model.simulate(model.runs[0], values, loaded)["displacement_cart"]
        np.testing.assert_array_equal(found, expected)
        (tmp_path / "extended.toml").write_text("sloshlab_user_twin = 1\nparameters = 3\n")
        with pytest.raises(InputError, match="no twin"):
            load_extended(tmp_path / "extended.toml")


GOOD = """
from sloshlab.user_twin import *
def cart(run, values):
    force = run.channels["force_push"]
    return Mechanism(2.0, values["k"], 1.0, {"displacement_cart": Reading(1.0)}, driving_force_n=force)
TWIN = MechanicalTwin([Parameter("k", 3000.0, 30.0, "N m-1")], ["force_push"], {"displacement_cart": "m"}, cart)
"""

BAD = {
    "no such file": (None, "no such Python file"),
    "syntax": ("def cart(:", "SyntaxError"),
    "raises": ("x = 1\nraise RuntimeError('no\\nsensor')", "RuntimeError in line 2: no sensor"),
    "exits": ("import sys; sys.exit(3)", "SystemExit"),
    "no twin": ("x = 1", "no TWIN"),
    "another thing": ("TWIN = 3", "MechanicalTwin or FreeTwin"),
    "no function": (GOOD.replace(", cart)", ", None)"), "allowed: a function"),
    "wrong units of a parameter": (GOOD.replace('"N m-1"', '"N per inch of"'), "allowed: UDUNITS text"),
    "a tolerance of zero": (GOOD.replace("30.0", "0.0"), "tolerance: got 0"),
    "wrong units of a channel": (GOOD.replace('"displacement_cart": "m"', '"displacement_cart": "N"'),
                                 "a recording in m, a twin in N"),
    "unknown units of a channel": (GOOD.replace('"displacement_cart": "m"', '"displacement_cart": "mm"'), "'mm'"),
    "absent channel": (GOOD.replace('["force_push"]', '["force_shaker"]'), "no driving channel force_shaker"),
    "compared nowhere": (GOOD.replace("_cart", "_mass"), "none of the compared channels"),
    "drives and is compared": (GOOD.replace('["force_push"]', '["displacement_cart"]'), "driving and compared"),
    "cannot run": (GOOD.replace('["k"]', '["spring"]'), "cannot run as believed: run_0: got KeyError in line 5"),
    "no spring": (GOOD.replace('values["k"]', "0.0"), "a motion without a spring"),
    "wrong shape": (GOOD.replace('["force_push"]\n', '["force_push"][:-3]\n'), "driving_force_n: got shape (497"),
    "no reading": (GOOD.replace('{"displacement_cart": Reading(1.0)}', "{}"), "none for displacement_cart"),
    "a reading of another size": (GOOD.replace("Reading(1.0)", "Reading([1.0, 2.0])"), "shape (2,)"),
    "another result": (GOOD.replace("return Mechanism", "return list"), "TypeError"),
}  # fmt: skip


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("own") / "case"
    (folder / "recordings").mkdir(parents=True)
    write_recording(pushed_run().recording, folder / "recordings" / "run_0.nc")
    return folder


class TestBadInput:
    @pytest.mark.parametrize("name", BAD)
    def test_one_line_says_what_is_wrong(
        self, name: str, case: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        source, expected = BAD[name]
        file = tmp_path / "twin.py"
        if source is not None:
            file.write_text(source)
        assert command(["diagnose", str(case), "--twin", str(file), "-o", str(tmp_path / "out")]) == 1
        message = without_progress(capsys.readouterr().err)
        assert expected in message
        assert message.count("\n") == 1
        assert "Traceback" not in message
        assert not (tmp_path / "out").exists()

    def test_a_module_in_the_case_folder_is_not_run(
        self, case: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        trap = case / "twin.py"
        trap.write_text(f"open({str(tmp_path / 'ran')!r}, 'w')")
        try:
            assert command(["diagnose", str(case), "-o", str(tmp_path / "out")]) == 1
        finally:
            trap.unlink()
        assert "no rig.toml" in capsys.readouterr().err
        assert not (tmp_path / "ran").exists()

    @pytest.mark.parametrize(
        ("response", "expected"),
        [
            (lambda n: 3, "got int; allowed: Response"),
            (lambda n: Response({}, np.zeros((n, 3))), "reading displacement_cart: got nothing"),
            (lambda n: Response({"displacement_cart": np.zeros(n - 1)}, np.zeros((n, 3))), r"shape \(499,\)"),
            (lambda n: Response({"displacement_cart": np.zeros(n)}, np.zeros(n)), r"motion: got shape \(500,\)"),
            (lambda n: Response({"displacement_cart": np.full(n, np.nan)}, np.zeros((n, 3))), "NaN or infinity"),
            (lambda n: Response({"displacement_cart": ["a"] * n}, np.zeros((n, 3))), "no numbers"),
        ],
    )
    def test_what_a_twin_that_simulates_by_itself_gives_back(self, response, expected: str) -> None:  # type: ignore[no-untyped-def]
        twin = FreeTwin((), (), {"displacement_cart": "m"}, lambda run, values, added: response(run.n_samples))
        with pytest.raises(InputError, match=expected):
            UserTwinModel(twin, [released(np.zeros(N))])

    def test_a_good_module_is_loaded(self, case: Path, tmp_path: Path) -> None:
        del case
        (tmp_path / "twin.py").write_text(GOOD)
        twin = load_user_twin(tmp_path / "twin.py")
        assert isinstance(twin, MechanicalTwin)
        assert [parameter.name for parameter in twin.parameters] == ["k"]

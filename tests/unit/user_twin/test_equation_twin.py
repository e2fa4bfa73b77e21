"""Twins that are equations: against scipy, the closed form of dry friction, and what is refused in one line."""

from __future__ import annotations

from math import exp, log

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from test_user_twin import CART, RATE_HZ, TIME, N, case_run, push

from sloshlab.errors import AnalysisError, InputError, SloshlabError
from sloshlab.identification.case import CaseRun
from sloshlab.missing_physics.extension import NOTHING, Extension
from sloshlab.twin.rate_independent_forces import HYSTERESIS
from sloshlab.twin.structure_forces import (
    CLEARANCE,
    COULOMB_FRICTION,
    CUBIC_STIFFNESS,
    MASS_ERROR,
    QUADRATIC_DRAG,
    STIFFNESS_CHANGE,
)
from sloshlab.user_twin import Compared, EquationTwin, Parameter, State, UserTwinModel

MASS_KG, STIFFNESS, DAMPING = 2.0, 3000.0, 1.2


def cart(state, inputs, parameters, force):  # type: ignore[no-untyped-def]
    x, v = state
    acceleration = (inputs.force_push + force - DAMPING * v - parameters.stiffness * x) / MASS_KG
    return (v, acceleration), (x,)


def twin_of_cart(**changes: object) -> EquationTwin:
    described: dict[str, object] = {
        "equations": cart,
        "states": {"x": 0.0, "v": 0.0},
        "parameters": [Parameter("stiffness", STIFFNESS, 30.0, "N m-1")],
        "driving": ["force_push"],
        "compared": {"displacement_cart": "m"},
    }
    return EquationTwin(**{**described, **changes})  # type: ignore[arg-type]


def pushed(displacement: np.ndarray | None = None) -> CaseRun:
    shown = np.zeros(N) if displacement is None else displacement
    return case_run(
        force_push=(np.array([push(t) for t in TIME]), "force"), displacement_cart=(shown, "displacement")
    )


def by_scipy(rates, start: list[float]) -> np.ndarray:  # type: ignore[no-untyped-def]
    return solve_ivp(rates, (0, N / RATE_HZ), start, t_eval=TIME, rtol=1e-9, atol=1e-12, max_step=0.005).y


@pytest.mark.parametrize(
    ("terms", "force", "mass"),
    [
        ((), lambda x, v: 0.0, 0.0),
        ((CUBIC_STIFFNESS(stiffness_n_per_m3=4e5),), lambda x, v: -4e5 * x**3, 0.0),
        ((MASS_ERROR(mass_kg=0.3), QUADRATIC_DRAG(drag_n_s2_per_m2=9.0)), lambda x, v: -9.0 * v * abs(v), 0.3),
    ],
)
def test_added_forces_enter_the_equation_of_motion(terms, force, mass: float) -> None:  # type: ignore[no-untyped-def]
    model = UserTwinModel(twin_of_cart(), [pushed()])
    found = model.simulate(model.runs[0], {"stiffness": 2900.0}, Extension(terms))["displacement_cart"]
    y = by_scipy(
        lambda t, y: [y[1], (push(t) - DAMPING * y[1] - 2900 * y[0] + force(*y)) / (MASS_KG + mass)], [0, 0]
    )
    assert np.abs(y[0]).max() > 0.01
    # the push between its samples
    np.testing.assert_allclose(found, y[0], atol=2e-4 * np.abs(y[0]).max())


def test_dry_friction_stops_where_the_closed_form_does() -> None:
    """x = (x₀ − (2n+1) F/k) cos ωt + (−1)ⁿ F/k in the n-th half cycle, until |x| ≤ F/k at a turn."""

    def free(state, inputs, parameters, force):  # type: ignore[no-untyped-def]
        return (state.v, (force - STIFFNESS * state.x) / MASS_KG), (state.x,)

    start, friction = 0.002, 0.6
    twin = twin_of_cart(equations=free, states={"x": "displacement_cart", "v": State()}, parameters=[], driving=[])
    model = UserTwinModel(twin, [case_run(displacement_cart=(np.full(N, start), "displacement"))])
    found = model.simulate(model.runs[0], {}, Extension((COULOMB_FRICTION(force_n=friction),)))[
        "displacement_cart"
    ]
    omega, centre = np.sqrt(STIFFNESS / MASS_KG), friction / STIFFNESS
    half = np.floor(TIME * omega / np.pi)
    last = np.ceil((start / centre - 1) / 2)
    n = np.minimum(half, last)
    moving = (start - (2 * n + 1) * centre) * np.cos(omega * TIME) + (-1) ** n * centre
    rest = (-1) ** last * (start - 2 * last * centre)
    np.testing.assert_allclose(found, np.where(half < last, moving, rest), atol=2e-7)


def test_memory_and_contacts_are_those_of_the_engine() -> None:
    """The same equations as a mechanism: one engine, two descriptions of the structure."""
    terms = (
        CLEARANCE(gap_m=0.004, stiffness_n_per_m=5e3),
        HYSTERESIS(stiffness_n_per_m=500.0, beta_gamma=300.0, beta_delta=200.0),
    )
    run = pushed()
    of_equations = UserTwinModel(twin_of_cart(), [run]).simulate(run, {}, Extension(terms))
    of_mechanism = UserTwinModel(CART, [run]).simulate(run, {}, Extension(terms))
    largest = np.abs(of_mechanism["displacement_cart"]).max()
    assert largest > 0.004
    # both choose their steps by themselves, equations so that half of them changes 1e-4 at most
    np.testing.assert_allclose(
        of_equations["displacement_cart"], of_mechanism["displacement_cart"], atol=1e-4 * largest
    )


def tank_level(state, inputs, parameters, force):  # type: ignore[no-untyped-def]
    return ((inputs.inflow - parameters.outlet * state.level + force) / 2.0,), (state.level,)


def test_a_state_of_the_first_order_needs_neither_mass_nor_spring() -> None:
    """(q + f − r h)/A with constant inflow and f = −s h: h = q/(r+s) (1 − e^(−(r+s) t/A))."""
    run = case_run(inflow=(np.ones(N), "force"), displacement_level=(np.zeros(N), "displacement"))
    twin = EquationTwin(
        tank_level,
        {"level": 0.0},
        [Parameter("outlet", 3.0, 0.3, "N m-1")],
        ["inflow"],
        {"displacement_level": "m"},
    )
    model = UserTwinModel(twin, [run])
    found = model.simulate(run, {"outlet": 2.5}, Extension((STIFFNESS_CHANGE(stiffness_n_per_m=0.5),)))
    expected = 1 / 3.0 * (1 - np.exp(-3.0 * TIME / 2.0))
    np.testing.assert_allclose(found["displacement_level"], expected, atol=1e-9)
    with pytest.raises(InputError, match="state of the first order"):
        model.simulate(run, {}, Extension((MASS_ERROR(mass_kg=0.5),)))


def test_starts_of_runs_are_parameters_of_theirs() -> None:
    run = pushed(0.003 + 0.1 * TIME)
    states = {
        "x": State("displacement_cart", tolerance=1e-3, units="m"),
        "v": State("displacement_cart", slope=True, tolerance=0.02, units="m s-1"),
    }
    model = UserTwinModel(twin_of_cart(states=states), [run])
    assert model.believed["start of x in run"] == pytest.approx(0.003)
    assert model.believed["start of v in run"] == pytest.approx(0.1)
    found = model.simulate(run, {"start of x in run": 0.004}, NOTHING)["displacement_cart"]
    assert found[0] == pytest.approx(0.004)
    later = 0.004 + 0.1 / RATE_HZ - 0.5 * STIFFNESS * 0.004 / MASS_KG / RATE_HZ**2
    assert found[1] == pytest.approx(later, abs=2e-6)


def test_numbers_of_a_run_of_its_own_reach_the_equations() -> None:
    def offset(state, inputs, parameters, force):  # type: ignore[no-untyped-def]
        return (-state.x + force,), (state.x + parameters.zero,)

    twin = EquationTwin(
        offset, {"x": 1.0}, [Parameter("zero", 0.0, 0.1, "m", each_run=True)], [], {"displacement_cart": "m"}
    )
    run = case_run(displacement_cart=(np.zeros(N), "displacement"))
    model = UserTwinModel(twin, [run])
    found = model.simulate(run, {"zero in run": 0.5}, NOTHING)["displacement_cart"]
    np.testing.assert_allclose(found, 0.5 + np.exp(-TIME), atol=1e-6)


def uncompilable(state, inputs, parameters, force):  # type: ignore[no-untyped-def]
    return (open("x"), 0.0), (state.x,)


def too_few(state, inputs, parameters, force):  # type: ignore[no-untyped-def]
    return (state.v + force,), (state.x,)


def no_force(state, inputs, parameters, force):  # type: ignore[no-untyped-def]
    return (state.v, -state.x), (state.x,)


def explodes(state, inputs, parameters, force):  # type: ignore[no-untyped-def]
    return (state.v, force + 1e4 * (0.001 + state.x)), (state.x,)


def reads_nothing(state, inputs, parameters, force):  # type: ignore[no-untyped-def]
    return (state.v, force - state.x), (log(-1.0 - exp(state.x)),)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"equations": uncompilable, "parameters": []}, "cannot be compiled"),
        ({"equations": too_few}, "1 rates and 1 readings; allowed: 2 rates"),
        ({"equations": explodes, "parameters": []}, "run: .*state "),
        ({"equations": reads_nothing, "parameters": []}, "run: reading displacement_cart: got NaN"),
        ({"parameters": [Parameter("spring rate", 1.0, 1.0)]}, "parameter: got 'spring rate'"),
        ({"parameters": [Parameter("stiffness", 1.0, 1.0)] * 2}, "parameters: got stiffness, stiffness"),
        ({"driving": ["force_push", "force_push"]}, "inputs: got time_s, force_push, force_push"),
        ({"equations": 3}, "equations: got int"),
    ],
)
def test_what_cannot_run_is_refused_in_one_line(changes: dict[str, object], words: str) -> None:
    with pytest.raises(SloshlabError, match=words) as refused:
        UserTwinModel(twin_of_cart(**changes), [pushed()])
    assert "\n" not in str(refused.value)


def test_equations_without_the_added_force_are_refused() -> None:
    model = UserTwinModel(twin_of_cart(equations=no_force), [pushed()])
    with pytest.raises(InputError, match="no change of a rate by the added force"):
        _ = model.moving_mass_kg


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"moves": ("y",)}, "moves"),
        ({"states": {}}, "states"),
        ({"states": {"x": "displacement_of_another", "v": 0.0}}, "compared channel"),
        ({"states": {"x": State("displacement_cart"), "v": float("nan")}}, "finite"),
    ],
)
def test_a_description_that_cannot_be_is_refused(changes: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        twin_of_cart(**changes)


def test_compared_keeps_its_tolerances() -> None:
    shown = {"displacement_cart": Compared("m", gain_tolerance=0.0, offset_tolerance=1e-4)}
    model = UserTwinModel(twin_of_cart(compared=shown), [pushed()])
    assert "offset of displacement_cart in run" in model.believed


def test_a_simulation_that_ends_early_says_when() -> None:
    model = UserTwinModel(twin_of_cart(), [pushed()])
    with pytest.raises(AnalysisError, match="s"):
        model.simulate(model.runs[0], {"stiffness": -3e6}, NOTHING)


def isolator(state, inputs, parameters, force):  # type: ignore[no-untyped-def]
    return (), (parameters.damping * inputs.velocity + 0.5 * inputs.acceleration - force,)


def test_a_prescribed_motion_needs_no_states() -> None:
    """c v + m a + k₃ x³ + F sgn v along x = A sin ωt, in closed form."""
    size, omega = 0.01, 2 * np.pi * 3.0
    x, v, a = (size * omega**k * part for k, part in enumerate((np.sin(omega * TIME), np.cos(omega * TIME),
                                                                 -np.sin(omega * TIME))))  # fmt: skip
    twin = EquationTwin(
        isolator, {}, [Parameter("damping", 50.0, 10.0, "N s m-1")], ["displacement_table"], {"force_damper": "N"},
        moves=["displacement_table"],
    )  # fmt: skip
    run = case_run(displacement_table=(x, "displacement"), force_damper=(50.0 * v, "force"))
    model = UserTwinModel(twin, [run])
    terms = (CUBIC_STIFFNESS(stiffness_n_per_m3=1e7), COULOMB_FRICTION(force_n=2.0))
    found = model.simulate(run, {"damping": 40.0}, Extension(terms))["force_damper"]
    expected = 40.0 * v + 0.5 * a + 1e7 * x**3 + 2.0 * np.sign(v)
    inner = slice(10, -10)
    away = np.abs(v[inner]) > 0.03 * size * omega
    np.testing.assert_allclose(found[inner][away], expected[inner][away], atol=2e-3 * np.abs(expected).max())
    assert model.moving_mass_kg == pytest.approx(50.0 * v.std() / a.std(), rel=0.02)


def test_a_loop_that_yields_at_once_is_followed_along_a_prescribed_motion() -> None:
    """Bouc–Wen with ν = 1, βγ = βδ: straight after a turn up to z = 0, then z_y (1 − e^(−Δx/x_y)).

    It yields at 1/200 of the amplitude: in steps of 2 ms, by eight of its yield displacements each, it explodes.
    """
    size, omega, limit, yielding = 0.01, 2 * np.pi * 3.0, 3.0, 5e-5
    x, v, a = (size * omega**k * part for k, part in enumerate((np.sin(omega * TIME), np.cos(omega * TIME),
                                                                 -np.sin(omega * TIME))))  # fmt: skip
    twin = EquationTwin(
        isolator, {}, [Parameter("damping", 50.0, 10.0, "N s m-1")], ["displacement_table"], {"force_damper": "N"},
        moves=["displacement_table"],
    )  # fmt: skip
    run = case_run(displacement_table=(x, "displacement"), force_damper=(50.0 * v, "force"))
    half = 0.5 / yielding
    loop = HYSTERESIS(stiffness_n_per_m=limit / yielding, beta_gamma=half, beta_delta=half)
    found = UserTwinModel(twin, [run]).simulate(run, {"damping": 40.0}, Extension((loop,)))["force_damper"]
    way = np.where(v > 0, x + size, size - x) / yielding
    z = limit * np.where(way < 1.0, way - 1.0, -np.expm1(np.minimum(1.0 - way, 0.0)))
    expected = 40.0 * v + 0.5 * a + np.sign(v) * z
    # from the first turn on, where the motion is not at its turn: there its smoothing spline errs
    kept = (np.arange(N) > RATE_HZ / 3.0) & (np.arange(N) < N - 10) & (way > 0.5)
    np.testing.assert_allclose(found[kept], expected[kept], atol=0.02 * limit)


def test_a_prescribed_motion_beside_states_is_refused() -> None:
    with pytest.raises(InputError, match="some beside a prescribed motion"):
        twin_of_cart(moves=("force_push",))

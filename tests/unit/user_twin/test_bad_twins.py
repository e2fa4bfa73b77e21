"""Twins of a user's own that cannot be: one line with run, sample, parameter or channel, and nothing written."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from numba import njit
from progress_lines import without_progress
from slow_cases import slow_but

from pipelines.command_line import run as command
from sloshlab.errors import InputError
from sloshlab.recording import write_recording
from sloshlab.user_twin.raised_errors import require_no_raise
from tests.unit.user_twin.test_user_twin import pushed_run

HEAD = "import math\nfrom math import *\nimport numpy as np\nfrom sloshlab.user_twin import *\n"


def free(*lines: str, more: str = "") -> str:
    """A twin that simulates by itself, so; `more` of its fields."""
    body = "\n    ".join(lines)
    return (
        f"{HEAD}def simulate(run, values, added):\n    n = run.n_samples\n    {body}\n"
        'TWIN = FreeTwin([Parameter("k", 3000.0, 60.0, "N m-1")], ["force_push"], {"displacement_cart": "m"}, '
        f"simulate{more})\n"
    )


def equations(*lines: str, parameters: str = '[Parameter("k", 3000.0, 60.0, "N m-1")]', start: str = "0.0") -> str:
    """A twin of equations, so."""
    body = "\n    ".join(lines)
    return (
        f"{HEAD}def equations(state, inputs, parameters, force):\n    x, v = state\n    {body}\n"
        f'TWIN = EquationTwin(equations, {{"x": {start}, "v": 0.0}}, {parameters}, ["force_push"], '
        '{"displacement_cart": "m"})\n'
    )


def mechanism(mass: str = "2.0", damping: str = "1.0", force: str = 'run.channels["force_push"]') -> str:
    """A twin of masses and springs, so."""
    return (
        f"{HEAD}def cart(run, values):\n"
        f'    return Mechanism({mass}, values["k"], {damping}, {{"displacement_cart": Reading(1.0)}}, '
        f"driving_force_n={force}, initial_displacement_m=run.start('displacement_cart')[0])\n"
        'TWIN = MechanicalTwin([Parameter("k", 3000.0, 60.0, "N m-1")], ["force_push"], '
        '{"displacement_cart": "m"}, cart)\n'
    )


CALM = "return Response({'displacement_cart': np.zeros(n)}, np.zeros((n, 3)))"
GOOD = "return (v, (inputs.force_push + force - parameters.k * x - v) / 2.0), (x,)"
BAD = {
    "raises": (free("raise RuntimeError('no')"), "cannot run as believed: run_0: got RuntimeError in line 7: no"),
    "raises in one run": (
        free("if run.name == 'run_1': return 1 / 0", CALM),
        "run_1: got ZeroDivisionError in line 7",
    ),
    "ends the process": (free("raise SystemExit(3)"), "run_0: got SystemExit in line 7: 3"),
    "calls itself for ever": (free("f = lambda f: f(f)", "f(f)"), "run_0: got RecursionError in line 7"),
    "imports what is not there": ("import nowhere_at_all\n", "got ModuleNotFoundError in line 1: No module named"),
    "imports it later": (free("import nowhere_at_all"), "run_0: got ModuleNotFoundError in line 7"),
    "writes into its inputs": (free("run.channels['force_push'][0] = 1.0"), "run_0: got ValueError in line 7"),
    "not a number from a sample on": (
        free("x = np.where(np.arange(n) < 100, 0.0, np.nan)", CALM.replace("np.zeros(n)", "x", 1)),
        "run_0: reading displacement_cart: got NaN or infinity, first at sample 100 (0.4 s)",
    ),
    "a motion that is infinite": (
        free("m = np.zeros((n, 3))", "m[50, 1] = np.inf", CALM.replace("np.zeros((n, 3))", "m")),
        "run_0: motion: got NaN or infinity, first at sample 50 (0.2 s)",
    ),
    "a sample too few": (
        free(CALM.replace("np.zeros(n)", "np.zeros(n - 1)")),
        "run_0: reading displacement_cart: got shape (499,); allowed: (500,)",
    ),
    "a dimension too many": (
        free(CALM.replace("np.zeros(n)", "np.zeros((n, 2))")),
        "run_0: reading displacement_cart: got shape (500, 2); allowed: (500,)",
    ),
    "complex": (
        free(CALM.replace("np.zeros(n)", "1j * np.zeros(n)")),
        "run_0: reading displacement_cart: got complex numbers",
    ),
    "no readings": (free("return Response(None, np.zeros((n, 3)))"), "run_0: readings: got NoneType"),
    "nothing": (free("return None"), "run_0: simulate: got NoneType; allowed: Response"),
    "a mass that is none": (free(CALM, more=", moving_mass_kg=math.nan"), "twin: moving_mass_kg: got nan"),
    "a mass in words": (free(CALM, more=", moving_mass_kg='2 kg'"), "twin: moving_mass_kg: got '2 kg'"),
    "a spring that pushes": (free(CALM, more=", stiffness_n_per_m=-1.0"), "twin: stiffness_n_per_m: got -1.0"),
    "a speed that is none": (free(CALM, more=", friction_speed_m_per_s=0.0"), "friction_speed_m_per_s: got 0.0"),
    "equations that raise": (
        equations("if inputs.time_s > 0.5:", "    raise ValueError('late')", GOOD),
        "equations: got an error that is raised in line 8; allowed: numbers",
    ),
    "equations that assert": (equations("assert x < 1.0", GOOD), "got an error that is raised in line 7"),
    "a rate that is no number": (
        equations("return (v, force + log(-1.0 - x * x)), (x,)"),
        "run_0: twin: the motion grew beyond every bound or is no longer a number: state x at t = 0.004 s",
    ),
    "a rate that is infinite": (
        equations("return (v, (1.0 + force) / (x - x)), (x,)"),
        "no longer a number: state x",
    ),
    "a state that explodes": (
        equations("return (v, force + 1e6 * (1.0 + x**4)), (x,)"),
        "grew beyond every bound or is no longer a number: state ",
    ),
    "a reading that is no number": (
        equations("return (v, force - x), (sqrt(0.002 - inputs.time_s),)"),
        "run_0: reading displacement_cart: got NaN or infinity, first at sample 1 (0.004 s)",
    ),
    "a reading too many": (
        equations("return (v, force), (x, v)"),
        "run_0: equations: got 2 rates and 2 readings; allowed: 2 rates, of x, v, and 1 readings",
    ),
    "no tuple": (equations("return x"), "twin.py: equations: got what cannot be compiled"),
    "a parameter that there is not": (
        equations(GOOD.replace("parameters.k", "parameters.c")),
        "Unknown attribute 'c' of type Parameters",
    ),
    "a start that no channel tells": (
        equations(GOOD, start="'displacement_card'"),
        "in line 8: twin: states: got 'dis",
    ),
    "a parameter without bounds": (
        equations(GOOD, parameters='[Parameter("k", 3000.0, inf, "N m-1")]'),
        "twin.py in line 8: parameter k: tolerance: got inf; allowed: a finite number",
    ),
    "a parameter without tolerance": (
        equations(GOOD, parameters='[Parameter("k", 3000.0)]'),
        "got TypeError in line 8: Parameter.__init__() missing 1 required positional argument: 'tolerance'",
    ),
    "a parameter that is none": (equations(GOOD, parameters='[("k", 3000.0, 60.0)]'), "parameters: got tuple"),
    "parameters that are none": (equations(GOOD, parameters="3"), "twin: parameters: got int; allowed: a list"),
    "a drive that is a text": (
        equations(GOOD).replace('["force_push"]', '"force_push"'),
        "twin: driving: got str",
    ),
    "a drive that is a number": (
        equations(GOOD).replace('["force_push"]', "[3]"),
        "twin: driving: got int; allowed: str",
    ),
    "channels without units": (
        equations(GOOD).replace('{"displacement_cart": "m"}', '["displacement_cart"]'),
        "twin: compared: got list; allowed: channels with their units",
    ),
    "a channel of nothing": (
        equations(GOOD).replace('{"displacement_cart": "m"}', '{"displacement_cart": None}'),
        "twin: compared: got NoneType for 'displacement_cart'",
    ),
    "a mass that is not a number": (mechanism("math.nan"), "run_0: mechanism: mass_kg: got NaN or infinity"),
    "a damper that drives": (mechanism(damping="-4000.0"), "run_0: twin: the motion grew beyond every bound"),
    "a force that is no number": (
        mechanism(force="math.nan * run.channels['force_push']"),
        "run_0: mechanism: driving_force_n: got NaN or infinity, first at sample 0",
    ),
    "a start from a channel that there is not": (
        mechanism().replace("run.start('displacement_cart')", "run.start('displacement_card')"),
        "displacement_card: beginning: got no such channel in run run_0; allowed: displacement_cart, force_push",
    ),
}


QUICK = (
    "raises",
    "ends the process",
    "imports what is not there",
    "writes into its inputs",
    "not a number from a sample on",
    "a sample too few",
    "nothing",
    "a mass in words",
    "equations that raise",
    "a rate that is no number",
    "no tuple",
    "a start that no channel tells",
    "parameters that are none",
    "a drive that is a number",
    "a damper that drives",
    "a force that is no number",
)
"""Of each way to describe a twin what goes wrong when it is read, compiled, run and looked at."""


def refused(twin: str, folder: Path, capsys: pytest.CaptureFixture[str], *, lost: slice = slice(0, 0)) -> str:
    """The one line with which a diagnosis of two runs ends; samples of a channel may be lost."""
    case, file, channel = folder / "case", folder / "twin.py", "displacement_cart"
    (case / "recordings").mkdir(parents=True)
    for number in range(2):
        recording = pushed_run().recording.copy(deep=True)
        recording[channel].values[lost] = np.nan
        recording["quality"] = ("time", np.isnan(recording[channel].values).astype(np.uint8))
        write_recording(recording, case / "recordings" / f"run_{number}.nc")
    file.write_text(twin)
    before = sorted(path for path in folder.rglob("*") if "__pycache__" not in path.parts)
    assert command(["diagnose", str(case), "--twin", str(file), "-o", str(folder / "out")]) == 1
    captured = capsys.readouterr()
    assert captured.out == ""
    said = without_progress(captured.err)
    assert said.startswith("sloshlab: ")
    assert said.count("\n") == 1, said
    assert sorted(path for path in folder.rglob("*") if "__pycache__" not in path.parts) == before
    return said


@pytest.mark.parametrize("name", slow_but(QUICK, BAD))
def test_one_line_says_what_is_wrong_and_nothing_is_written(name: str, tmp_path, capsys) -> None:
    twin, said = BAD[name]
    error = refused(twin, tmp_path, capsys)
    assert said in error
    assert "twin.py" in error


@pytest.mark.parametrize("twin", [equations(GOOD, start="'displacement_cart'"), mechanism()])
@pytest.mark.parametrize("n", slow_but([40], [40, 500]))
def test_a_channel_that_begins_too_late_to_tell_a_start_is_one_line(twin: str, n: int, tmp_path, capsys) -> None:
    error = refused(twin, tmp_path, capsys, lost=slice(0, n))
    assert f"displacement_cart: beginning: got {n} lost samples; allowed: at most 6" in error
    assert "run_0" in error


class TestRaisedErrors:
    """Compiled code has nobody to raise to."""

    def test_raises_of_functions_that_are_called_are_found(self) -> None:
        @njit
        def compiled(x):  # type: ignore[no-untyped-def]
            if x > 1:
                raise ValueError("too large")
            return x

        def calls(state, inputs, parameters, force):  # type: ignore[no-untyped-def]
            return (compiled(state.x),), (state.x,)

        line = compiled.py_func.__code__.co_firstlineno + 3
        with pytest.raises(InputError, match=f"raised in line {line}"):
            require_no_raise(calls, "twin")

    def test_functions_of_numpy_and_math_raise_nothing(self) -> None:
        def calm(state, inputs, parameters, force):  # type: ignore[no-untyped-def]
            return (math.sin(state.x) + np.hypot(state.x, 1.0),), (state.x,)

        require_no_raise(calm, "twin")
        require_no_raise(3, "twin")

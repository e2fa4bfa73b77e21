"""Whatever a rig file holds, it is a rig or one `RigError`."""

from __future__ import annotations

import math

from hypothesis import example, given, settings
from hypothesis import strategies as st
from number_of_examples import examples

from sloshlab.errors import RigError
from sloshlab.rig import Rig

FUZZ = settings(max_examples=examples(200), deadline=None, derandomize=True)
GOOD = {
    "tank": {"height_m": 0.0272, "length_m": 0.1172, "width_m": 0.078, "dry_mass_kg": 0.61},
    "liquid": {"density_kg_per_m3": 1000.0, "fill_level": 0.5, "name": "water"},
}
SCALARS = (
    st.integers(-3, 2000).map(str)
    | st.floats().map(repr)
    | st.sampled_from(["true", "false", "'half'", '"0.5"', "[]", "[0.5]", "{}", "1e400", "9" * 400, "nan"])
)  # fmt: skip
TABLES = ["tank", "liquid", "structure", "twin", "novel", "liquid.deep", "tank.height_m"]
KEYS = [
    *GOOD["tank"],
    *GOOD["liquid"],
    "kind",
    "frequencies_hz",
    "mass_kg",
    "stiffness_n_per_m",
    "tank_model",
    "novel",
]


def rig_or_refused(text: str) -> Rig | RigError:
    try:
        return Rig.from_toml_text(text, name="fuzzed.toml")
    except RigError as error:
        refusal = error
    assert "\n" not in str(refusal)
    assert "fuzzed.toml" in str(refusal)
    return refusal


def toml(tables: dict[str, dict[str, str]]) -> str:
    return "\n".join(
        line for table, rows in tables.items() for line in [f"[{table}]", *(f"{k} = {v}" for k, v in rows.items())]
    )


def assert_possible(rig: Rig) -> None:
    """A rig that was accepted has finite, positive scales."""
    assert 0 < rig.liquid.fill_level < 1
    for value in (rig.tank.height_m, rig.tank.length_m, rig.tank.width_m, rig.tank.dry_mass_kg):
        assert math.isfinite(value)
        assert value > 0
    assert rig.frequency_scale_rad_per_s > 0


@FUZZ
@given(text=st.text(max_size=200) | st.text(alphabet="[]=.\"'#{}, \n\tandkt0123", max_size=200))
@example(text="a = " + "[" * 30_000)
@example(text="a = " + "{b = " * 5_000)
@example(text="[" + "a." * 30_000 + "a]")
@example(text="a = " + "9" * 10_000)
@example(text="\x00")
def test_any_text(text: str) -> None:
    rig_or_refused(text)


@FUZZ
@given(
    changes=st.lists(st.tuples(st.sampled_from(TABLES), st.sampled_from(KEYS), SCALARS), max_size=4),
    dropped=st.sets(st.sampled_from(KEYS), max_size=1),
)
def test_any_values(changes: list[tuple[str, str, str]], dropped: set[str]) -> None:
    tables = {
        table: {key: repr(value) for key, value in rows.items() if key not in dropped}
        for table, rows in GOOD.items()
    }
    for table, key, value in changes:
        tables.setdefault(table, {})[key] = value
    outcome = rig_or_refused(toml(tables))
    if isinstance(outcome, Rig):
        assert_possible(outcome)


def test_the_good_rig_is_accepted() -> None:
    tables = {table: {key: repr(value) for key, value in rows.items()} for table, rows in GOOD.items()}
    outcome = rig_or_refused(toml(tables))
    assert isinstance(outcome, Rig)
    assert_possible(outcome)

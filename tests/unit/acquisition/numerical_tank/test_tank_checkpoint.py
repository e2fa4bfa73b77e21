"""A run that was stopped goes on to the same bytes; a damaged checkpoint is refused."""

from pathlib import Path

import numpy as np
import pytest

from acquisition.numerical_tank import checkpoint
from acquisition.numerical_tank.simulation import NumericalTank
from acquisition.numerical_tank.tank import Box, Numerics, filled_tank
from sloshlab.errors import InputError


@pytest.mark.parametrize("precision", ["double", pytest.param("single", marks=pytest.mark.slow)])
@pytest.mark.parametrize("stop", [1, 403, 608])
def test_restart_reaches_the_same_bytes(tmp_path: Path, stop: int, precision: str) -> None:
    setup = filled_tank(Box(0.06, 0.03), 0.5, 12, seed=9, numerics=Numerics(precision=precision))  # type: ignore[arg-type]
    through = NumericalTank(setup)
    motion = 45 * np.cos(75 * through.times_s(1000))
    forces = through.advance(motion)

    first = NumericalTank(setup)
    first.advance(motion[:stop])
    checkpoint.save(first, tmp_path / "tank.checkpoint")
    again = checkpoint.load(tmp_path / "tank.checkpoint")
    assert again.setup == setup
    rest = again.advance(motion[stop:])
    assert rest.vertical_n.tobytes() == forces.vertical_n[stop:].tobytes()
    assert again.state().x_m.tobytes() == through.state().x_m.tobytes()
    assert again.account() == through.account()
    checkpoint.save(again, tmp_path / "again")
    checkpoint.save(through, tmp_path / "through")
    assert (tmp_path / "again").read_bytes() == (tmp_path / "through").read_bytes()


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("tank") / "tank.checkpoint"
    checkpoint.save(NumericalTank(filled_tank(Box(0.06, 0.03), 0.5, 12)), path)
    return path.read_bytes()


@pytest.mark.parametrize("place", [0, 50, 100, 5000, -1])
def test_any_changed_byte_is_noticed(tmp_path: Path, saved: bytes, place: int) -> None:
    content = bytearray(saved)
    content[place] ^= 1
    (tmp_path / "bad").write_bytes(bytes(content))
    with pytest.raises(InputError, match=r"another file|damaged"):
        checkpoint.load(tmp_path / "bad")


@pytest.mark.parametrize("length", [0, 10, 60, 3000])
def test_a_cut_file_is_refused(tmp_path: Path, saved: bytes, length: int) -> None:
    (tmp_path / "cut").write_bytes(saved[:length])
    with pytest.raises(InputError, match=r"another file|damaged"):
        checkpoint.load(tmp_path / "cut")


def test_a_state_of_another_tank_is_refused() -> None:
    small = NumericalTank(filled_tank(Box(0.06, 0.03), 0.5, 12))
    large = NumericalTank(filled_tank(Box(0.06, 0.03), 0.5, 16))
    with pytest.raises(InputError, match="checkpoint, particles_x"):
        small.restore(large.checkpoint_arrays())

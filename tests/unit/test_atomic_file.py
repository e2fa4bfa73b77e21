"""Files and folders appear complete or not at all."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from sloshlab import atomic_file


def names(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def test_a_file_is_written_and_folders_are_made(tmp_path: Path):
    atomic_file.write_bytes(tmp_path / "a" / "b.bin", b"123")
    assert (tmp_path / "a" / "b.bin").read_bytes() == b"123"
    assert names(tmp_path) == ["a/b.bin"]


def write_half_a_file(target: Path, error: type[BaseException]) -> None:
    with atomic_file.replaced(target) as temporary:
        temporary.write_bytes(b"half")
        assert temporary.suffix == ".nc"
        raise error


def write_half_a_folder(out: Path, error: type[BaseException]) -> None:
    with atomic_file.filled_folder(out) as folder:
        (folder / "windows.nc").write_text("half")
        raise error


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, SystemExit])
def test_on_any_exception_the_old_file_stays(error: type[BaseException], tmp_path: Path):
    target = tmp_path / "run.nc"
    target.write_bytes(b"old")
    with pytest.raises(error):
        write_half_a_file(target, error)
    assert target.read_bytes() == b"old"
    assert names(tmp_path) == ["run.nc"]


def test_a_folder_is_filled_and_what_is_not_written_again_stays(tmp_path: Path):
    out = tmp_path / "out"
    out.mkdir()
    (out / "notes.txt").write_text("kept")
    (out / "windows.nc").write_text("old")
    with atomic_file.filled_folder(out) as folder:
        (folder / "windows.nc").write_text("new")
        (folder / "figures").mkdir()
        (folder / "figures" / "map.png").write_text("picture")
        assert (out / "windows.nc").read_text() == "old"
    assert names(out) == ["figures/map.png", "notes.txt", "windows.nc"]
    assert (out / "windows.nc").read_text() == "new"
    assert names(tmp_path) == ["out/figures/map.png", "out/notes.txt", "out/windows.nc"]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
@pytest.mark.parametrize("exists", [False, True])
def test_an_interrupted_folder_is_as_it_was(error: type[BaseException], exists: bool, tmp_path: Path):
    out = tmp_path / "out"
    if exists:
        out.mkdir()
        (out / "windows.nc").write_text("old")
    with pytest.raises(error):
        write_half_a_folder(out, error)
    assert out.exists() is exists
    assert names(tmp_path) == (["out/windows.nc"] if exists else [])
    if exists:
        assert (out / "windows.nc").read_text() == "old"


def test_a_file_in_place_of_the_folder_is_not_touched(tmp_path: Path):
    out = tmp_path / "out"
    out.write_text("a letter")
    with pytest.raises(FileExistsError), atomic_file.filled_folder(out) as folder:
        (folder / "windows.nc").write_text("new")
    assert out.read_text() == "a letter"
    assert names(tmp_path) == ["out"]


def test_a_file_that_cannot_be_put_takes_the_others_back(tmp_path: Path):
    out = tmp_path / "out"
    out.mkdir()
    (out / "maps.nc").write_text("old")

    def written() -> None:
        with atomic_file.filled_folder(out) as folder:
            for name in ("absent.nc", "maps.nc", "windows.nc"):
                (folder / name).write_text("new")
            (folder / "figures").mkdir()
            (folder / "figures" / "map.png").write_text("picture")
            (out / "windows.nc").mkdir()  # it appears meanwhile, and its name comes last

    with pytest.raises(IsADirectoryError):
        written()
    assert names(tmp_path) == ["out/maps.nc"]
    assert (out / "maps.nc").read_text() == "old"
    assert sorted(path.name for path in out.iterdir()) == ["maps.nc", "windows.nc"]


def test_folders_and_files_in_several_places_appear_together(tmp_path: Path):
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "old.txt").write_text("goes")

    def written(fails: bool) -> None:
        with atomic_file.together() as stagings:
            stagings.file(tmp_path / "a" / "one.nc").write_text("1")
            (stagings.folder(tmp_path / "b").folder / "two.nc").write_text("2")
            stagings.folder(tmp_path / "b").removed.append(tmp_path / "b" / "old.txt")
            if fails:
                raise ValueError

    with pytest.raises(ValueError, match=r"^$"):
        written(fails=True)
    assert names(tmp_path) == ["b/old.txt"]
    assert not (tmp_path / "a").exists()
    written(fails=False)
    assert names(tmp_path) == ["a/one.nc", "b/two.nc"]


def test_a_link_is_replaced_itself_and_what_it_points_to_stays(tmp_path: Path):
    (tmp_path / "measured.nc").write_text("measured")
    (tmp_path / "run.nc").symlink_to("measured.nc")
    atomic_file.write_bytes(tmp_path / "run.nc", b"new")
    assert (tmp_path / "measured.nc").read_text() == "measured"
    assert not (tmp_path / "run.nc").is_symlink()
    assert (tmp_path / "run.nc").read_text() == "new"


def test_nothing_is_written_through_a_link_in_the_place_of_a_folder(tmp_path: Path):
    elsewhere, out = tmp_path / "elsewhere", tmp_path / "out"
    elsewhere.mkdir()
    out.mkdir()
    (out / "figures").symlink_to(elsewhere)

    def written() -> None:
        with atomic_file.filled_folder(out) as folder:
            (folder / "figures").mkdir()
            (folder / "figures" / "map.png").write_text("picture")

    with pytest.raises(NotADirectoryError):
        written()
    assert names(tmp_path) == []


def test_a_file_that_appears_meanwhile_is_not_replaced_unless_it_may_be(tmp_path: Path):
    target = tmp_path / "run.nc"

    def written(overwrite: bool) -> None:
        with atomic_file.replaced(target, overwrite=overwrite) as temporary:
            temporary.write_text("new")
            target.write_text("appeared")

    with pytest.raises(FileExistsError):
        written(overwrite=False)
    assert (names(tmp_path), target.read_text()) == (["run.nc"], "appeared")
    written(overwrite=True)
    assert (names(tmp_path), target.read_text()) == (["run.nc"], "new")


KILLED = """
import os, signal, sys
from pathlib import Path
from sloshlab import atomic_file

out, n_moves = Path(sys.argv[1]), int(sys.argv[2])
replace, calls = os.replace, []

def killed(*paths):
    # the first call puts the plan in its place
    if len(calls) > n_moves:
        os.kill(os.getpid(), signal.SIGKILL)
    calls.append(paths)
    return replace(*paths)

with atomic_file.filled_folder(out) as folder:
    for name in ("a.nc", "b.nc", "c.nc"):
        (folder / name).write_text("new")
    os.replace = killed
    os.kill(os.getpid(), signal.SIGKILL) if n_moves < 0 else None
"""


@pytest.mark.parametrize("n_moves", [-1, 0, 1, 2])
@pytest.mark.parametrize("exists", [False, True])
def test_what_a_killed_process_left_is_undone_by_the_next_one(n_moves: int, exists: bool, tmp_path: Path):
    out = tmp_path / "out"
    if exists:
        out.mkdir()
        (out / "a.nc").write_text("old")
        (out / "c.nc").write_text("old")
    ended = subprocess.run([sys.executable, "-c", KILLED, str(out), str(n_moves)], check=False, timeout=60)
    assert ended.returncode == -signal.SIGKILL
    assert any(name.startswith(".sloshlab-") or "/.sloshlab-" in name for name in names(tmp_path))
    with pytest.raises(ValueError, match=r"^$"):
        write_half_a_folder(out, ValueError)
    assert names(tmp_path) == (["out/a.nc", "out/c.nc"] if exists else [])
    assert all((tmp_path / name).read_text() == "old" for name in names(tmp_path))
    assert out.exists() is exists


def test_what_a_living_process_is_writing_stays(tmp_path: Path):
    with atomic_file.filled_folder(tmp_path) as folder:
        (folder / "windows.nc").write_text("new")
        with atomic_file.filled_folder(tmp_path) as other:
            (other / "maps.nc").write_text("new")
        assert (folder / "windows.nc").read_text() == "new"
    assert names(tmp_path) == ["maps.nc", "windows.nc"]


def test_a_plan_from_elsewhere_undoes_nothing_outside_its_folder(tmp_path: Path):
    (tmp_path / "letter.txt").write_text("mine")
    own = tmp_path / "out" / ".sloshlab-x.part"
    (own / "new").mkdir(parents=True)
    move = {"new": "a", "place": "../letter.txt", "is_there": False}
    for target, place in ((".", "../letter.txt"), ("..", "letter.txt"), (str(tmp_path), "letter.txt")):
        plan = {"target": target, "moves": [{**move, "place": place}], "made": []}
        (own / "plan.json").write_text(json.dumps(plan))
        atomic_file.write_bytes(tmp_path / "out" / "run.nc", b"new")
        assert (tmp_path / "letter.txt").read_text() == "mine"

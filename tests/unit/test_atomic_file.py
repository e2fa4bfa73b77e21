"""Files and folders appear complete or not at all."""

from __future__ import annotations

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

"""Files, and folders of files, that appear complete or not at all, and together.

Everything is written into a staging folder beside its place and moved there at the end. What was there before is
kept until the last file has its place, and comes back if one of them cannot be put. A staging folder holds a plan
of its moves while they happen, so that the next writer into the same folder can undo them after a kill -9.

Notes
-----
Places are never reached through a link: a link in the place of a file is replaced itself, what it points to stays
as it is, and a link in the place of a folder of the results is refused. The folder that is named may be a link.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

from sloshlab import interrupt

_PREFIX, _SUFFIX = ".sloshlab-", ".part"
_NEW, _OLD, _PLAN = "new", "old", "plan.json"
_LARGEST_PLAN_BYTES: Final = 50_000_000


class Staging:
    """Files on their way into one folder.

    Parameters
    ----------
    target : Path
        The folder; made when the files are put.

    Attributes
    ----------
    folder : Path
        Where to write, on the same file system; its files go to the same places in `target`.
    removed : list of Path
        Files of `target` that go when the new ones come.
    overwrite : bool
        False refuses a file that has appeared meanwhile in the place of a new one.
    """

    def __init__(self, target: Path) -> None:
        # absolute, not resolved: a program may change its folder meanwhile
        self.target = target.absolute()
        self.overwrite = True
        self.removed: list[Path] = []
        # on the same file system as the target, or a move would be a copy that an interrupt leaves half done
        beside = self.target if self.target.is_dir() else self.target.parent
        self._made = _made_folders(beside)
        _clean_up(beside)
        self._own, self._lock = _locked_folder(beside)
        self.folder = self._own / _NEW
        self.folder.mkdir()

    def put(self) -> None:
        """Move every file to its place; what was there is kept until `close`.

        Raises
        ------
        OSError
            If a file cannot be put; `close` then brings back what was there.
        """
        if os.path.lexists(self.target) and not self.target.is_dir():
            raise FileExistsError(17, "a file in the place of a folder", str(self.target))
        sources = sorted(path for path in self.folder.rglob("*") if not path.is_dir() or path.is_symlink())
        names = [path.relative_to(self.folder) for path in sources]
        moves: list[tuple[Path | None, Path]] = [(name, self.target / name) for name in names]
        moves += [(None, place) for place in self.removed if place not in {place for _, place in moves}]
        for _, place in moves:
            _require_no_link_above(place, self.target)
        folders = _absent_folders(self.target, [place for _, place in moves])
        plan = {
            "target": "." if self._own.parent == self.target else self.target.name,
            "moves": [
                {
                    "new": None if name is None else str(name),
                    "place": str(place.relative_to(self.target)),
                    "is_there": os.path.lexists(place),
                }
                for name, place in moves
            ],
            "made": [str(folder.relative_to(self.target)) for folder in folders],
        }
        # before the first move: after a kill -9 it says what to undo
        (self._own / _OLD).mkdir()
        _write_plan(self._own / _PLAN, plan)
        for folder in reversed(folders):
            folder.mkdir(exist_ok=True)
        for number, (name, place) in enumerate(moves):
            kept = self._own / _OLD / str(number)
            if name is None:
                os.rename(place, kept)
            else:
                self._put_one(self.folder / name, place, kept)

    def _put_one(self, source: Path, place: Path, kept: Path) -> None:
        if not self.overwrite:
            _put_where_nothing_is(source, place)
            return
        if place.is_dir() and not place.is_symlink():
            raise IsADirectoryError(21, "a folder in the place of a file", str(place))
        if os.path.lexists(place):
            _keep(place, kept)
        # atomic: readers see the old file or the new one, never a part
        os.replace(source, place)

    def done(self) -> None:
        """From here on the new files stay."""
        (self._own / _PLAN).unlink()

    def close(self) -> None:
        """Undo what was put unless it is done, and leave nothing behind."""
        _undone(self._own)
        shutil.rmtree(self._own, ignore_errors=True)
        for place in sorted({path.parent for path in self.removed}, reverse=True):
            # folders that nothing is left in, such as that of figures
            with contextlib.suppress(OSError):
                place.rmdir()
        for folder in self._made:
            with contextlib.suppress(OSError):
                folder.rmdir()
        if self._lock is not None:
            os.close(self._lock)


class Stagings:
    """Staging folders whose files take their places together."""

    def __init__(self) -> None:
        self._open: dict[Path, Staging] = {}

    def folder(self, target: str | os.PathLike[str]) -> Staging:
        """Staging of a folder, the same one each time."""
        place = Path(target).absolute()
        # a writer that was killed when the folder was new staged beside it
        _clean_up(place.parent)
        return self._staging(place)

    def file(self, target: str | os.PathLike[str], *, overwrite: bool = True) -> Path:
        """Where to write a file; `overwrite` holds for all files of its folder."""
        place = Path(target).absolute()
        staging = self._staging(place.parent)
        staging.overwrite = overwrite
        return staging.folder / place.name

    def _staging(self, place: Path) -> Staging:
        if place not in self._open:
            # an interrupt between the making of a folder and its note would leave it behind
            with interrupt.held():
                self._open[place] = Staging(place)
        return self._open[place]

    @property
    def all(self) -> Sequence[Staging]:
        """In the order in which they were asked for."""
        return tuple(self._open.values())


@contextlib.contextmanager
def together() -> Iterator[Stagings]:
    """Yield places to write files and folders; on success all of them take their places, or none does.

    On any exception, an interrupt included, everything is as it was.

    Yields
    ------
    Stagings
        Its methods `file` and `folder` say where to write.

    Raises
    ------
    OSError
        If a file cannot be put; what was put before it is taken back.
    """
    stagings = Stagings()
    try:
        yield stagings
        # an interrupt between two moves would find some of the files old and some new
        with interrupt.held():
            for staging in stagings.all:
                staging.put()
            for staging in stagings.all:
                staging.done()
    finally:
        with interrupt.held():
            for staging in reversed(stagings.all):
                staging.close()


@contextlib.contextmanager
def replaced(path: str | os.PathLike[str], *, overwrite: bool = True) -> Iterator[Path]:
    """Yield a temporary path; on success it takes the place of `path`.

    On any exception, an interrupt included, the temporary file is removed and `path` is as it was.

    Parameters
    ----------
    path : path-like
        The file to write; missing folders above it are made. A link is replaced itself.
    overwrite : bool
        False refuses a file that is there at the end.

    Yields
    ------
    Path
        Where to write. It has the name of `path`, because some writers choose their format by its suffix.
    """
    with together() as stagings:
        yield stagings.file(path, overwrite=overwrite)


@contextlib.contextmanager
def filled_folder(folder: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary folder; on success its files take their places in `folder`, all together.

    On any exception, an interrupt included, `folder` is as it was, or still absent.

    Parameters
    ----------
    folder : path-like
        Made if missing. Files that are there and are not written again stay.

    Yields
    ------
    Path
        An empty folder on the same file system.
    """
    with together() as stagings:
        yield stagings.folder(folder).folder


def write_bytes(path: str | os.PathLike[str], content: bytes) -> None:
    """Write `content` to `path` atomically."""
    with replaced(path) as temporary:
        temporary.write_bytes(content)


def _made_folders(folder: Path) -> list[Path]:
    """Make a folder and those above it; return those that were not there, the deepest first."""
    absent = [above for above in (folder, *folder.parents) if not above.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    return absent


def _absent_folders(target: Path, places: Sequence[Path]) -> list[Path]:
    """Folders that the places need, the deepest first."""
    needed = {above for place in places for above in place.parents if above == target or target in above.parents}
    return sorted((folder for folder in needed | {target} if not os.path.lexists(folder)), reverse=True)


def _require_no_link_above(place: Path, target: Path) -> None:
    for above in place.parents:
        if above == target:
            return
        if above.is_symlink():
            raise NotADirectoryError(20, "a link in the place of a folder", str(above))


def _keep(place: Path, kept: Path) -> None:
    """Keep what is at a place, under another name; a link as a link."""
    try:
        # a second name: at no moment is the place empty
        os.link(place, kept, follow_symlinks=False)
    except (OSError, NotImplementedError):
        # some file systems know no second names
        os.rename(place, kept)


def _put_where_nothing_is(source: Path, place: Path) -> None:
    try:
        # unlike a move it never takes the place of a file that appeared a moment ago
        os.link(source, place)
    except FileExistsError:
        raise
    except OSError:
        if os.path.lexists(place):
            raise FileExistsError(17, "a file that is there already", str(place)) from None
        os.rename(source, place)
    else:
        source.unlink()


def _write_plan(path: Path, plan: dict[str, Any]) -> None:
    whole = path.with_suffix(".tmp")
    whole.write_text(json.dumps(plan))
    os.replace(whole, path)


def _undone(own: Path) -> None:
    """Bring back what was there before the moves of a staging folder that are not done."""
    path = own / _PLAN
    if not path.is_file() or path.stat().st_size > _LARGEST_PLAN_BYTES:
        return
    plan: dict[str, Any] = json.loads(path.read_text())
    target = own.parent / _within(plan["target"], most_parts=1)
    moves = [(target / _within(move["place"]), move) for move in plan["moves"]]
    for number, (place, move) in reversed(list(enumerate(moves))):
        _require_no_link_above(place, target)
        kept = own / _OLD / str(number)
        if os.path.lexists(kept):
            os.replace(kept, place)
        elif not move["is_there"] and _is_put(own / _NEW / _within(move["new"]), place):
            place.unlink(missing_ok=True)
    for folder in plan["made"]:
        with contextlib.suppress(OSError):
            (target / _within(folder)).rmdir()
    path.unlink()


def _is_put(new: Path, place: Path) -> bool:
    """Whether a file has been moved, or has both names yet."""
    return not os.path.lexists(new) or (os.path.lexists(place) and os.path.samestat(new.lstat(), place.lstat()))


def _within(name: str, most_parts: int = 100) -> Path:
    """A path that leads nowhere but down; a plan may come with a folder from anywhere."""
    path = Path(name)
    if path.is_absolute() or ".." in path.parts or len(path.parts) > most_parts:
        raise ValueError(f"{name} leads out of the folder")
    return path


def _locked_folder(beside: Path) -> tuple[Path, int | None]:
    """A new staging folder, locked as long as this process lives or until it is closed."""
    while True:
        own = Path(tempfile.mkdtemp(prefix=_PREFIX, suffix=_SUFFIX, dir=beside))
        lock = _lock(own, wait=True)
        if own.exists():
            return own, lock
        # another process took it for a leftover, between its making and its lock
        if lock is not None:
            os.close(lock)


def _lock(folder: Path, *, wait: bool) -> int | None:
    """A lock that ends with the process; None where it is held or there is none."""
    try:
        import fcntl

        number = os.open(folder, os.O_RDONLY)
    except (ImportError, OSError):
        return None
    try:
        fcntl.flock(number, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(number)
        return None
    return number


def _clean_up(folder: Path) -> None:
    """Undo and remove what killed processes left in a folder; what is held by a living one stays."""
    with contextlib.suppress(OSError):
        with os.scandir(folder) as entries:
            names = [entry.name for entry in entries if entry.is_dir(follow_symlinks=False)]
        for name in names:
            if name.startswith(_PREFIX) and name.endswith(_SUFFIX):
                _clean_up_one(folder / name)


def _clean_up_one(own: Path) -> None:
    lock = _lock(own, wait=False)
    if lock is None:
        return
    try:
        # what cannot be understood is no plan of ours, and stays
        with contextlib.suppress(OSError, ValueError, KeyError, TypeError), interrupt.held():
            if own.stat().st_uid == os.getuid():
                _undone(own)
                shutil.rmtree(own, ignore_errors=True)
    finally:
        os.close(lock)

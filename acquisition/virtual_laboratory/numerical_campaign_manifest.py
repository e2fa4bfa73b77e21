"""The manifest of a campaign of a computed liquid: which recordings are there, and what each was made of."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from acquisition.virtual_laboratory.campaign import (
    MANIFEST_NAME,
    file_record,
    laboratory_option,
)
from acquisition.virtual_laboratory.numerical_campaign_tasks import CampaignSettings, CampaignTask, made_of
from acquisition.virtual_laboratory.numerical_runs import RIG_TEXTS
from sloshlab import atomic_file
from sloshlab._version import __version__
from sloshlab.errors import InputError, SloshlabError
from sloshlab.recording import read_attributes

COMMAND: Final = "sloshlab virtual campaign --liquid {} -o raw_data/{} --layers {} --seed {}"


class Manifest:
    """`manifest.json`: what each file is, and what it was made of."""

    def __init__(self, folder: Path, settings: CampaignSettings) -> None:
        self.path, self._folder, self._settings = folder / MANIFEST_NAME, folder, settings
        self._runs: dict[str, Any] = {}
        self._files: dict[str, Any] = {}
        # a manifest that is not there, or none, vouches for nothing
        with contextlib.suppress(OSError, ValueError, KeyError, TypeError, AttributeError):
            known = json.loads(self.path.read_text(encoding="utf-8"))
            self._runs, self._files = dict(known["runs"]), dict(known["files"])

    def vouches_for(self, task: CampaignTask) -> bool:
        """Whether the recording is there, unchanged, and made as it would be made now."""
        run = self._runs.get(task.run.name)
        if not isinstance(run, dict) or run.get("made_of") != made_of(task) or not task.recording.is_file():
            return False
        # by its content: a recording may have been replaced or cut since
        return bool(self._files.get(self._relative(task.recording)) == file_record(task.recording))

    def require_own(self, tasks: Sequence[CampaignTask]) -> None:
        """Refuse to replace files of no campaign; a recording that was damaged since is made again.

        Raises
        ------
        InputError
        """
        rigs = {self._folder / name: text.encode() for name, text in RIG_TEXTS.items()}
        others = [path for path, text in rigs.items() if path.exists() and path.read_bytes() != text]
        # a campaign that was killed leaves recordings that its manifest does not name yet
        others += [t.recording for t in tasks if os.path.lexists(t.recording) and not is_of_a_campaign(t)]
        for path in others:
            if self._relative(path) not in self._files:
                raise InputError(
                    f"recording {path}",
                    got="a file that no campaign wrote",
                    remedy="another folder, or --overwrite",
                )

    def add(self, task: CampaignTask, result: Mapping[str, Any]) -> None:
        """Vouch for a recording that was made just now."""
        self._files[self._relative(task.recording)] = file_record(task.recording)
        self._runs[task.run.name] = {
            "seed": task.seed,
            "settings": dict(task.run.settings),
            "rig": task.run.rig,
            **({"layers_per_height": task.layers_per_height} if task.run.is_computed else {}),
            "made_of": made_of(task),
            "computing_s": round(result["computing_s"], 1),
            **({"flag": result["flag"]} if result["flag"] else {}),
        }
        self.write()

    def write(self) -> None:
        """Write the file, atomically."""
        self._files.update({name: file_record(self._folder / name) for name in RIG_TEXTS})
        content = {
            "format": 1,
            "command": command_of(self._settings),
            "seed": self._settings.seed,
            "layers_per_height": self._settings.layers_per_height,
            "sloshlab_version": __version__,
            "runs": self._runs,
            "files": self._files,
        }
        atomic_file.write_bytes(self.path, (json.dumps(content, indent=1, sort_keys=True) + "\n").encode())

    def _relative(self, path: Path) -> str:
        return path.relative_to(self._folder).as_posix()


def command_of(settings: CampaignSettings) -> str:
    """The command that makes the same campaign."""
    names = ("two_phase", "two_phase_tank") if settings.with_gas else ("numerical", "numerical_tank")
    made = COMMAND.format(*names, settings.layers_per_height, settings.seed)
    return made + laboratory_option(settings.laboratory_seed)


def is_of_a_campaign(task: CampaignTask) -> bool:
    """Whether the recording of a task says of itself that it is one."""
    try:
        attributes = read_attributes(task.recording)
    except SloshlabError:
        return False
    more = attributes.model_extra or {}
    return attributes.run_id == Path(task.run.name).name and "liquid" in more and more.get("seed") == task.seed

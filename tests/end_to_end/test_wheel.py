"""The main job runs from a wheel, in an empty folder, without the checkout."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from acquisition.virtual_laboratory.liquid_law import dissipated_work

REPOSITORY = Path(__file__).resolve().parents[2]
SHIPPED = ("sloshlab", "acquisition", "pipelines", "sealed_trial")


def done(*arguments: object, cwd: Path, **environment: str) -> str:
    """What a Python command said; fails with its errors."""
    settings = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    command = [sys.executable, *map(str, arguments)]
    said = subprocess.run(command, cwd=cwd, env={**settings, **environment}, capture_output=True, text=True)
    assert said.returncode == 0, said.stdout + said.stderr
    return said.stdout


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what the wheel of this checkout installs; built of a copy, which may leave files behind."""
    made = tmp_path_factory.mktemp("wheel")
    source = made / "source"
    without = shutil.ignore_patterns("__pycache__", "archive")
    for name in SHIPPED:
        shutil.copytree(REPOSITORY / name, source / name, ignore=without)
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copyfile(REPOSITORY / name, source / name)
    quiet = ("--quiet", "--disable-pip-version-check", "--no-deps")
    done("-m", "pip", "wheel", *quiet, "--no-build-isolation", "--no-index", "-w", made, source, cwd=made)
    [wheel] = made.glob("sloshlab-*.whl")
    done("-m", "pip", "install", *quiet, "--no-index", "--target", made / "site", wheel, cwd=made)
    return made / "site"


@pytest.mark.slow
def test_ten_lines_of_the_documentation_run_from_a_wheel_in_an_empty_folder(
    installed: Path, tmp_path: Path
) -> None:
    page = (REPOSITORY / "docs" / "python.md").read_text(encoding="utf-8")
    [code, *_] = re.findall(r"^```python\n(.*?)^```", page, flags=re.MULTILINE | re.DOTALL)
    assert len([line for line in code.splitlines() if line]) <= 10
    environment = {"PYTHONPATH": str(installed), "MPLBACKEND": "agg"}
    said = done("-c", code, cwd=tmp_path, **environment)
    assert said.splitlines()[-1] == str(Path("results") / "report.html")
    for name in ("report.html", "windows.nc", "maps.nc"):
        assert (tmp_path / "results" / name).stat().st_size > 1000
    assert (tmp_path / "w_bar.png").read_bytes().startswith(b"\x89PNG")
    with xr.open_dataset(tmp_path / "results" / "windows.nc") as windows:
        law = dissipated_work(windows["omega_bar"], windows["u_bar"], 0.5)
        error = (windows["w_bar"] - law)[np.isfinite(windows["w_bar"])]
    # the liquid scatters from cycle to cycle by up to 12 % of its work
    assert float(np.abs(error).mean()) < 0.05 * float(law.max())
    modules = "import pipelines, sloshlab; print(pipelines.__file__, sloshlab.__file__, sep='\\n')"
    places = done("-c", modules, cwd=tmp_path, **environment).splitlines()
    assert [place for place in places if not Path(place).is_relative_to(installed)] == []

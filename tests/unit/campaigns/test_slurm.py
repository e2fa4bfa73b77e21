"""Jobs of Slurm, played by commands ``sbatch`` and ``scancel`` that run and kill the script of the job here.

There is no Slurm where these tests run: they show that scripts are submitted, workers come and results are right.
"""

from __future__ import annotations

import os
import stat
import sys
from pathlib import Path

import pytest

pytest.importorskip("dask_jobqueue")

from test_store import contents, run, tasks_of

from campaigns.campaign import run_campaign
from campaigns.slurm import SlurmExecutor
from campaigns.store import Store
from campaigns.task import ClusterError

pytestmark = pytest.mark.filterwarnings("ignore")

SBATCH = """#!{python}
import pathlib, subprocess, sys
jobs = pathlib.Path({jobs!r})
number = len(list(jobs.iterdir())) + 1
script = jobs / f"{{number}}.sh"
script.write_text(pathlib.Path(sys.argv[-1]).read_text())
log = open(jobs.parent / f"{{number}}.log", "w")
job = subprocess.Popen(["bash", str(script)], stdout=log, stderr=log, start_new_session=True)
(jobs.parent / f"{{number}}.pid").write_text(str(job.pid))
print("Submitted batch job", number)
"""
SCANCEL = """#!{python}
import os, pathlib, signal, sys
for number in sys.argv[1:]:
    try:
        os.killpg(int((pathlib.Path({jobs!r}).parent / f"{{number}}.pid").read_text()), signal.SIGKILL)
    except ProcessLookupError:
        pass
"""


@pytest.fixture
def slurm(tmp_path, monkeypatch) -> Path:
    """Folder of the scripts that were submitted."""
    commands, jobs = tmp_path / "bin", tmp_path / "queue" / "jobs"
    commands.mkdir()
    jobs.mkdir(parents=True)
    for name, text in {"sbatch": SBATCH, "scancel": SCANCEL}.items():
        (commands / name).write_text(text.format(python=sys.executable, jobs=str(jobs)))
        (commands / name).chmod(0o755 | stat.S_IXUSR)
    monkeypatch.setenv("PATH", f"{commands}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(Path(__file__).parent), *sys.path]))
    monkeypatch.chdir(tmp_path)
    return jobs


def test_jobs_make_the_bytes_of_this_machine(slurm, tmp_path):
    recordings = tmp_path / "recordings"
    recordings.mkdir()
    for number in range(4):
        (recordings / f"{number}.bin").write_bytes(bytes([65 + number]))
    tasks = tasks_of(recordings)
    asked = {"queue": "night", "memory": "1 GB", "job_extra_directives": ("--exclusive",)}
    outcomes = run_campaign(tasks, Store(tmp_path / "jobs"), SlurmExecutor(2, asked))
    assert {outcome.status for outcome in outcomes.values()} == {"done"}
    run(tasks, tmp_path / "here")
    assert contents(tmp_path / "jobs") == contents(tmp_path / "here") != {}
    scripts = [path.read_text() for path in slurm.iterdir()]
    assert len(scripts) == 2
    for line in ("#SBATCH -p night", "#SBATCH --exclusive", "#SBATCH -t 00:30:00", "--nthreads 1"):
        assert line in scripts[0]


def test_a_machine_without_slurm_is_said_in_one_line(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(ClusterError, match="slurm: got no command sbatch") as refusal:
        SlurmExecutor(1, {})
    assert "\n" not in str(refusal.value)

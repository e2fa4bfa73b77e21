"""The campaign of the numerical tank: its runs, its manifest, what is kept and what is made again."""

import hashlib
import json
import math
import os
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

from acquisition.virtual_laboratory import numerical_campaign
from acquisition.virtual_laboratory.numerical_campaign import make_numerical_campaign
from acquisition.virtual_laboratory.numerical_campaign_tasks import CampaignSettings, campaign_tasks
from acquisition.virtual_laboratory.numerical_runs import RIG_TEXTS, NumericalRun, numerical_runs
from campaigns.task import Ending
from sloshlab.errors import InputError
from sloshlab.recording import read_recording
from sloshlab.rig import Rig

pytestmark = pytest.mark.usefixtures("programs_are_forks")

RIG = "shaker/rig_fill_0.50.toml"
SWEEP = {"experiment": "shaker_sweep", "configuration": "sloshing", "duration_s": 5.0}
SHORT = [
    NumericalRun("shaker/frozen", RIG, 9, {**SWEEP, "acceleration_g": 3.0, "configuration": "frozen"}),
    NumericalRun("shaker/fast", RIG, 7, {**SWEEP, "acceleration_g": 3.0}),
    NumericalRun(
        "sdof/decay",
        "sdof/rig_sdof.toml",
        2,
        {"experiment": "sdof_free", "configuration": "frozen", "duration_s": 0.5},
    ),
]
COARSE = CampaignSettings(seed=2, layers_per_height=8, n_workers=1)


def settings(**more) -> CampaignSettings:
    return CampaignSettings(**{**COARSE.__dict__, **more})


def contents(folder: Path) -> dict[str, str]:
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != "manifest.json"
    }


def one_after_another(tasks, executor, *, progressed, finished) -> None:
    """Stands in for `work_through` without other processes."""
    for number, task in enumerate(tasks):
        told = partial(progressed, number)
        finished(number, Ending("done", numerical_campaign.record_run_of_task(task.arguments, told)))


@pytest.fixture(scope="module")
def campaign(tmp_path_factory) -> tuple[Path, list, list]:
    """Made in this process, so that the others can be compared with it."""
    folder, finished, shares = tmp_path_factory.mktemp("campaign") / "tank", [], []
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(numerical_campaign, "work_through", one_after_another)
        summary = make_numerical_campaign(
            folder, COARSE, runs=SHORT, finished=finished.append, progressed=shares.append
        )
    assert (summary.n_made, summary.n_kept, summary.flags) == (3, 0, ())
    return folder, finished, shares


def test_the_runs_are_those_that_were_asked_for() -> None:
    runs = numerical_runs()
    assert len({run.name for run in runs}) == len({run.number for run in runs}) == len(runs)
    half_full = [run for run in runs if run.rig == RIG and run.settings["experiment"] == "shaker_sweep"]
    sweeps = [run for run in half_full if run.is_computed]
    up = [run.settings["acceleration_g"] for run in sweeps if "direction" not in run.settings]
    assert sorted(up) == [0.25, 0.5, 1, 1.5, 2, 3, 3, 3, 4, 5, 6]
    assert [run.settings["acceleration_g"] for run in sweeps if "direction" in run.settings] == [3]
    assert sorted(run.settings["configuration"] for run in half_full if not run.is_computed) == ["empty", "frozen"]
    assert sorted(run.settings["duration_s"] for run in runs if run.settings["experiment"] == "shaker_vfa") == [
        240,
        480,
    ]
    for fill_level in ("0.25", "0.75"):
        named = [run for run in runs if f"fill_{fill_level}" in run.rig]
        assert sum(run.is_computed for run in named) == 5
        assert len(named) == 7
    beam = [run.settings for run in runs if run.rig.startswith("beam")]
    decays = [settings["configuration"] for settings in beam if settings["experiment"] == "beam_free"]
    assert sorted(decays) == ["frozen", "sloshing", "sloshing", "sloshing"]
    assert {
        abs(settings["initial_displacement_m"]) for settings in beam if settings["experiment"] == "beam_free"
    } == {0.0146}
    random = [
        (settings["rms_g"], settings["duration_s"]) for settings in beam if settings["experiment"] == "beam_random"
    ]
    assert random == [(0.1, 90), (0.2, 90), (0.4, 90)]
    sdof = [run.settings for run in runs if run.rig.startswith("sdof")]
    assert {settings["initial_displacement_m"] for settings in sdof} == {0.064}
    long_stroke = [run.settings for run in runs if run.name.startswith("long_stroke")]
    assert sorted(settings["acceleration_g"] for settings in long_stroke) == [3, 3, 3, 4, 5, 6, 7, 8, 8]
    for settings in long_stroke:  # within the stroke at the lowest frequency
        assert (
            settings["acceleration_g"] * 9.81 / (2 * math.pi * settings["start_hz"]) ** 2
            < settings["stroke_limit_m"]
        )
    transients = [run.settings for run in runs if run.name.startswith("transients")]
    kinds = [transient["experiment"] for transient in transients]
    assert {kind: kinds.count(kind) for kind in kinds} == {
        "sudden_start": 40,
        "beam_free": 6,
    }
    sudden = [transient for transient in transients if transient["experiment"] == "sudden_start"]
    starts = [(settings["start_hz"], settings["acceleration_g"]) for settings in sudden]
    assert len(set(starts)) == 20
    assert sum(frequency_hz % 1 == 0.5 for frequency_hz, _ in starts) == 12  # for validation, between the others


def test_runs_that_were_there_before_keep_their_seeds() -> None:
    """Seeds follow from the place in the list; as in the manifest of the first campaign."""
    runs = {run.name: run.number for run in numerical_runs()}
    assert runs["shaker/fill_0.50_vfa_480s"] == 14
    assert runs["beam/decay_sloshing_repeat_1"] == 31
    assert runs["sdof/decay_sloshing"] == 38
    assert min(number for name, number in runs.items() if name.startswith("transients")) == 39
    assert min(number for name, number in runs.items() if name.startswith("long_stroke")) == 85


def test_repeats_share_everything_but_seed_and_repeat() -> None:
    runs = {run.name: run for run in numerical_runs()}
    first = runs["shaker/fill_0.50_sweep_3.00g"].settings
    for repeat in (2, 3):
        assert runs[f"shaker/fill_0.50_sweep_3.00g_repeat_{repeat}"].settings == {**first, "repeat": repeat}


def test_every_rig_is_one() -> None:
    for name, text in RIG_TEXTS.items():
        rig = Rig.from_toml_text(text)
        assert (rig.structure is None) == ("rig_fill_" in name)


def test_the_manifest_tells_what_each_file_is(campaign) -> None:
    folder, finished, _ = campaign
    manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    assert {name: entry["sha256"] for name, entry in manifest["files"].items()} == contents(folder)
    assert all((folder / name).stat().st_size == entry["bytes"] for name, entry in manifest["files"].items())
    assert (manifest["seed"], manifest["layers_per_height"]) == (2, 8)
    assert manifest["command"].endswith("--layers 8 --seed 2")
    for run in finished:
        assert manifest["runs"][run.name]["computing_s"] == round(run.computing_s, 1)
    assert len({entry["seed"] for entry in manifest["runs"].values()}) == 3
    assert manifest["runs"]["shaker/fast"]["settings"]["acceleration_g"] == 3.0
    assert manifest["runs"]["shaker/fast"]["layers_per_height"] == 8
    assert "layers_per_height" not in manifest["runs"]["shaker/frozen"]


def test_the_longest_run_comes_first_and_progress_ends_with_all(campaign) -> None:
    _, finished, shares = campaign
    assert [run.name for run in finished] == ["shaker/fast", "shaker/frozen", "sdof/decay"]
    assert [run.n_done for run in finished] == [1, 2, 3]
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(1.0)


def test_recordings_name_their_rig_and_their_run(campaign) -> None:
    folder, _, _ = campaign
    run = read_recording(folder / "shaker" / "fast.nc")
    assert (run.attrs["run_id"], run.attrs["rig"]) == ("fast", "rig_fill_0.50.toml")
    assert (run.attrs["seed"], run.attrs["liquid"]) == (2507, "numerical_tank")
    assert run.attrs["start_time_utc"] == "2026-01-12T10:10:00Z"


def test_with_gas_everything_is_made(campaign, tmp_path, monkeypatch) -> None:
    folder, _, _ = campaign
    monkeypatch.setattr(numerical_campaign, "work_through", one_after_another)
    wanted = settings(with_gas=True, only="*")
    made = make_numerical_campaign(tmp_path / "gas", wanted, runs=SHORT)
    assert (made.n_made, made.n_kept) == (3, 0)
    run = read_recording(tmp_path / "gas" / "shaker" / "fast.nc")
    assert (run.attrs["liquid"], run.attrs["cells_per_height"]) == ("two_phase_tank", 8)
    manifest = json.loads(made.manifest.read_text())
    assert "--liquid two_phase -o raw_data/two_phase_tank --layers 8" in manifest["command"]
    # a frozen liquid is the same by either method, a computed one is not
    assert contents(tmp_path / "gas")["shaker/frozen.nc"] == contents(folder)["shaker/frozen.nc"]
    assert contents(tmp_path / "gas")["shaker/fast.nc"] != contents(folder)["shaker/fast.nc"]


def test_two_processes_make_the_same_bytes(campaign, tmp_path: Path) -> None:
    folder, _, _ = campaign
    make_numerical_campaign(tmp_path / "tank", settings(n_workers=2), runs=SHORT)
    assert contents(tmp_path / "tank") == contents(folder)
    assert not (tmp_path / "tank" / ".checkpoints").exists()


def test_what_is_good_is_kept_and_the_rest_is_made_again(campaign, monkeypatch) -> None:
    """A changed file, a missing file, another setting: each is made again, and nothing else."""
    folder, _, _ = campaign
    before, asked = contents(folder), []

    def not_made(tasks, executor, *, progressed, finished) -> None:
        asked.append([task.name for task in tasks])

    monkeypatch.setattr(numerical_campaign, "work_through", not_made)
    frozen = folder / "shaker" / "frozen.nc"
    whole = frozen.read_bytes()
    summary = make_numerical_campaign(folder, COARSE, runs=SHORT)
    assert (summary.n_made, summary.n_kept) == (0, 3)
    frozen.write_bytes(whole[:-1])
    make_numerical_campaign(folder, COARSE, runs=SHORT)
    frozen.unlink()
    make_numerical_campaign(folder, COARSE, runs=SHORT)
    frozen.write_bytes(whole)
    again = NumericalRun("shaker/fast", RIG, 7, {**SHORT[1].settings, "repeat": 2})
    make_numerical_campaign(folder, COARSE, runs=[again, *SHORT[2:]])
    make_numerical_campaign(folder, settings(layers_per_height=9), runs=SHORT)
    make_numerical_campaign(folder, settings(only="shaker/f*", seed=3), runs=SHORT)
    assert asked == [
        [],
        ["shaker/frozen"],
        ["shaker/frozen"],
        ["shaker/fast"],
        ["shaker/fast"],
        ["shaker/fast", "shaker/frozen"],
    ]
    make_numerical_campaign(folder, COARSE, runs=SHORT)
    assert asked[-1] == []
    assert contents(folder) == before


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="signals")
def test_killed_in_the_middle_it_goes_on_to_the_same_bytes(campaign, tmp_path: Path) -> None:
    folder, _, _ = campaign
    script = tmp_path / "campaign.py"
    script.write_text(
        "import os, signal, sys\n"
        "import test_virtual_numerical_campaign as here\n"
        "from acquisition.virtual_laboratory.numerical_campaign import make_numerical_campaign\n"
        "def progressed(share):\n"
        "    if share > 0.2:\n"
        "        os.kill(os.getpid(), signal.SIGKILL)\n"
        "if __name__ == '__main__':\n"
        "    make_numerical_campaign(sys.argv[1], here.COARSE, runs=here.SHORT, progressed=progressed)\n",
        encoding="utf-8",
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path])}
    killed = subprocess.run(
        [sys.executable, str(script), str(tmp_path / "tank")], env=environment, timeout=300, check=False
    )
    assert killed.returncode == -9
    make_numerical_campaign(tmp_path / "tank", settings(n_workers=2), runs=SHORT)
    assert contents(tmp_path / "tank") == contents(folder)


def test_a_second_campaign_in_the_same_place_is_refused(campaign, monkeypatch) -> None:
    folder, _, _ = campaign

    def meanwhile(*arguments, **options) -> None:
        with pytest.raises(InputError, match="another campaign at work"):
            make_numerical_campaign(folder, COARSE, runs=SHORT)

    monkeypatch.setattr(numerical_campaign, "work_through", meanwhile)
    make_numerical_campaign(folder, COARSE, runs=SHORT)


def test_a_damaged_checkpoint_does_not_stop_a_campaign(tmp_path: Path) -> None:
    task = campaign_tasks(tmp_path, COARSE, SHORT[:1])[0]
    task.checkpoint.parent.mkdir()
    task.checkpoint.write_bytes(b"nonsense")
    numerical_campaign.record(task, lambda share: None)
    assert task.recording.exists()
    assert not task.checkpoint.exists()


@pytest.mark.parametrize(
    ("changed", "match"),
    [
        ({"seed": -1}, "seed of the campaign"),
        ({"only": "nothing*"}, r"--only: got 'nothing\*'; allowed: a pattern of names such as shaker/"),
        ({"layers_per_height": 5}, "layers of particles"),
        ({"n_workers": 0}, "--workers"),
    ],
)
def test_impossible_campaigns_are_refused_at_once(tmp_path: Path, changed, match) -> None:
    with pytest.raises(InputError, match=match):
        make_numerical_campaign(tmp_path / "tank", settings(**changed), runs=SHORT)


@pytest.mark.parametrize(("fill_level", "layers"), [("0.25", 24), ("0.50", 16), ("0.75", 16)])
def test_a_shallow_liquid_is_computed_more_finely(fill_level: str, layers: int, tmp_path: Path) -> None:
    """3/8 of 16 layers are 6; a quarter of the tank has them at h/24."""
    made = []

    def worker(tasks, executor, *, progressed, finished) -> None:
        made.extend(task.arguments["layers_per_height"] for task in tasks)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(numerical_campaign, "work_through", worker)
        make_numerical_campaign(tmp_path, CampaignSettings(only=f"shaker/fill_{fill_level}_sweep_3.00g"))
    assert made == [layers]

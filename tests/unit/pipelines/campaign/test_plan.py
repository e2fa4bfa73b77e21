"""Plans: what may stand in them, and what is refused in one line."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipelines.campaign.plan import BeamPart, SweepPart, plan_from_document, read_plan
from pipelines.campaign.recording_tasks import matching, name_of
from sloshlab.errors import InputError


def test_folders_are_seen_from_the_plan_and_numbers_have_defaults(tmp_path):
    (tmp_path / "plan.toml").write_text(
        'time_limit_s = 60\n[[part]]\nkind = "sweep"\nfolder = "runs"\nm = 12\n'
        '[[part]]\nkind = "sdof"\nname = "guided"\nfolder = "/elsewhere"\n[slurm]\nqueue = "night"\n'
    )
    plan = read_plan(tmp_path / "plan.toml")
    sweep, beam = plan.parts
    assert isinstance(sweep, SweepPart)
    assert isinstance(beam, BeamPart)
    assert (sweep.folder, beam.folder) == (tmp_path / "runs", Path("/elsewhere"))
    assert (sweep.p, sweep.m, sweep.recordings, beam.cycles) == (6, 12, ("*.nc",), 4)
    assert (plan.time_limit_s, plan.retries, plan.slurm.queue) == (60, 2, "night")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"plan .*: part: got nothing"),
        ("part = []", "at least 1 item"),
        ('[[part]]\nkind = "swep"\nfolder = "x"', r"part\.0: got .*'sweep', 'beam', 'sdof', 'train', 'diagnose'"),
        ('[[part]]\nkind = "sweep"\nfolder = "x"\nspacing = 3', "an unknown key; allowed: folder, name, kind"),
        ('[[part]]\nkind = "sweep"\nfolder = "x"\nboundary = "law"', "remedy: did you mean 'boundaries'"),
        ('retry = 3\n[[part]]\nkind = "sweep"\nfolder = "x"', "did you mean 'retries'"),
        ('[[part]]\nkind = "sweep"\nfolder = "x"\n[slurm]\nqeue = "a"', r"slurm\.qeue: .*did you mean 'queue'"),
        ('[[part]]\nkind = "sweep"\nfolder = "x"\np = 0', r"part\.0\.sweep\.p: got 0; allowed: .*greater than"),
        ('[[part]]\nkind = "sweep"\nfolder = "x"\nname = "a/b"', "name: got 'a/b'"),
        ('time_limit_s = nan\n[[part]]\nkind = "sweep"\nfolder = "x"', "time_limit_s: got nan"),
        ('[[part]]\nkind = "train"\nfolder = "x"\nvalidation = "v.nc"', "training, validation and rig together"),
        ('[[part]]\nkind = "beam"\nfolder = "x"\ncycles = 1', "cycles: got 1"),
        ("[[part]", "text that is not TOML"),
    ],
)
def test_what_is_wrong_with_a_plan_is_one_line(tmp_path, text, message):
    (tmp_path / "plan.toml").write_text(text)
    with pytest.raises(InputError, match=message) as refusal:
        read_plan(tmp_path / "plan.toml")
    assert "\n" not in str(refusal.value)


def test_a_plan_that_is_not_there_is_said_with_a_remedy(tmp_path):
    with pytest.raises(InputError, match=r"plan .*nowhere\.toml: got No such file .*docs/campaigns\.md"):
        read_plan(tmp_path / "nowhere.toml")


def test_a_plan_of_too_many_parts_is_refused():
    part = {"kind": "sweep", "folder": "x"}
    with pytest.raises(InputError, match="at most 1000 items"):
        plan_from_document({"part": [part] * 1001})


def test_files_are_found_by_patterns_and_results_are_none(tmp_path):
    for name in ("b.nc", "a.nc", "below/c.nc", "store/results/a/windows.nc", "rig.toml"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    store = tmp_path / "store"
    found = matching(tmp_path, ["**/*.nc"], store)
    assert [path.relative_to(tmp_path).as_posix() for path in found] == ["a.nc", "b.nc", "below/c.nc"]
    assert matching(tmp_path, ["b.nc", "*.nc"], store) == [tmp_path / "a.nc", tmp_path / "b.nc"]
    assert matching(tmp_path, ["*.csv"], store) == []
    with pytest.raises(InputError, match=r"x\.nc: got no such file"):
        matching(tmp_path, ["x.nc"], store)
    for outside in ("../*.nc", "/etc/*"):
        with pytest.raises(InputError, match="a place elsewhere"):
            matching(tmp_path, [outside], store)
    with pytest.raises(InputError, match="no such folder"):
        matching(tmp_path / "nowhere", ["*.nc"], store)
    assert name_of("", Path("below/c.nc")) == "below__c"

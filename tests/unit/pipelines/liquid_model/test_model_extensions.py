"""`sloshlab train` with memory and an ensemble, on short runs of the law rig."""

from pathlib import Path

import numpy as np
import pytest

from acquisition.virtual_laboratory.campaign import rig_text
from acquisition.virtual_laboratory.shaker_run import virtual_shaker_run, write_virtual_run
from pipelines.liquid_model.model_settings import ModelSettings
from pipelines.liquid_model.train import train_and_report
from pipelines.liquid_model.training_runs import RunFiles
from sloshlab.errors import InputError
from sloshlab.reduced_order_model.ensemble_storage import load_ensemble
from sloshlab.reduced_order_model.storage import load_model
from sloshlab.reduced_order_model.training import TrainingSettings
from sloshlab.rig import Rig

SETTINGS = TrainingSettings(n_epochs=3)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    made = tmp_path_factory.mktemp("runs")
    (made / "rig.toml").write_text(rig_text(0.5), encoding="utf-8")
    rig = Rig.from_toml(made / "rig.toml")
    plans = {
        "training": {"experiment": "shaker_vfa", "duration_s": 40.0, "acceleration_g": 5.0},
        "validation": {"experiment": "shaker_vfa", "duration_s": 30.0, "acceleration_g": 5.0, "seed": 1},
        "start": {"experiment": "sudden_start", "duration_s": 5.0, "acceleration_g": 3.0, "start_hz": 11.0},
        "empty": {"configuration": "empty", "duration_s": 5.0},
    }
    for name, plan in plans.items():
        write_virtual_run(virtual_shaker_run(rig, **plan), made / f"{name}.nc")
    return made


def trained(folder: Path, output: Path, **more):
    files = RunFiles.of(
        [folder / "training.nc", folder / "validation.nc"], [folder / "empty.nc"], folder / "rig.toml"
    )
    wanted = ModelSettings("nfir", 6, 0, 4, rate_hz=128.0, **more)
    return train_and_report(files, [], wanted, SETTINGS, output, command=None)


def test_memory_and_ensemble_are_written(folder, tmp_path):
    said = trained(folder, tmp_path / "ROM.nc", memory_s=0.3, sudden_starts=(folder / "start.nc",), n_members=2)
    model, ensemble = load_model(tmp_path / "ROM.nc"), load_ensemble(tmp_path / "ROM_ensemble.nc")
    assert model.agitation is not None
    assert model.agitation.time_constants_s == (0.3,)
    assert model.break_up is not None
    assert model.facts["sudden_starts"] == ["start.nc"]
    assert len(ensemble.members) == 2
    assert ensemble.members[0].break_up is None
    assert ensemble.facts["training"] == model.facts["training"]
    assert [line.split(":")[0] for line in said["lines"][-2:]] == ["break-up", "ensemble"]
    velocity = np.sin(np.arange(1000) / 2.0)
    assert np.isfinite(ensemble.predicted_range(velocity).upper[6:]).all()


def test_without_them_nothing_changes(folder, tmp_path):
    said = trained(folder, tmp_path / "ROM.nc")
    model = load_model(tmp_path / "ROM.nc")
    assert (model.agitation, model.break_up) == (None, None)
    assert [path.name for path in tmp_path.iterdir()] == ["ROM.nc"]
    assert not [line for line in said["lines"] if line.startswith(("break-up", "ensemble"))]


def test_a_training_run_is_no_sudden_start(folder, tmp_path):
    with pytest.raises(InputError, match=r"training\.nc"):
        trained(folder, tmp_path / "ROM.nc", sudden_starts=(folder / "training.nc",))


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"n_members": 1}, "--ensemble"),
        ({"memory_s": 0.0}, "memory"),
        ({"structure": "noe", "memory_s": 0.3}, "--model nfir"),
    ],
)
def test_what_cannot_be_is_refused(more, message):
    with pytest.raises(InputError, match=message):
        ModelSettings(**{"structure": "nfir", "delays": 6, "output_delays": 1, "neurons": 4, **more}).checked()

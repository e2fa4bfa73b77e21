"""Cases of demonstrations: what is hidden is what was asked for, drawn from the seed, and sealed."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from sealed_trial.composition import SINGLES
from sealed_trial.demonstrations import (
    DEMONSTRATIONS,
    DOMAIN,
    demonstration_entropy,
    drawn_demonstration,
    noise_generator,
)
from sealed_trial.sealing.sealed_case import (
    CASE,
    COMMITMENT,
    LOCKED,
    key_of,
    opened_truth,
    read_published,
    seal_case,
)
from sealed_trial.sealing.trial_folder import DOMAINS
from sloshlab.errors import InputError


def sealed(folder: Path, name: str = "nothing-hidden", seed: int = 3) -> bytes:
    """Seal a case; return its key."""
    key = key_of(DOMAIN, name, seed)
    words = demonstration_entropy(name, seed)
    seal_case(folder, name, drawn_demonstration(name, seed), key, noise_generator(words))
    return key


def test_five_kinds_are_shown_and_every_effect_is_one_of_the_vocabulary() -> None:
    kinds = {name: known.kind for name, known in DEMONSTRATIONS.items()}
    assert list(kinds.values()).count("nothing") == 1
    assert list(kinds.values()).count("pair") == 1
    assert len(kinds) >= 5
    known = {(effect.block, effect.name) for effect in SINGLES}
    assert {effect for each in DEMONSTRATIONS.values() for effect in each.effects} <= known


@pytest.mark.slow
@pytest.mark.parametrize("name", DEMONSTRATIONS)
def test_what_is_hidden_is_what_the_name_says(name: str) -> None:
    truth = drawn_demonstration(name, 5).truth
    assert {(effect["block"], effect["name"]) for effect in truth.effects} == set(DEMONSTRATIONS[name].effects)
    # strong enough to be seen, as in a trial
    assert all(effect["strength"] >= 3.0 for effect in truth.effects)


def test_a_seed_gives_the_same_bytes_again_and_another_seed_others(tmp_path: Path) -> None:
    for place, seed in (("a", 3), ("b", 3), ("c", 4)):
        sealed(tmp_path / place, seed=seed)
    files = {place: read_published(tmp_path / place).files for place in "abc"}
    assert files["a"] == files["b"]
    assert files["a"]["recordings/run_01.nc"] != files["c"]["recordings/run_01.nc"]
    assert (tmp_path / "a" / LOCKED).read_bytes() == (tmp_path / "b" / LOCKED).read_bytes()


def test_demonstrations_share_no_random_number_with_trials() -> None:
    assert DOMAIN not in DOMAINS.values()
    words = {tuple(demonstration_entropy(name, seed)) for name in DEMONSTRATIONS for seed in range(3)}
    assert len(words) == 3 * len(DEMONSTRATIONS)


def test_the_case_tells_nothing_of_the_truth_but_by_its_signals(tmp_path: Path) -> None:
    sealed(tmp_path / "one")
    files = sorted(
        path.relative_to(tmp_path / "one" / CASE).as_posix() for path in (tmp_path / "one" / CASE).rglob("*.*")
    )
    assert files == [
        "recordings/run_01.nc",
        "recordings/run_02.nc",
        "recordings/run_03.nc",
        "recordings/run_04.nc",
        "rig.toml",
    ]
    with xr.open_dataset(tmp_path / "one" / CASE / "recordings" / "run_01.nc") as recording:
        words = json.dumps({name: str(value) for name, value in recording.attrs.items()})
        assert recording.sizes["time"] == 5 * 256 + 1
    text = (tmp_path / "one" / CASE / "rig.toml").read_text() + words
    assert not [effect.name for effect in SINGLES if effect.name in text]
    assert "nothing" not in text


def test_the_commitment_is_the_salted_hash_of_the_truth(tmp_path: Path) -> None:
    key = sealed(tmp_path / "one")
    published = read_published(tmp_path / "one")
    truth = opened_truth(tmp_path / "one", published, key)
    # SHA-256(salt ‖ truth as JSON with sorted keys), the salt HMAC-SHA-256 of the name under the key (docs)
    import hmac

    salt = hmac.new(key, b"salt of nothing-hidden", hashlib.sha256).digest()
    text = json.dumps(truth, sort_keys=True, separators=(",", ":")).encode()
    assert published.commitment == hashlib.sha256(salt + text).hexdigest()
    assert truth["kind"] == "nothing"
    assert b"nothing" not in (tmp_path / "one" / LOCKED).read_bytes()


def test_a_changed_recording_another_key_and_another_truth_are_refused(tmp_path: Path) -> None:
    key, other = sealed(tmp_path / "one"), sealed(tmp_path / "two", seed=4)
    published = read_published(tmp_path / "one")
    with pytest.raises(InputError, match="does not open"):
        opened_truth(tmp_path / "one", published, other)
    with pytest.raises(InputError, match="not the truth committed to"):
        opened_truth(tmp_path / "one", read_published(tmp_path / "two"), key)
    with (tmp_path / "one" / CASE / "rig.toml").open("a") as rig:
        rig.write("# a word\n")
    with pytest.raises(InputError, match=r"rig\.toml: got not what was published"):
        read_published(tmp_path / "one")


def test_a_folder_that_is_no_sealed_case_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="allowed: a sealed case"):
        read_published(tmp_path)
    (tmp_path / COMMITMENT).write_text("{}")
    with pytest.raises(InputError, match="an untouched file"):
        read_published(tmp_path)


def test_noise_is_drawn_apart_from_what_is_hidden() -> None:
    words = demonstration_entropy("friction", 1)
    first = noise_generator(words).standard_normal(3)
    assert not np.allclose(first, np.random.default_rng(words).standard_normal(3))

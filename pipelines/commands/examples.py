"""What a person types: examples of every command, shown at the end of its help as they stand here."""

from __future__ import annotations

from typing import Final

EXAMPLES: Final[dict[str, tuple[str, ...]]] = {
    "": (
        "sloshlab demo",
        "sloshlab analyse run_*.nc --rig rig.toml -o results",
        "sloshlab diagnose CASE",
        "sloshlab --install-completion",
    ),
    "demo": (
        "sloshlab demo",
        "sloshlab demo late-sensor --seed 3 --no-open -o results/late_sensor",
        "sloshlab demo --list",
    ),
    "import": (
        "sloshlab import --describe bench.csv",
        "sloshlab import --describe bench.csv --starter bench.toml",
        "sloshlab import bench.csv --map bench.toml --rig rig.toml -o bench.nc",
        "sloshlab import first.csv second.csv --map bench.toml -o bench.nc --overwrite",
    ),
    "check": (
        "sloshlab check sweep_3g.nc",
        "sloshlab check run_*.nc --json",
    ),
    "analyse": ("sloshlab analyse run_*.nc --rig rig.toml -o results",),
    "shaker": (
        "sloshlab shaker sweep_*.nc empty.nc --rig rig.toml -o results",
        "sloshlab shaker sweep_*.nc --rig rig_half.toml --rig rig_full.toml -o results --p 4 --m 8",
        "sloshlab shaker sweep_3g.nc --rig rig.toml -o results --allow-incomplete --no-report",
    ),
    "work": (
        "sloshlab work sweep.nc --force force_1 --acceleration acceleration_1 -o results",
        "sloshlab work sweep.nc --force force_1 --displacement displacement_1 -o results --p 4 --m 8",
    ),
    "beam": (
        "sloshlab beam frozen.nc sloshing_*.nc --rig rig_beam.toml -o results",
        "sloshlab beam sloshing_*.nc --rig rig_beam.toml --rom rom.nc --ball ball.toml -o results",
    ),
    "ball": (
        "sloshlab ball decay_1.nc decay_2.nc --rig rig.toml -o results",
        "sloshlab ball sweep_*.nc --rig rig.toml -o results --omega-bar 4",
    ),
    "ball-network": ("sloshlab ball-network decay_*.nc --rig rig.toml --ball ball.toml -o results",),
    "train": (
        "sloshlab train vfa_1.nc vfa_2.nc valid.nc --rig rig.toml -o rom.nc",
        "sloshlab train vfa_*.nc valid.nc --rig rig.toml --still empty.nc --test sweep_3g.nc -o rom.nc",
        "sloshlab train low_*.nc high_*.nc --rig rig_low.toml --rig rig_high.toml -o rom.nc",
    ),
    "validate": ("sloshlab validate rom.nc unseen.nc --rig rig.toml -o results",),
    "study": ("sloshlab study vfa_1.nc vfa_2.nc valid.nc --rig rig.toml -o study --cases source --workers 2",),
    "simulate": (
        "sloshlab simulate --rig rig.toml --input sweep_3g.nc -o simulated.nc",
        "sloshlab simulate --rig rig.toml --input sweep_3g.nc --block tank --save-twin twin.toml -o simulated.nc",
    ),
    "wing": (
        "sloshlab wing wing.toml --rom ROM.nc -o results",
        "sloshlab wing wing.toml --rom ROM.nc --maps maps.nc --match-fold 323 -o results",
    ),
    "flutter": (
        "sloshlab flutter wing.toml --from 60 --to 180 -o results",
        "sloshlab flutter aircraft.toml --models frozen,lateral --cache forces -o results",
    ),
    "aircraft": (
        "sloshlab aircraft aircraft.toml --rom rom.nc --cache forces -o results",
        "sloshlab aircraft aircraft.toml --rom rom.nc --gust-speed 31 --gust 2 -o results",
        "sloshlab aircraft two_tanks.toml --scan places.toml -o results",
    ),
    "case new": ("sloshlab case new CASE --rig rig.toml --recordings run_1.nc run_2.nc",),
    "case check": ("sloshlab case check CASE",),
    "diagnose": (
        "sloshlab diagnose CASE",
        "sloshlab diagnose CASE -o results --quiet",
        "sloshlab diagnose CASE --effects my_effect.py",
    ),
    "benchmark": (
        "sloshlab benchmark --list",
        "sloshlab benchmark silverbox emps --data published -o results",
    ),
    "campaign": (
        "sloshlab campaign recordings -o store",
        "sloshlab campaign plan.toml -o store --scheduler tcp://127.0.0.1:8786",
        "sloshlab campaign cases --kind diagnose -o store --workers 2 --time-limit 600",
    ),
    "trial seal": ("sloshlab trial seal -o trial --seed 1 --key trial.key",),
    "trial commit": ("sloshlab trial commit CHALLENGE truths.toml -o kept --key trial.key",),
    "trial check": ("sloshlab trial check CHALLENGE",),
    "trial run": (
        "sloshlab trial run trial",
        "sloshlab trial run CHALLENGE --trust-code",
    ),
    "trial score": (
        "sloshlab trial score trial --key trial.key -o scores",
        "sloshlab trial score CHALLENGE --truths kept --key trial.key -o scores",
    ),
    "trial compare": ("sloshlab trial compare trial/diagnoses trial/diagnoses_perturbed_1",),
    "virtual": (
        "sloshlab virtual shaker_sweep --rig rig.toml --duration-s 6 -o sweep.nc",
        "sloshlab virtual shaker_sweep --rig rig.toml --levels 3,1.5,0.5 --repeats 2 -o sweeps",
        "sloshlab virtual shaker_vfa --rig rig.toml --liquid numerical --layers 16 -o vfa.nc",
        "sloshlab virtual flight --model wing.toml --hide lift_gain=0.2 -o flight",
        "sloshlab virtual flight --model wing.toml --cases 60 --truths kept/truths.json -o flights",
    ),
    "record": (
        "sloshlab record --source serial:/dev/ttyUSB0 --rig rig.toml --duration 240 -o run.nc",
        'sloshlab record --source serial:/dev/ttyUSB0 --source "can:slcan?channel=/dev/ttyACM0&dbc=rig.dbc"'
        " --rig rig.toml -o run.nc",
    ),
    "recover": ("sloshlab recover run.journal -o run.nc",),
    "replay": (
        "sloshlab replay run.nc --as serial:socket://127.0.0.1:7000",
        'sloshlab replay "virtual:shaker_sweep?rig=rig.toml" --as serial:device --speed max',
    ),
    "info": (
        "sloshlab info",
        "sloshlab info --json",
    ),
}
"""By command as it is typed; the empty one is the program itself."""

GROUPS: Final[dict[str, tuple[str, ...]]] = {
    "case": ("case new", "case check"),
    "trial": ("trial seal", "trial run", "trial score"),
}
"""Commands that have steps show the examples of these."""


def examples_of(command: str) -> tuple[str, ...]:
    """Examples of a command.

    Examples
    --------
    >>> examples_of("case check")
    ('sloshlab case check CASE',)
    >>> len(examples_of("case"))
    2
    """
    if command in GROUPS:
        return tuple(example for step in GROUPS[command] for example in EXAMPLES[step])
    return EXAMPLES.get(command, ())

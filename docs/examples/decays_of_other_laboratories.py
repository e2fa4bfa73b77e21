"""Free decays that other laboratories recorded, read three ways: the tables of the worked example in beam.md.

``python docs/examples/decays_of_other_laboratories.py FOLDER`` prints them. It reads
``FOLDER/sloshing_decay/xData.mat`` and ``FOLDER/hammer/measurements_1.npy`` … ``_3.npy``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from scipy.io import loadmat

from sloshlab.modal.free_decay import FreeDecay, analyse_free_decay
from sloshlab.modal.instantaneous_damping import InstantaneousDamping
from sloshlab.modal.modal_fit import modal_fit
from sloshlab.modal.pooled_decays import pooled_damping

PARTS_S = ((2.0, 8.0), (25.0, 42.0))
SHOWN_PERCENT = (4.2, 2.2, 1.2, 0.52, 0.21)


def sloshing_decays(folder: Path) -> list[FreeDecay]:
    """Decays of the centre of mass of a liquid [% of the tank's length] after the tank is stopped."""
    rows = loadmat(folder / "sloshing_decay" / "xData.mat")["xData"]
    return [
        analyse_free_decay(motion.ravel(), 1 / np.median(np.diff(time.ravel())), motion="displacement")
        for time, motion in rows
    ]


def means_of_part(
    instantaneous_damping: InstantaneousDamping, first_s: float, last_s: float
) -> tuple[float, float]:
    """Mean frequency [Hz] and damping ratio over a part of the record."""
    part = (
        instantaneous_damping.used
        & (instantaneous_damping.time_s >= first_s)
        & (instantaneous_damping.time_s < last_s)
    )
    return float(instantaneous_damping.frequency_hz[part].mean()), float(
        instantaneous_damping.damping_ratio[part].mean()
    )


def rows_of_parts(decays: list[FreeDecay]) -> list[str]:
    """One row per record and part, by the three methods."""
    rows = []
    for number, decay in enumerate(decays, start=1):
        for first, last in PARTS_S:
            means = [means_of_part(reading, first, last) for reading in decay.readings]
            frequencies = ", ".join(f"{frequency:.3f}" for frequency, _ in means)
            damping = ", ".join(f"{100 * ratio:.2f}" for _, ratio in means)
            rows.append(f"| {number} | {first:.0f} … {last:.0f} s | {frequencies} | {damping} |")
    return rows


def rows_over_amplitude(decays: list[FreeDecay]) -> list[str]:
    """Mean over the records with its 90 % interval, at some amplitudes [% of the tank's length]."""
    pooled = pooled_damping([decay.local_sine_fit for decay in decays])
    amplitude = pooled.acceleration_amplitude_m_per_s2 / (2 * np.pi * pooled.frequency_hz) ** 2
    rows = []
    for wanted in SHOWN_PERCENT:
        at = int(np.argmin(np.abs(np.log(amplitude / wanted))))
        low, high = 100 * pooled.damping_ratio_interval[:, at]
        rows.append(
            f"| {amplitude[at]:.2g} | {pooled.frequency_hz[at]:.3f} | {100 * pooled.damping_ratio[at]:.2f} "
            f"({low:.2f} … {high:.2f}) |"
        )
    return rows


def hammer_modes(folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Frequency [Hz] and damping ratio of the largest mode after each of three blows."""
    found = []
    for number in (1, 2, 3):
        time, force, response = np.load(folder / "hammer" / f"measurements_{number}.npy", allow_pickle=False)
        rate = (time.size - 1) / (time[-1] - time[0])
        lines = np.fft.rfftfreq(time.size, 1 / rate)
        ratio = np.fft.rfft(response) / np.fft.rfft(force)
        near = (lines > 3500) & (lines < 3850)
        fit = modal_fit(lines[near], ratio[near], n_modes=2, n_extra_pairs=1)
        largest = int(np.abs(fit.residues[0]).argmax())
        found.append((fit.frequency_hz[largest], fit.damping_ratio[largest]))
    frequency, damping = np.array(found).T
    return frequency, damping


def sentence_of_hammer(folder: Path) -> str:
    """Frequencies and damping ratios of three hammer blows in words."""
    frequency, damping = hammer_modes(folder)
    return (
        f"{frequency[0]:.2f}, {frequency[1]:.2f} and {frequency[2]:.2f} Hz with ζ = {100 * damping[0]:.4f}, "
        f"{100 * damping[1]:.4f} and {100 * damping[2]:.4f} %"
    )


def main() -> int:
    """Print the tables of the folder named on the command line."""
    folder = Path(sys.argv[1])
    decays = sloshing_decays(folder)
    for row in [*rows_of_parts(decays), "", *rows_over_amplitude(decays), "", sentence_of_hammer(folder)]:
        print(row)  # noqa: T201
    return 0


if __name__ == "__main__":
    sys.exit(main())

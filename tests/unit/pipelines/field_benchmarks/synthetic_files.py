"""Files in the layout of the published ones, computed by SciPy's integrators and filters: no code of the twins."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import signal
from scipy.integrate import solve_ivp
from scipy.io import savemat

FloatArray = NDArray[np.float64]
TANKS = {"pump": 0.052, "upper_outlet": 0.055, "upper_to_lower": 0.051, "lower_outlet": 0.048}
UPPER_BRIM_V, LOWER_BRIM_V, CAUGHT = 9.0, 10.0, 0.4
PERIOD_S = 4.0
DIODE_ONSET_V, DIODE_LOSS, DIODE_KNEE_V = 0.35, 0.45, 0.05
CIRCUIT_RATE_HZ = 51_200.0
OVERSAMPLING = 8


def multisine(n: int, factor: int, lines: range, seed: int) -> FloatArray:
    """Random-phase multisine of unit RMS, `factor` values per sample."""
    spectrum = np.zeros(n * factor // 2 + 1, complex)
    spectrum[list(lines)] = np.exp(2j * np.pi * np.random.default_rng(seed).uniform(size=len(lines)))
    values = np.fft.irfft(spectrum, n * factor)
    return np.asarray(values / values.std())


def tank_levels(pump: FloatArray, factor: int, *, overflows: bool, start: tuple[float, float]) -> FloatArray:
    """Levels of the upper and the lower tank [V]; what is above a brim spills at half of it per second."""

    def rates(time: float, level: FloatArray) -> list[float]:
        voltage = np.interp(time, np.arange(pump.size) * PERIOD_S / factor, pump)
        upper, lower = np.sqrt(np.maximum(level, 0.0))
        spilt = 0.5 * max(level[0] - UPPER_BRIM_V, 0.0) if overflows else 0.0
        lost = 0.5 * max(level[1] - LOWER_BRIM_V, 0.0) if overflows else 0.0
        above = TANKS["pump"] * voltage - TANKS["upper_outlet"] * upper - spilt
        return [above, TANKS["upper_to_lower"] * upper - TANKS["lower_outlet"] * lower + CAUGHT * spilt - lost]

    times = np.arange(pump.size // factor) * PERIOD_S
    found = solve_ivp(rates, (0.0, times[-1]), start, t_eval=times, rtol=1e-8, atol=1e-10, max_step=PERIOD_S)
    return np.asarray(found.y)


def write_tanks(folder: Path, *, overflows: bool, noise_v: float = 0.0) -> Path:
    """``dataBenchmark.mat`` with levels that nothing but the pump's voltage explains."""
    content: dict[str, object] = {"Ts": PERIOD_S}
    mean, rms = (3.0, 0.8) if overflows else (2.2, 0.5)
    for seed, suffix in enumerate(("Est", "Val")):
        pump = mean + rms * multisine(1024, 4, range(1, 55), seed)
        levels = tank_levels(pump, 4, overflows=overflows, start=(6.0, 5.0))
        noise = noise_v * np.random.default_rng(seed).standard_normal(1024)
        content |= {f"u{suffix}": pump[::4, None], f"y{suffix}": (levels[1] + noise)[:, None]}
    path = folder / "dataBenchmark.mat"
    savemat(path, content)
    return path


def diode(voltage: FloatArray) -> FloatArray:
    """What passes: all of it below the onset, a share above."""
    over = (voltage - DIODE_ONSET_V) / DIODE_KNEE_V
    return np.asarray(voltage - DIODE_LOSS * DIODE_KNEE_V * np.logaddexp(0.0, over))


def circuit_output(voltage: FloatArray) -> FloatArray:
    """Analogue Chebyshev filters of the documented designs about the diode, at the finer rate."""
    time = np.arange(voltage.size) / (CIRCUIT_RATE_HZ * OVERSAMPLING)
    first = signal.cheby1(3, 0.5, 2 * np.pi * 4400, analog=True, output="ba")
    second = signal.cheby2(3, 40, 2 * np.pi * 5000, analog=True, output="ba")
    between = diode(signal.lsim(first, voltage, time)[1])
    return np.asarray(signal.lsim(second, between, time)[1])


def circuit_voltages(n_samples: int, n_silent: int) -> tuple[FloatArray, FloatArray]:
    """Input and output [V]: silence, a noise below 10 kHz as in the published record, and silence."""
    n_driven = n_samples - 2 * n_silent
    driven = 0.64 * multisine(n_driven, OVERSAMPLING, range(1, round(1e4 / CIRCUIT_RATE_HZ * n_driven)), 7)
    voltage = np.zeros(n_samples * OVERSAMPLING)
    voltage[n_silent * OVERSAMPLING : (n_silent + n_driven) * OVERSAMPLING] = driven
    return voltage[::OVERSAMPLING], circuit_output(voltage)[::OVERSAMPLING]


def write_circuit(folder: Path, noise_v: float) -> Path:
    """``WienerHammerBenchMark.mat`` of the published length."""
    voltage, output = circuit_voltages(188_000, 2_000)
    output = output + noise_v * np.random.default_rng(8).standard_normal(output.size)
    path = folder / "WienerHammerBenchMark.mat"
    savemat(path, {"uBenchMark": voltage[:, None], "yBenchMark": output[:, None], "fs": CIRCUIT_RATE_HZ})
    return path


def write_ramps(folder: Path) -> None:
    """Files whose samples are their own numbers, outputs negative: a split can be read off its first and last."""
    columns = {
        "SNLS80mV.mat": (("V1", "V2"), 131_072, {}),
        "DATA_EMPS.mat": (("vir", "qm"), 24_841, {}),
        "DATA_EMPS_PULSES.mat": (("vir", "qm"), 24_800, {}),
        "WienerHammerBenchMark.mat": (("uBenchMark", "yBenchMark"), 188_000, {"fs": CIRCUIT_RATE_HZ}),
    }
    for name, ((driving, output), n, scalars) in columns.items():
        number = np.arange(n, dtype=float)
        content = {driving: number, output: -number, **scalars}
        if name.startswith("DATA_EMPS"):
            content |= {"t": number * 1e-3, "qg": number}
        # of the published shapes: the Silverbox has rows, the others columns
        savemat(folder / name, content, oned_as="row" if name.startswith("SNLS") else "column")
    number = np.arange(1024, dtype=float)
    tanks = {"uEst": number, "yEst": -number, "uVal": number + 5000, "yVal": -number - 5000, "Ts": PERIOD_S}
    savemat(folder / "dataBenchmark.mat", tanks, oned_as="column")

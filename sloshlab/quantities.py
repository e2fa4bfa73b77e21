"""One table of quantities: units, sign and meaning of everything that is written to a result.

Results start from empty attributes and read them here, so that no arithmetic can leave stale units.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import xarray as xr


@dataclass(frozen=True)
class Quantity:
    """Units, long name and mathematical symbol of a result."""

    units: str
    long_name: str
    symbol: str = ""

    @property
    def label(self) -> str:
        """Axis label: symbol or long name with units."""
        units = self.units.replace("kg s-1", "kg/s").replace("m s-2", "m/s²").replace("m s-1", "m/s")
        return f"{self.symbol or self.long_name}" + (f" [{units}]" if units != "1" else "")


QUANTITIES: Final[dict[str, Quantity]] = {
    "run": Quantity("1", "run identifier"),
    "time_s": Quantity("s", "centre of the window, from the trigger", "t"),
    "frequency_hz": Quantity("Hz", "excitation frequency", "f"),
    "amplitude_m": Quantity("m", "displacement amplitude of the fundamental", "u₀"),
    "acceleration_g": Quantity("1", "acceleration amplitude of the fundamental in multiples of 9.81 m/s²", "a₀/g"),
    "n_cycles": Quantity("1", "cycles averaged"),
    "work_j": Quantity("J", "dissipated work per cycle, positive = dissipated", "W"),
    "work_j_std": Quantity("J", "standard deviation of the work from cycle to cycle", "σ(W)"),
    "work_harmonic_j": Quantity("J", "work per cycle of the fundamental, πγΩu₀²", "πγΩu₀²"),
    "phase_error_rad": Quantity("rad", "measured phase minus the phase of the sweep law", "φ − φ_law"),
    "w_bar": Quantity("1", "dissipated work per cycle over m_l u₀² Ω², positive = dissipated", "W̄"),
    "w_bar_std": Quantity("1", "standard error of W̄ from the cycle scatter", "σ(W̄)"),
    "beta": Quantity("1", "sloshing-effective mass fraction; the liquid adds (1 + β) m_l", "β"),
    "beta_std": Quantity("1", "standard error of β from the cycle scatter", "σ(β)"),
    "gamma_kg_per_s": Quantity("kg s-1", "equivalent viscous coefficient, positive = dissipating", "γ"),
    "loss_factor": Quantity("1", "W/(2π · ½ m_l u₀² Ω²)", "η"),
    "omega_bar": Quantity("1", "Ω/√(g/h)", "ω̄"),
    "u_bar": Quantity("1", "u₀/h", "ū"),
    "v_bar": Quantity("1", "Ω u₀/√(g h)", "v̄"),
    "fill_level": Quantity("1", "liquid depth over tank height", "α"),
    "apparent_mass_kg": Quantity("kg", "in-phase force over acceleration", "Re F/ü"),
    "dissipated_mass_kg": Quantity("kg", "dissipated work per cycle over u₀² Ω²", "W/(u₀Ω)²"),
    "dissipated_mass_kg_std": Quantity("kg", "standard error of W/(u₀Ω)² from the cycle scatter", "σ(W/(u₀Ω)²)"),
    "elastic_change_m2": Quantity("m2", "change of u₀² cos²θ from one cycle to the next"),
    "kinetic_change_m2_per_s2": Quantity("m2 s-2", "change of Ω²u₀² sin²θ from one cycle to the next"),
    "chirp_m2_per_s2": Quantity("m2 s-2", "(Ωu₀)² cos 2θ times the change of ln Ω from one cycle to the next"),
    "growth_per_cycle": Quantity("1", "change of ln a₀ from one cycle to the next", "Δ(ln a₀)"),
    "stored_work_j": Quantity("J", "change of elastic energy per cycle, taken out of the work of the force"),
    "harmonic_amplitude_n": Quantity("N", "amplitude of the repeated dynamic force at Ω … 5Ω"),
    "subharmonic_amplitude_n": Quantity("N", "amplitude of the repeated dynamic force at Ω/2 and 3Ω/2"),
    "regime": Quantity("1", "regime of the liquid: quiet, Faraday, impacts, chaotic"),
    "force_ratio": Quantity(
        "1", "RMS of the dynamic force without its inertial part over that of the liquid's inertia"
    ),
    "subharmonic_share": Quantity(
        "1", "share of the power beside the fundamental that repeats every second cycle"
    ),
    "harmonic_share": Quantity("1", "share of the power beside the fundamental at 2Ω … 5Ω"),
    "unrepeated_share": Quantity("1", "share of the power beside the fundamental that does not repeat"),
    "crest_factor": Quantity("1", "largest dynamic force of a cycle over its RMS"),
    "w_bar_over_v_bar": Quantity("1", "W̄ over ω̄ and v̄", "W̄"),
    "beta_over_v_bar": Quantity("1", "β over ω̄ and v̄", "β"),
    "w_bar_left_out_windows_rms": Quantity("1", "RMS error of W̄ at windows left out of the map"),
    "w_bar_left_out_runs_rms": Quantity("1", "RMS error of W̄ at runs left out of the map"),
    "beta_left_out_windows_rms": Quantity("1", "RMS error of β at windows left out of the map"),
    "beta_left_out_runs_rms": Quantity("1", "RMS error of β at runs left out of the map"),
    "work_j_left_out_windows_rms": Quantity("kg", "RMS error of W/(u₀Ω)² at windows left out of the map"),
    "work_j_left_out_runs_rms": Quantity("kg", "RMS error of W/(u₀Ω)² at runs left out of the map"),
    "measured": Quantity("1", "1 inside the measured region of ω̄ and ū"),
    "measured_over_v_bar": Quantity("1", "1 inside the measured region of ω̄ and v̄"),
    "measured_work_j": Quantity("1", "1 inside the measured region of f and u₀"),
    "harmonic": Quantity("1", "multiple of the excitation frequency"),
    "subharmonic": Quantity("1", "multiple of the excitation frequency"),
    "decay_method": Quantity("1", "log decrement, envelope or local sine fit"),
    "decay_time_s": Quantity("s", "middle of a stretch of a free decay, from the first sample", "t"),
    "acceleration_amplitude_m_per_s2": Quantity("m s-2", "amplitude of the acceleration of a mode", "a"),
    "damping_ratio": Quantity("1", "share of critical damping, positive = decaying", "ζ"),
    "damping_ratio_low": Quantity("1", "lower end of the 90 % interval of ζ"),
    "damping_ratio_high": Quantity("1", "upper end of the 90 % interval of ζ"),
    "modal_frequency_hz": Quantity("Hz", "frequency of a decaying motion as seen", "f"),
    "modal_frequency_low_hz": Quantity("Hz", "lower end of the 90 % interval of the frequency"),
    "modal_frequency_high_hz": Quantity("Hz", "upper end of the 90 % interval of the frequency"),
    "trust": Quantity("1", "whether a value may be used, and if not why"),
    "mode": Quantity("1", "name of a mode"),
    "mode_number": Quantity("1", "number of a mode, by frequency", "n"),
    "sensor": Quantity("1", "name of a channel"),
    "sample_time_s": Quantity("s", "time of a sample, from the first", "t"),
    "modal_acceleration_m_per_s2": Quantity("m s-2", "acceleration of a modal coordinate, upward positive", "q̈"),
    "mode_visibility": Quantity("1", "part of a mode that the sensors see and no other mode can make"),
    "modal_condition_number": Quantity("1", "condition number of the mode shapes at the sensors"),
    "configuration": Quantity("1", "what the tank holds: sloshing, frozen or empty liquid"),
    "run_index": Quantity("1", "place of the run along the dimension run, from 0"),
    "root_rms_g": Quantity("1", "RMS of the acceleration of the root in multiples of 9.81 m/s²"),
    "tank_rms_g": Quantity("1", "RMS of the acceleration of the tank in multiples of 9.81 m/s²"),
    "density_frequency_hz": Quantity("Hz", "undamped frequency of mode 1 from the tank's density alone", "f₁"),
    "density_damping_ratio": Quantity("1", "ζ of mode 1 from the tank's density alone", "ζ₁"),
    "modal_residual_m_per_s2": Quantity("m s-2", "RMS of what the modes do not explain at a sensor"),
    "modal_residual_share": Quantity("1", "RMS of what the modes do not explain over that of the sensor"),
    "line_hz": Quantity("Hz", "frequency of a spectral line", "f"),
    "output": Quantity("1", "name of an output channel"),
    "input_psd": Quantity("1", "one-sided power spectral density of the input, unit² per hertz", "S_xx"),
    "output_psd": Quantity("1", "one-sided power spectral density of an output, unit² per hertz", "S_yy"),
    "output_psd_low": Quantity("1", "lower end of the 90 % interval of S_yy"),
    "output_psd_high": Quantity("1", "upper end of the 90 % interval of S_yy"),
    "frf_h1_real": Quantity("1", "real part of H₁ = S_xy/S_xx, output over input"),
    "frf_h1_imag": Quantity("1", "imaginary part of H₁ = S_xy/S_xx, output over input"),
    "frf_h1_radius": Quantity("1", "radius of the circle around H₁ that holds the true value in 90 % of repeats"),
    "frf_h2_real": Quantity("1", "real part of H₂ = S_yy/S_yx, output over input"),
    "frf_h2_imag": Quantity("1", "imaginary part of H₂ = S_yy/S_yx, output over input"),
    "coherence": Quantity("1", "share of an output that is linear in the input", "γ²"),
    "natural_frequency_hz": Quantity("Hz", "undamped natural frequency", "fₙ"),
    "natural_frequency_low_hz": Quantity("Hz", "lower end of the 90 % interval of the natural frequency"),
    "natural_frequency_high_hz": Quantity("Hz", "upper end of the 90 % interval of the natural frequency"),
    "measured_frequency_hz": Quantity("Hz", "measured natural frequency that a model was fitted to"),
    "half_power_width_in_lines": Quantity("1", "2ζf over the distance of spectral lines"),
    "modal_mass_kg": Quantity("kg", "modal mass with ψ = 1 at the tip", "mₙ"),
    "base_factor_kg": Quantity("kg", "force on a mode per base acceleration, negative of it", "∫μψ dx"),
    "mode_shape": Quantity("1", "deflection of a mode, 1 at the tip, upward positive", "ψ"),
    "x_m": Quantity("m", "distance from the root of the beam", "x"),
    "tip_mass_kg": Quantity("kg", "mass at the tip of the beam, liquid frozen"),
    "youngs_modulus_pa": Quantity("Pa", "Young's modulus of the beam", "E"),
    "ball_parameter": Quantity("1", "name of a parameter of a bouncing ball"),
    "ball_value": Quantity("1", "value of a parameter of a bouncing ball, in the unit of its name"),
    "ball_value_low": Quantity("1", "lower end of the 90 % interval of a parameter of a ball, −∞ if it has none"),
    "ball_value_high": Quantity("1", "upper end of the 90 % interval of a parameter of a ball, ∞ if it has none"),
    "ball_profile_ratio": Quantity("1", "growth of the sum of squares at the ends over the predicted one"),
    "ball_damping_ratio": Quantity("1", "share of critical damping with the ball, at the measured amplitudes"),
    "network_damping_ratio": Quantity(
        "1", "share of critical damping with the network, at the measured amplitudes"
    ),
    "network_loss_factor": Quantity("1", "loss factor of the network in steady harmonic motion"),
    "ball_w_bar": Quantity("1", "W̄ of the ball at the frequency and amplitude of each window"),
    "start_number": Quantity("1", "which start of the training, from 0"),
    "epoch_number": Quantity("1", "epoch within a start; 0 is before the first step"),
    "training_rms_n": Quantity("N", "RMS error of the force on the training runs"),
    "validation_rms_n": Quantity("N", "RMS error of the force of a free run on the validation runs"),
    "study_case": Quantity("1", "name of a case: structure, delays, neurons"),
    "structure": Quantity("1", "nfir, without feedback, or noe"),
    "network": Quantity("1", "normalised_rbf, rbf or multilayer"),
    "n_input_delays": Quantity("1", "delays of the velocity"),
    "n_output_delays": Quantity("1", "delays of the fed-back force"),
    "n_neurons": Quantity("1", "neurons of the hidden layer"),
    "n_parameters": Quantity("1", "parameters of the network"),
    "n_epochs": Quantity("1", "epochs of the training, the one before the first step included"),
    "training_s": Quantity("s", "time of the training"),
    "ended": Quantity("1", "why the training ended, or failed"),
    "is_kept": Quantity("1", "1 at the epoch whose model was kept"),
    "predicted_w_bar": Quantity("1", "W̄ of the force that a model predicts for the same motion", "W̄"),
    "predicted_beta": Quantity("1", "β of the force that a model predicts for the same motion", "β"),
    "w_bar_difference": Quantity("1", "W̄ predicted − measured"),
    "beta_difference": Quantity("1", "β predicted − measured"),
    "residual_test": Quantity(
        "1", "what the residual is correlated with: its own past, or powers of the velocity"
    ),
    "lag_s": Quantity("s", "time by which the other signal comes earlier"),
    "residual_correlation": Quantity("1", "correlation of the residual with another signal, −1 … 1"),
    "residual_band": Quantity("1", "half-width of the 95 % band of a correlation around zero"),
    "model": Quantity("1", "state of the liquids, or wing"),
    "speed": Quantity("m s-1", "speed of the air", "U"),
    "pole_real": Quantity("s-1", "growth of a root, positive = growing", "Re s"),
    "pole_imag": Quantity("rad s-1", "angular frequency of a root", "Im s"),
    "origin": Quantity("1", "coordinate that a branch starts at, or the number of a lag"),
    "flutter_speed": Quantity("m s-1", "lowest speed of flutter, by rational functions", "U_F"),
    "flutter_frequency": Quantity("rad s-1", "angular frequency there", "ω_F"),
    "p_k_flutter_speed": Quantity("m s-1", "the same flutter by p-k"),
    "crossing_model": Quantity("1", "model of a root that begins to grow"),
    "crossing_kind": Quantity("1", "flutter, divergence, or flight of a body that hardly deforms"),
    "crossing_origin": Quantity("1", "branch of a root that begins to grow"),
    "crossing_speed": Quantity("m s-1", "speed at which a root begins to grow"),
    "crossing_frequency": Quantity("rad s-1", "its angular frequency, 0 if it does not oscillate"),
    "time": Quantity("s", "time from the beginning of a simulation", "t"),
    "case": Quantity("1", "name of a gust that an aircraft or wing flies through"),
    "tank": Quantity("1", "name of a tank"),
    "liquid": Quantity("1", "tank, plane and number of a liquid that sloshes sideways"),
    "angle_of_attack": Quantity("rad", "local angle of attack by motion, nose up positive", "Δw/U"),
    "tip_acceleration": Quantity("m s-2", "vertical acceleration of the tip, upward positive", "ẅ_tip"),
    "modal_coordinate": Quantity("m", "displacement of the node that a dry mode moves farthest", "q"),
    "tank_acceleration": Quantity("m s-2", "absolute vertical acceleration of a tank, upward positive", "ü_T"),
    "sloshing_force": Quantity("N", "force of the liquid beyond the frozen liquid, upward positive", "Δf"),
    "sloshing_coordinate": Quantity(
        "m", "displacement of an equivalent mass of the liquid against its tank, r over √m_n", "r/√m"
    ),
    "w_gust": Quantity("m s-1", "vertical speed of the gust, up positive", "w_g"),
    "outside_domain": Quantity("1", "1 while a tank is outside what its model was trained on"),
    "gust_speed": Quantity("m s-1", "speed of the air", "U"),
    "gust_amplitude": Quantity("m s-1", "largest vertical speed of the gust", "w_ga"),
    "gust_length": Quantity("m", "length of the gust along the path", "L_g"),
    "ending": Quantity("1", "why a simulation ended before its time, and when; empty where it did not"),
    "pair": Quantity("1", "pair of nodes that carry the tanks, from the middle outwards"),
    "x_offset": Quantity("m", "of the tanks' centres from their nodes, aft positive"),
    "tank_x": Quantity("m", "centre of the right tank, aft positive", "x"),
    "tank_y": Quantity("m", "centre of the right tank, to starboard positive", "y"),
    "static_margin": Quantity("1", "neutral point behind the centre of mass, in reference chords, frozen liquid"),
    "is_beneath": Quantity("1", "1 where the tank's centre is beneath the wing"),
    "frozen_flutter_speed": Quantity("m s-1", "first symmetric flutter, frozen liquid", "U_F"),
    "frozen_flutter_frequency": Quantity("rad s-1", "angular frequency there"),
    "frozen_antisymmetric_speed": Quantity("m s-1", "first antisymmetric flutter, frozen liquid"),
    "lateral_flutter_speed": Quantity("m s-1", "first symmetric flutter, liquid that sloshes sideways", "U_F"),
    "lateral_flutter_frequency": Quantity("rad s-1", "angular frequency there"),
    "lateral_antisymmetric_speed": Quantity("m s-1", "first antisymmetric flutter, liquid that sloshes sideways"),
    "lateral_sloshing_speed": Quantity("m s-1", "where an oscillation of the liquid itself begins to grow"),
    "fill_flutter_speed": Quantity("m s-1", "flutter speed over the fill level, liquids frozen", "U_F"),
    "fill_flutter_frequency": Quantity("rad s-1", "its angular frequency", "ω_F"),
    "effective_mass_flutter_speed": Quantity("m s-1", "flutter speed with an effective mass in all tanks", "U_F"),
    "fuselage_velocity": Quantity(
        "m s-1", "vertical velocity of the fuselage since touchdown, up positive", "u̇_f"
    ),
    "continuation": Quantity("1", "where motions began: at rest, or as that of the speed before ended"),
    "cycle_amplitude": Quantity("m", "amplitude of the tip that a motion ended with", "a"),
    "cycle_frequency": Quantity("rad s-1", "angular frequency of the motion", "ω"),
    "simulated_time": Quantity("s", "time that was waited for a limit cycle"),
    "converged": Quantity("1", "1 where the amplitude changed by less than 1 % in ten cycles"),
    "fold_speed": Quantity("m s-1", "speed beyond which there is no stable limit cycle; NaN if none was found"),
    "onset_speed": Quantity("m s-1", "speed below which the motion dies; NaN if none was found"),
    "tip_amplitude": Quantity("m", "displacement amplitude of the tip", "a"),
    "aero": Quantity("J", "work of the air on the structure in a cycle", "L_aero"),
    "slosh": Quantity("J", "work of the liquid on the structure in a cycle, from the map of W̄", "L_slosh"),
    "damping": Quantity("J", "work of the structure's dampers in a cycle", "L_damp"),
    "total": Quantity("J", "sum of the works; 0 on a limit cycle", "L"),
    "zero_beta": Quantity("1", "effective-mass fraction in the mode of a zero of the sum", "β̂"),
    "zero_speed": Quantity("m s-1", "speed of a zero of the sum", "U"),
    "zero_amplitude": Quantity("m", "amplitude of the tip of a zero of the sum", "a"),
    "zero_is_stable": Quantity("1", "1 where the sum falls with the amplitude"),
    "residual_explained": Quantity("1", "share of the residual's variance that a linear filter would give"),
}


def described(dataset: xr.Dataset) -> xr.Dataset:
    """A copy whose variables carry the attributes of the table and nothing else.

    Raises
    ------
    KeyError
        If a variable is not in the table: add it there first.
    """
    result = dataset.copy(deep=False)
    for name in [*result.data_vars, *result.coords]:
        quantity = QUANTITIES.get(str(name)) or QUANTITIES[str(name).removesuffix("_std")]
        attributes = {"long_name": quantity.long_name}
        if result[name].dtype.kind in "fiu":
            attributes["units"] = quantity.units
        if str(name) not in QUANTITIES:
            attributes["long_name"] = f"standard error of: {quantity.long_name}"
        # replaced, not added to: arithmetic of xarray keeps attributes, and the square of a force would still
        # say N
        result[name].attrs = attributes
    return result

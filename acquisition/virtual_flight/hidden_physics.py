"""What may be hidden in a flight test: numbers of the laboratory that the model file does not know."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Oscillator:
    """A mass that moves against the wing.

    Attributes
    ----------
    y_m, behind_axis_m : float
        Where.
    frequency_hz, damping_ratio, mass_kg : float
    inertial_coupling : float
        Generalised mass between it and the wing: its mass for one that moves vertically [kg], √m h for a liquid
        that sloshes with the pitch.
    static_coupling : float
        Force of its coordinate by the wing's: g √m for a liquid.
    turns : bool
        Whether it is coupled to the twist of the wing instead of its vertical motion.
    """

    y_m: float
    behind_axis_m: float
    frequency_hz: float
    damping_ratio: float
    mass_kg: float
    inertial_coupling: float
    static_coupling: float = 0.0
    turns: bool = False


@dataclass(frozen=True)
class HiddenFlight:
    """Everything that can be hidden; nothing is by default.

    Attributes
    ----------
    lift_gain : float
        All forces of the air are 1 + this.
    lag_ratio : float
        All lags of the air are this times those of Jones and Küssner.
    stall_angle_rad : float
        Local angle of attack up to which lift grows; beyond it stays.
    airspeed_ratio : float
        True airspeed is 1 + this of the recorded one.
    gust_delay_s, gust_time_constant_s : float
        The gust at the wing is that of the vane later, or through a first-order low-pass.
    flap_limit_rad, flap_rate_rad_per_s : float
        Of the angle that is asked of the actuator, and of its own rate; infinite for none.
    actuator_delay_s, play_rad : float
        Of the actuator; between it and the flap, in all.
    fill_levels : dict of int to float
        True fill of some tanks.
    effective_mass : dict of int to float
        Share by which the liquid's mass differs.
    liquid_loss_kg_per_s : dict of int to float
    sloshing : dict of int to (float, float)
        Tank to threshold [g] and largest W̄.
    oscillators : tuple of Oscillator
    loss_factor : float
        Of all modes, beyond their damping.
    tip_stiffness_n_per_m3 : float
        Cubic spring between tip and ground: outside every vocabulary here.
    buffet_lift_coefficient, buffet_strouhal : float
        Lift that the air makes by itself: outside.
    hunting_rad, hunting_hz : float
        Motion of the actuator that nobody commands: outside.
    slug_kg, slug_threshold_g : float
        Momentum exchange of a slug of liquid in the last tank, per impact: outside.
    sensor : tuple of (str, str, float)
        Channel, kind (``gain``, ``delay``, ``clipping``, ``high_pass``) and number.
    """

    lift_gain: float = 0.0
    lag_ratio: float = 1.0
    stall_angle_rad: float = float("inf")
    airspeed_ratio: float = 0.0
    gust_delay_s: float = 0.0
    gust_time_constant_s: float = 0.0
    flap_limit_rad: float = float("inf")
    flap_rate_rad_per_s: float = float("inf")
    actuator_delay_s: float = 0.0
    play_rad: float = 0.0
    fill_levels: dict[int, float] = field(default_factory=dict)
    effective_mass: dict[int, float] = field(default_factory=dict)
    liquid_loss_kg_per_s: dict[int, float] = field(default_factory=dict)
    sloshing: dict[int, tuple[float, float]] = field(default_factory=dict)
    oscillators: tuple[Oscillator, ...] = ()
    loss_factor: float = 0.0
    tip_stiffness_n_per_m3: float = 0.0
    buffet_lift_coefficient: float = 0.0
    buffet_strouhal: float = 0.2
    hunting_rad: float = 0.0
    hunting_hz: float = 5.0
    slug_kg: float = 0.0
    slug_threshold_g: float = 1.0
    sensor: tuple[tuple[str, str, float], ...] = ()

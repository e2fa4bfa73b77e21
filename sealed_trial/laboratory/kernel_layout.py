"""Where the kernel finds its numbers: parameters, states, and the contact conditions that events switch.

A parameter that is zero does nothing, unless its comment says so. SI units; forces act at the place of the tank.
"""

from __future__ import annotations

from typing import Final

# structure: forces of the relative displacement x and velocity v
STIFFNESS_CHANGE: Final = 0  # Δk [N/m]
STIFFNESS_QUADRATIC: Final = 1  # k₂ [N/m²]
STIFFNESS_CUBIC: Final = 2  # k₃ [N/m³]
STRUCTURE_VISCOUS: Final = 3  # c [N s/m]
STRUCTURE_DRAG: Final = 4  # c v|v| [N s²/m²]
CONSTANT: Final = 5  # [N]
CLEARANCE_GAP: Final = 6  # [m]
CLEARANCE_STIFFNESS: Final = 7  # [N/m]
CLEARANCE_DAMPING: Final = 8  # [N s/m], while in contact
HYSTERESIS_STIFFNESS: Final = 9  # [N/m]; ż = k v (1 − ½(1 + sgn(v z)) (|z|/z_y)^p)
HYSTERESIS_YIELD: Final = 10  # z_y [N]; must not be zero
HYSTERESIS_EXPONENT: Final = 11
RELAXATION_GAIN: Final = 12  # scales the bank of relaxing springs [N/m]
APPENDAGE_MASS: Final = 13  # [kg], on the structure
APPENDAGE_RATE: Final = 14  # ω [rad/s]
APPENDAGE_DAMPING: Final = 15  # ζ
STRUCTURE_MASS: Final = 16  # Δm beyond what is known [kg]

# dry friction at one place; direction + for v > 0
FRICTION_UP: Final = 17  # [N]
FRICTION_DOWN: Final = 18  # [N]
FRICTION_STATIC_EXTRA: Final = 19  # F_s − F_c [N]
FRICTION_STRIBECK: Final = 20  # v_s [m/s]; must not be zero
FRICTION_AT_TANK: Final = 21  # 1: of the absolute velocity of the tank

# tank: forces of the absolute velocity
TANK_VISCOUS: Final = 23  # c [N s/m]
TANK_DRAG: Final = 24  # [N s²/m²]
TANK_MASS: Final = 25  # Δm [kg]
LIQUID_MASS: Final = 26  # m_l [kg], for the laws below
SLOSHING_THRESHOLD: Final = 27  # [g]; must not be zero
SLOSHING_PEAK: Final = 28  # largest W̄
EFFECTIVE_MASS: Final = 29  # β at rest
EFFECTIVE_MASS_FADE: Final = 30  # [g] at which β is halved; must not be zero
BUILD_UP_TIME: Final = 31  # [s] of violent motion until the liquid's damping has grown
BUILD_UP_START: Final = 32  # [g] that counts as violent
SATURATION: Final = 33  # [g] beyond which the liquid's work stops growing
WAVE_MASS: Final = 34  # m of the standing wave [kg]
WAVE_RATE: Final = 35  # ω [rad/s]
WAVE_DAMPING: Final = 36  # ζ
WAVE_COUPLING: Final = 37  # κ
WAVE_HARDENING: Final = 38  # [1/m²]
SLUG_MASS: Final = 39  # part of the liquid on a spring [kg]
SLUG_STIFFNESS: Final = 40  # [N/m]
SLUG_DAMPING: Final = 41  # [N s/m]
SLUG_HARDENING: Final = 42  # [1/m]: k s/(1 − h s), as gas that is compressed
LOOSE_MASS: Final = 43  # part of the liquid that flies [kg]
LOOSE_GAP: Final = 44  # to the ceiling [m]
LOOSE_STIFFNESS: Final = 45  # of floor and ceiling [N/m]
LOOSE_DAMPING: Final = 46  # [N s/m]
LOSS_RATE: Final = 47  # [kg/s]
TANK_ONE_SIDED: Final = 48  # c for downward motion only [N s/m]

# outside the vocabulary, structure
STIFFNESS_MODULATION: Final = 49  # [N/m]
STIFFNESS_MODULATION_RATE: Final = 50  # [rad/s]
DAMPING_OF_DISPLACEMENT: Final = 51  # c x² v [N s/m³]
STIFFNESS_STEP: Final = 52  # [N/m] from an instant on
STIFFNESS_STEP_TIME: Final = 53  # [s]

# forces from outside, whatever the motion
TONE_FORCE: Final = 54  # [N]
TONE_RATE: Final = 55  # [rad/s]
TONE_PHASE: Final = 57  # [rad], of every run its own
PULSE_FORCE: Final = 58  # largest of a pulse [N]
PULSE_START: Final = 59  # of the first [s], of every run its own
PULSE_PERIOD: Final = 60  # [s]
PULSE_WIDTH: Final = 61  # [s]
PULSE_ALTERNATES: Final = 62  # 1: every other pulse pulls
OUTSIDE_AT_TANK: Final = 63  # 1: they act on the tank, 0: on the structure

# a slider with dry friction that is dragged through a spring with a play
SLIDER_UP: Final = 64  # friction while it is dragged upward [N]
SLIDER_DOWN: Final = 65  # [N]
SLIDER_PLAY: Final = 66  # free travel in all [m]
SLIDER_STIFFNESS: Final = 67  # [N/m]

CARRIED_MASS: Final = 56  # M_dry + m_l [kg]
N_PARAMETERS: Final = 68

# states beyond the coordinates and their velocities
S_HYSTERESIS: Final = 0  # [N]
S_MEAN_SQUARE_A: Final = 1  # running mean of a² [m²/s⁴]
S_MEAN_SQUARE_V: Final = 2  # running mean of v² [m²/s²]
S_VIOLENCE: Final = 3  # time of violent motion [s]
S_WAVE: Final = 4  # η [m]
S_WAVE_RATE: Final = 5
S_SLUG: Final = 6  # relative to the tank [m]
S_SLUG_RATE: Final = 7
S_LOOSE: Final = 8  # above the floor [m]
S_LOOSE_RATE: Final = 9
S_APPENDAGE: Final = 10  # relative to the place [m]
S_APPENDAGE_RATE: Final = 11
S_DISSIPATED: Final = 12  # work of the structure's friction, viscous and contact forces at the tank's place [J]
S_SLIDER: Final = 13  # where the slider is [m]
S_RELAXATION: Final = 14  # elastic forces of the relaxing springs over their gain
N_RELAXATION: Final = 12
N_STATES: Final = S_RELAXATION + N_RELAXATION

# contact conditions
D_FRICTION: Final = 0  # +1 up, −1 down, 0 sticks
D_CLEARANCE: Final = 1  # −1, 0, +1
D_LOOSE: Final = 2  # −1 floor, 0 flight, +1 ceiling
D_SLIDER: Final = 3  # +1 slides up, −1 down, 0 rests
N_CONDITIONS: Final = 4

# what the laboratory sees
O_DISPLACEMENT: Final = 0  # of the tank, absolute
O_ACCELERATION: Final = 1  # of the tank, absolute
O_INTERFACE_FORCE: Final = 2  # on the tank
O_RELATIVE_DISPLACEMENT: Final = 3
O_RELATIVE_VELOCITY: Final = 4
O_LIQUID_FORCE: Final = 5  # Δf
O_COORDINATES: Final = 6  # accelerations of the coordinates
MOST_COORDINATES: Final = 5
N_OUTPUTS: Final = O_COORDINATES + MOST_COORDINATES

# columns of a motion table
T_DISPLACEMENT, T_VELOCITY, T_ACCELERATION, T_MODULATION = 0, 1, 2, 3

GRAVITY: Final = 9.81
AVERAGING_TIME: Final = 0.12  # of the running means [s]

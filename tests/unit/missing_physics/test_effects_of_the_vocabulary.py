"""The registry holds the published vocabulary: names, blocks, parameters, look-alikes, all typed in by hand."""

from __future__ import annotations

import pytest

from sloshlab.errors import InputError
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import BLOCKS, Effect, known_effects, register

assert effects.__all__

VOCABULARY = [
    ("viscous_damping", ("structure", "tank"), {"damping_n_s_per_m"}),
    ("coulomb_friction", ("structure", "tank"), {"force_n"}),
    ("asymmetric_friction", ("structure",), {"force_up_n", "force_down_n"}),
    ("stribeck_friction", ("structure",), {"coulomb_n", "static_n", "stribeck_velocity_m_per_s"}),
    ("quadratic_drag", ("structure", "tank"), {"drag_n_s2_per_m2"}),
    ("structural_damping", ("structure",), {"loss_factor"}),
    ("hysteresis", ("structure",), {"stiffness_n_per_m", "beta_gamma", "beta_delta"}),
    ("friction_behind_play", ("structure",), {"force_n", "play_m", "stiffness_n_per_m"}),
    ("cubic_stiffness", ("structure",), {"stiffness_n_per_m3"}),
    ("quadratic_stiffness", ("structure",), {"stiffness_n_per_m2"}),
    ("stiffness_change", ("structure",), {"stiffness_n_per_m"}),
    ("clearance", ("structure",), {"gap_m", "stiffness_n_per_m"}),
    ("missing_mode", ("structure",), {"frequency_hz", "damping_ratio", "participation"}),
    ("mass_error", ("structure", "tank"), {"mass_kg"}),
    ("constant_force", ("structure",), {"force_n"}),
    ("liquid_sloshing", ("tank",), {"threshold_g", "peak_w_bar"}),
    ("effective_mass", ("tank",), {"beta"}),
    ("ceiling_impact", ("tank",), {"stiffness_n_per_m", "damping_kg_per_s", "gap_m"}),
    ("breakup_delay", ("tank",), {"time_constant_s"}),
    ("high_g_saturation", ("tank",), {"threshold_g"}),
    ("faraday_wave", ("tank",), {"frequency_hz", "growth"}),
    ("lateral_mode", ("tank",), {"frequency_hz", "mass_kg"}),
    ("liquid_loss", ("tank",), {"rate_kg_per_s"}),
    ("air_cushion", ("tank",), {"stiffness_n_per_m"}),
    ("base_rocking", ("excitation",), {"compliance_rad_per_n_m"}),
    ("sensor_gain", ("sensor",), {"ratio"}),
    ("sensor_delay", ("sensor",), {"delay_s"}),
    ("sensor_high_pass", ("sensor",), {"time_constant_s"}),
    ("sensor_clipping", ("sensor",), {"limit"}),
    ("sensor_drift", ("sensor",), {"rate"}),
    ("mains_hum", ("sensor",), {"amplitude"}),
    ("clock_skew", ("sensor",), {"ratio"}),
    ("cross_talk", ("sensor",), {"ratio"}),
    ("sample_and_hold", ("sensor",), {"update_rate_hz"}),
    ("actuator_saturation", ("excitation",), {"limit", "dead_zone"}),
    ("external_force", ("structure", "tank"), {"size_n"}),
]
BY_DIRECTION = {"force_n": {"force_up_n", "force_down_n"}}
"""Numbers that a form with a direction has in place of one."""


def built_in() -> list[Effect]:
    """Effects of the program, without those of users."""
    return [effect for effect in known_effects() if effect.extension.__module__.startswith("sloshlab.")]


def named(name: str) -> list[Effect]:
    """Effects of a name, one per block."""
    return [effect for effect in known_effects() if effect.name == name and effect.equation]


@pytest.mark.parametrize(("name", "blocks", "parameters"), VOCABULARY, ids=[name for name, _, _ in VOCABULARY])
def test_an_effect_has_its_blocks_and_parameters(name: str, blocks: tuple[str, ...], parameters: set[str]) -> None:
    found = named(name)
    assert sorted(effect.block for effect in found) == sorted(blocks)
    for effect in found:
        assert parameters <= {parameter.name for parameter in effect.parameters}
        assert all(parameter.low < parameter.high for parameter in effect.parameters)


def test_no_effect_of_the_program_is_outside_the_vocabulary() -> None:
    assert {effect.known_as for effect in built_in()} == {name for name, _, _ in VOCABULARY}


def test_another_form_of_an_effect_answers_with_its_name_block_and_parameters() -> None:
    required = {name: parameters for name, _, parameters in VOCABULARY}
    forms = [effect for effect in built_in() if effect.variant_of]
    expected = {"fading_mass", "linear_structural_damping", "mains_hum_60", "friction_behind_play_by_direction"}
    assert expected <= {form.name for form in forms}
    for form in forms:
        [original] = [other for other in named(form.variant_of) if other.block == form.block]
        assert not original.variant_of
        assert form.known_as == original.known_as == original.name
        has = {parameter.name for parameter in form.parameters}
        for needed in required[original.name]:
            assert needed in has or BY_DIRECTION[needed] <= has, (form.name, needed)


def test_blocks_and_names_are_checked() -> None:
    [friction] = [effect for effect in named("coulomb_friction") if effect.block == "structure"]
    with pytest.raises(InputError, match=f"block.*'roof'.*{', '.join(BLOCKS)}"):
        register(Effect("glue", "roof", "", (), friction.starts, friction.extension))
    with pytest.raises(InputError, match="a name that is taken"):
        register(Effect("coulomb_friction", "structure", "", (), friction.starts, friction.extension))
    assert friction in known_effects()

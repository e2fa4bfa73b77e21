"""A small wing for tests: few elements, boxes, modes and tanks."""

from __future__ import annotations

from typing import Any

from sloshlab.aircraft.wing_file import WingDescription


def small_wing(**changes: Any) -> WingDescription:
    """Changes are keys of tables, as ``wing={"n_modes": 4}``."""
    tables: dict[str, Any] = {
        "wing": {
            "chords": [{"y_m": 0.0, "chord_m": 2.0}, {"y_m": 10.0, "chord_m": 2.0}],
            "leading_edge_sweep_deg": 0.0,
            "elastic_axis": 0.4,
            "mass_centre_behind_axis": 0.0,
            "pitch_radius_of_gyration": 0.25,
            "root_mass_kg_per_m": 40.0,
            "tip_mass_kg_per_m": 40.0,
            "root_bending_stiffness_n_m2": 2e6,
            "torsion_over_bending": 0.7,
            "in_plane_over_bending": 6.0,
            "n_elements": 12,
            "n_modes": 4,
        },
        "flow": {"density_kg_per_m3": 1.0, "mach": 0.3},
        "aerodynamics": {
            "n_span": 6, "n_chord": 3, "semi_chord_m": 1.0, "largest_reduced_frequency": 1.0,
            "n_reduced_frequencies": 8, "lags": [0.1, 0.4],
        },
        "tanks": [
            {"name": "inner", "y_m": 4.0, "length_m": 0.8, "width_m": 0.6, "height_m": 0.3},
            {"name": "outer", "y_m": 8.2, "length_m": 0.6, "width_m": 0.5, "height_m": 0.2},
        ],
    }  # fmt: skip
    for table, values in changes.items():
        both = isinstance(values, dict) and table in tables
        tables[table] = {**tables[table], **values} if both else values
    return WingDescription.model_validate(tables)

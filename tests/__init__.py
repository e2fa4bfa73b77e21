"""Makes this folder the package `tests`: PanelAero installs one of that name, to which a bare folder yields."""

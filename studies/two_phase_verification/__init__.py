"""Checks of the tank of liquid and gas: flows whose outcome is known, and what it says of the shaken tank."""

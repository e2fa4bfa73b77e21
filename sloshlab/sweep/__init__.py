"""From a recorded sweep to the work per cycle in windows.

``law`` what the sweep was asked to do · ``motion_phase`` what it did · ``cycles`` one row per
cycle · ``windows`` averages over 2P cycles · ``regime`` what the liquid does in a window.
"""

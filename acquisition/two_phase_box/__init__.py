"""The tank of liquid and gas in three dimensions: planes in boxes instead of lines in rectangles.

The method of `acquisition.two_phase_tank`, whose fluids, setup, account and geometry of the plane are taken over;
one cell deep, between slipping walls before and behind, it computes the plane's flow.
"""

"""Avionics based augmentation: the paper's tables and figures recomputed, and the picture of a masking table.

What of it: :mod:`link_items` antennas and link budget, :mod:`loop_items` tracking loops, :mod:`airframe_items` aircraft
and masking, :mod:`echo_items` multipath, :mod:`flight_items` satellites, C/N0 and Doppler on the paper's flight,
:mod:`requirement_items` what phases of flight require, :mod:`recorded_items` Doppler and C/N0 of a recorded receiver.
"""

"""Avionics based augmentation: the paper's tables and figures recomputed, and what cautions are worth.

The paper: :mod:`link_items` antennas and link budget, :mod:`loop_items` tracking loops, :mod:`airframe_items` aircraft
and masking, :mod:`echo_items` multipath, :mod:`flight_items` satellites, C/N0 and Doppler on the paper's flight,
:mod:`requirement_items` what phases of flight require, :mod:`recorded_items` Doppler and C/N0 of a recorded receiver.

How early and how often wrongly an aircraft is cautioned of the satellites its own flight will cost: random flights of
turns, flown later or sooner and steeper or flatter than planned, under the nominal constellation. ``flights`` draws
them, ``cautions`` has what each predictor says at each of their times (loops in ``kernels``), ``scoring`` what that is
worth, ``campaign`` many of them.
"""

"""Avionics based augmentation: its pictures and figures.

How early and how often wrongly an aircraft is cautioned of the satellites its own flight will cost: random flights of
turns, flown later or sooner and steeper or flatter than planned, under the nominal constellation. ``flights`` draws
them, ``cautions`` has what each predictor says at each of their times (loops in ``kernels``), ``scoring`` what that is
worth, ``campaign`` many of them.
"""

"""The ground station: observations of the reference receivers in, corrections and bursts out.

=================  ==================================================================================================
``params``         what a station is told, in the sections of its file;  ``prepared`` made ready once
``station``        the epoch: ``stages`` one after the other (receive, track, monitor, correct, decide, report)
``exclusions``     latches what failed until it may be used again
``channels``       ephemerides in use, predicted ranges, cycle slips and smoothing of every receiver's channels
``monitors``       one module each: a pure step that returns statistic, threshold and verdict
``corrections``    forming them, making them agree (B values), their sigmas
``ionosphere``     fronts that have not reached the station: threat model, geometry screening, inflation
``claims``         what the broadcast may claim of orbits, gradients and itself
``broadcast``      one epoch's corrections as the bursts of one frame
``nodes``          the programs
=================  ==================================================================================================

Arrays are ``(R, ...)`` over reference receivers, ``(bands, N)`` over bands and satellites; smoothing constants lead.
"""

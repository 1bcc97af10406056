"""The simulated truth: what the suite's two ends would observe if the world were as its parameters say.

One subject a module: :mod:`constellation` makes the satellites as broadcast ephemerides, :mod:`flight` moves the
aircraft, :mod:`sightlines` has ranges and range rates between them, :mod:`troposphere`, :mod:`ionosphere` and
:mod:`fronts` delay the signals along their :mod:`paths`, :mod:`scintillation` interrupts them, :mod:`receivers` turns
them into observations with their noise, :mod:`world` puts an epoch together, and :mod:`scenario` reads its parameters.
All of it is a function of the parameters and the epoch: nothing remembers, so any epoch can be made by itself, in any
order, with the same bits.

Axes: receivers (R), bands, xyz, satellites; see docs/conventions.md.
"""

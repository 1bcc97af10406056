"""The simulated truth: what the suite's two ends would observe if the world were as its parameters say.

One subject a module. Satellites: :mod:`constellation` has the nominal orbits, :mod:`broadcast` the orbits of a world
and what is broadcast of them, :mod:`sightlines` ranges and range rates. Ways: :mod:`troposphere`, :mod:`ionosphere` and
:mod:`fronts` delay the signals along their :mod:`paths`, :mod:`scintillation` interrupts them. Receivers:
:mod:`receiver_model` with its loops (:mod:`tracking`), clocks (:mod:`oscillators`), C/N0 (:mod:`antenna`) and multipath
(:mod:`multipath`, :mod:`rays`), :mod:`presets` as good as the standards say, :mod:`receivers` that turn signals into
observations, with :mod:`arcs` of carriers that are lost and found. Faults: :mod:`faults`. Aircraft: :mod:`flight` on a
straight-in approach, :mod:`flight_dynamics` by the equations of motion. :mod:`world` puts an epoch together,
:mod:`scenario` reads its parameters, :mod:`batches` has many epochs as arrays, and :mod:`rinex_files` writes files.

All of it is a function of the parameters and the epoch: any epoch can be made by itself, in any order, with the same
bits. Where signals may be lost (scintillation, a building, an aircraft that banks) an epoch out of order takes longer.

Axes: receivers (R), bands, xyz, satellites; see docs/conventions.md.
"""

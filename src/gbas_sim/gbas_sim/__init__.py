"""The simulated truth: what the suite's two ends would observe if the world were as its parameters say.

====================  ===============================================================================================
``satellites``        the nominal orbits, the orbits of a world and what is broadcast of them, ranges and range rates
``atmosphere``        troposphere, ionosphere and fronts delay the signals on their way, scintillation interrupts them
``faults``            of satellites, signals and receivers
``receivers``         noise, clocks, C/N0, multipath, carriers that are lost and found; as good as the standards say
``flight``            straight in, or by the equations of motion
``world``             one epoch of all that;  ``world_params`` what it depends on;  ``simulated_epochs`` what it gives
``instants``          where everything is at a time tag;  ``threat_checks`` refuses threats that would do nothing
``batches``           many epochs as arrays
``scenario``          reads the parameters;  ``random_processes`` what is drawn, by epoch
``rinex_files``       writes files
``nodes``             the programs
====================  ===============================================================================================

Antennas, tracking loops, discriminators and rays are in :mod:`gbas_core.signal`.

All of it is a function of the parameters and the epoch: any epoch can be made by itself, in any order, with the same
bits. Where signals may be lost (scintillation, a building, an aircraft that banks) an epoch out of order takes longer.

Axes: receivers (R), bands, xyz, satellites; see docs/conventions.md.
"""

"""GNSS algorithms both ends of a GBAS share; no ROS, no clock, and files only in ``io``.

==============  =====================================================================================================
``satellites``  the satellite axis;  ``signals`` the band axis
``record``      records on them: frozen dataclasses whose fields say how they travel as a table
``parameters``  declared once, for files, ROS, errors and documentation;  ``configuration`` files of them
``gnss``        time, frames, orbits, ephemerides, almanacs, one receiver's observations
``ranging``     cycle slips, carrier smoothing, combinations of bands, divergence filters
``models``      error models of the standard, multipliers of protection levels
``positioning`` weighted least squares, the final approach
``signal``      antennas and link budget, tracking loops, discriminators, rays
``io``          RINEX, RTCM 3, recordings of several receivers
==============  =====================================================================================================

Conventions. Satellites are the trailing axis ``(..., N)``, ``N = gbas_core.satellites.N_SATS``, in a fixed order;
bands are the axis before it; missing is NaN. Units are SI and stand in the names; angles are radians, degrees only in
files. Positions are ECEF unless a name says otherwise (docs/conventions.md).
"""

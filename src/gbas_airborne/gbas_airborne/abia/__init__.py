"""Avionics based integrity augmentation: what the aircraft's own flight does to its navigation.

``airframe`` has the airframe as a mesh and what of the sky it hides from an antenna, ``terrain`` the horizon over an
elevation tile, ``visibility`` the satellites in view of a path, their geometry and what phases of flight require of it,
``multipath`` the echoes of airframe and ground, ``tracking`` the motion a receiver's loops have to follow. Link budget,
antennas and thresholds of loops are in :mod:`gbas_core.signal`.

``prediction`` looks ahead at the satellites the flight will cost, ``flags`` cautions and warns, ``steering`` finds the
smallest change of flight that keeps them.

Source: Sabatini, Moore, Hill, "A novel GNSS integrity augmentation system", WASET 7 (2013).
"""

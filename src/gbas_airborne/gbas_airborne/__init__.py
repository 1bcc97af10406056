"""The airborne receiver: bursts, own observations and ephemerides in, protected position out.

``reception`` keeps what the station has told; ``ranging`` makes corrected ranges; ``navigation`` a position and its
place on the approach; ``protection`` the protection levels; ``service`` decides what may be flown; ``receiver`` runs
them in this order. Everything about the station comes from VDB bits.
"""

"""The airborne receiver: bursts, own observations and ephemerides in, protected position out.

``modes`` says what is processed: signal, smoothing, product. ``reception`` keeps what the station has told, ``ranging``
smooths and corrects the own ranges, ``navigation`` makes a position and finds its place on the approach, ``report``
makes the record of it, ``protection`` the protection levels, ``service`` decides what may be flown. ``receiver`` runs
them in this order. Everything about the station comes from VDB bits.
"""

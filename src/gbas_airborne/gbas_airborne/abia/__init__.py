"""Avionics based integrity augmentation: what the aircraft's own flight does to its navigation.

``airframe`` has the airframe as a mesh and what of the sky it hides from an antenna.

Source: Sabatini, Moore, Hill, "A novel GNSS integrity augmentation system", WASET 7 (2013).
"""

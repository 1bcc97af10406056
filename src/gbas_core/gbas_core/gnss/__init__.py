"""GPS time, Earth-fixed frames, ephemerides and orbits, and what one receiver observes."""

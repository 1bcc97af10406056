"""GPS time, Earth-fixed frames and attitudes, ephemerides and orbits, and what one receiver observes."""

"""Receivers: clocks, noise, multipath, arcs of the carrier, and the site around their antennas."""

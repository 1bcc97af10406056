"""Compiled loops over receivers, bands and satellites, and the formulas they are made of."""

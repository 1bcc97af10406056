"""Compiled loops over receivers and satellites, and the formulas they are made of."""

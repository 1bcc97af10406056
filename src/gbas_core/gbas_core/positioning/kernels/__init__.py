"""Compiled loops, and the formulas they are made of."""

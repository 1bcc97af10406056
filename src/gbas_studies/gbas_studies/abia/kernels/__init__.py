"""Compiled loops over the times of a flight; what they call is the prediction's own."""

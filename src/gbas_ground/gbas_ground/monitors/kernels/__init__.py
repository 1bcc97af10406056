"""Loops over receivers, bands and satellites of the monitors."""

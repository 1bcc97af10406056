"""Loops over receivers and satellites of the stages."""

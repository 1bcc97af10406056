"""Compiled loops over channels."""

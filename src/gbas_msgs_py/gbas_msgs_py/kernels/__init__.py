"""Loops over the numbers of tables."""

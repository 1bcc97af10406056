"""Corrected ranges, and why the others are not used."""

"""Faults of satellites, signals and receivers."""

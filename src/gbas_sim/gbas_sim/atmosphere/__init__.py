"""Troposphere, ionosphere, fronts and scintillation."""

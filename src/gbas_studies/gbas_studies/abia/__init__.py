"""Avionics based augmentation: its pictures and figures."""

"""Compiled loops of the prediction."""

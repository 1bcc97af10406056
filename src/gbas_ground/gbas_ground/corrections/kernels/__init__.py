"""Loops over receivers and satellites that corrections are made with."""

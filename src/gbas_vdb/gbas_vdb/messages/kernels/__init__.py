"""Loops over the fields of messages."""

"""Loops over the bytes of messages and bursts."""

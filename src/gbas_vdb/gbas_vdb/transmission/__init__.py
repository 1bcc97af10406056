"""Bursts: which message goes into which slot of which frame, and what a receiver makes of them."""

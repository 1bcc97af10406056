"""Echoes of airframe and ground, what they do to code and phase, the channel they make, and how a receiver sees them.

Geometry gives delays and largest amplitudes (``airframe_echoes``); how echoes fade in time is the statistical channel's
(``channel``); ``early_late_phase`` is the observable that detects them.
"""

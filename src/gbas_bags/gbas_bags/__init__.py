"""Bags: MCAP with profile ``ros2``, written so that a killed recorder loses at most a second.

Readers trust nothing: a bag may be cut off or damaged.
"""

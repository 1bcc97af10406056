"""Bags: MCAP with profile ``ros2``, written so that a killed recorder loses at most a second.

:mod:`bags` finds and reads them, :mod:`info` says what is in one, :mod:`check` and :mod:`check_contents` whether it is
good (:mod:`problems`), :mod:`recovery` saves what is left of a damaged one.

Readers trust nothing: a bag may be cut off or damaged.
"""

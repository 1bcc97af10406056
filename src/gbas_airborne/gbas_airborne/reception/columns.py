"""Rows of a set of corrections, as received and as the ranges are corrected with it."""

from __future__ import annotations

LISTED, IOD, PRC, RRC, SIGMA, B_VALUES = range(6)
"""Whether there is a correction, issue of data, PRC, RRC, sigma; from the last on one row a reference receiver."""

"""Corrections: formed, made to agree, and bounded."""

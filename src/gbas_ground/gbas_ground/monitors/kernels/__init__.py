"""Compiled loops of the monitors, and the formulas they share with the analysis; one module a monitor or subject.

The modules above have the interface: parameters, states, results. Missing is NaN and is never passed: comparisons are
written so that they are false for it. Arrays are contiguous float64, int64 and bool; what is given is never changed.
"""

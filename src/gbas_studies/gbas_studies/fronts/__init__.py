"""Ionospheric fronts against a station and an aircraft: what is misleading, with the station's protection and without.

Delays add to codes and carriers, and smoothing and position are linear in them. So a quiet approach is flown once
through the whole chain (:mod:`~gbas_studies.fronts.quiet`), and a front's share in the errors is computed for itself
(:mod:`~gbas_studies.fronts.response`): some milliseconds a front, so that thousands are feasible
(:mod:`~gbas_studies.fronts.campaign`). The same front through the whole chain gives the same
(:func:`~gbas_studies.fronts.quiet.fly`).
"""

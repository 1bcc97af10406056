"""The station's epoch in stages: receive, track, monitor, correct, decide, report.

Each stage is a function ``stage(state, record, station) -> (state, record)``: it is given its own part of the station's
memory, the record of the stage before and the prepared station, and gives back its memory and one record.

====================  ===========================================  ============================================
stage                 record out                                   memory
====================  ===========================================  ============================================
:mod:`~.receive`      Received: observations, ephemerides          order of epochs, ephemerides, receivers there
:mod:`~.track`        Tracked: predicted and smoothed ranges       filters of the channels
:mod:`~.monitor`      Monitored: verdicts of the signal monitors   memories of the monitors
:mod:`~.correct`      Corrected: corrections that agree            the epoch before, B values over time
:mod:`~.decide`       Decided: status of satellites, protection    protection against ionospheric fronts
:mod:`~.report`       Reported: the tables and the events          what was said at the epoch before
====================  ===========================================  ============================================

Exclusions go along from record to record: every stage may add some.
"""

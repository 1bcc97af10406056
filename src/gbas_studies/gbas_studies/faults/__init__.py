"""What the running ground station does about injected faults: found or not, by what, and how soon.

A fault is put into a simulated world whose truth is known, and the station steps through its epochs as it would live,
from observations to the bits of its bursts. Times are those of the data.

==========================  ==================================================================
:mod:`~.injection`          one fault into a settled station, and when a burst first says so
:mod:`~.exposure`           when the user's differential error passes its limit meanwhile
:mod:`~.cases`              kinds and sizes of faults: every monitor, rates
:mod:`~.campaign`           many of them: onsets and seeds
==========================  ==================================================================
"""

"""Code-carrier divergence: what a fault does to the user, what the monitors make of it, and the worst case.

=========================  ====================================================================================
:mod:`~.smoothed_error`    differential error of ground and air filters, in closed form and stepped
:mod:`~.monitors`          statistics and thresholds of the monitors for a fault mode
:mod:`~.worst_case`        largest undetected error and smallest mapping function, on a grid and without one
:mod:`~.missed_detection`  missed detection against rate and error, the required limit, critical mapping functions
:mod:`~.rare_events`       the same probabilities by importance sampling, through the filters themselves
:mod:`~.recorded`          the monitors on recorded receivers
:mod:`~.injected`          the monitors on simulated receivers with faults
:mod:`~.reproduction`      every table and figure of the paper
=========================  ====================================================================================

Everything is linear in the rate d of the divergence, so that a unit response for each offset between filter and fault
is all a sweep needs.

Source: Jiang, Milner, Macabiau, "Code-carrier divergence monitoring for GAST-F GBAS", ENC 2015.
"""

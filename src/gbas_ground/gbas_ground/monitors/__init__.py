"""Monitors of the ground station, one a module of its name; :mod:`~.registry` lists those of signals.

To add one: its entry in :data:`gbas_msgs_py.monitors.MONITORS`, and a module of its name here with its parameters, its
step and ``MONITOR`` (:mod:`~.interface`). A monitor is one file, even where that is longer than others. Its section in
the station's file, its rows in the monitors table, its events and its line in docs/contract.md follow from these two.

A monitor is a pure function of arrays on the satellite axis. It is told what to look at and its threshold, and returns
a :class:`~gbas_ground.monitors.result.MonitorResult`: statistic, threshold and the mask of what failed. What a monitor
has to remember between epochs is a frozen state it is given and gives back. What follows from a failure is not its
business but the executive's (:mod:`gbas_ground.exclusions`).

===================================  ==========================================================
:mod:`~.expected_range`              raw pseudorange against the expected one
:mod:`~.signal_power`                C/N0: absolute minimum
:mod:`~.expected_power`              C/N0 against the expectation at the elevation
:mod:`~.b_value`                     B values (MRCC)
:mod:`~.sigma_monitor`               mean and variance of the B values over time
:mod:`~.correction_limits`           size of PRC and RRC
:mod:`~.carrier_acceleration`        step, rate and acceleration of the carrier
:mod:`~.carrier_detectability`       which faults of the carrier that finds, and how soon
:mod:`~.common_slip`                 carriers several receivers lose count of at once
:mod:`~.ionosphere_gradient`         double-difference carriers: gradients of the ionosphere
:mod:`~.gradient_coverage`           which of them the baselines see, and what is tested therefore
:mod:`~.gradient_estimates`          gradient vectors and fronts from baselines of several directions
:mod:`~.shared_receiver`             the receiver behind double differences that trip together
:mod:`~.receiver_baselines`          the double differences of an epoch, and the receiver they name
:mod:`~.ephemeris_residual`          double-difference carriers: the orbit, and the P a site can claim
:mod:`~.ephemeris_change`            a new ephemeris against the one before
:mod:`~.ccd`                         code-carrier divergence of single bands (GAST D)
:mod:`~.ccd_f`                       the same on two bands, without ionosphere (proposed for GAST F)
:mod:`~.divergence_suspects`         whose divergence it is: clocks without the satellites under suspicion
:mod:`~.divergence_forms`            the two forms of its test, and their thresholds
:mod:`~.divergence_covariance`       covariance of its statistics, calibrated from data
:mod:`~.divergence_classification`   which of the fifteen fault modes it looks like
===================================  ==========================================================

What they share: the interface (:mod:`~.interface`), :mod:`~.result`, the double differences
(:mod:`~.double_difference`), the sigma of a carrier (:mod:`~.carrier_noise`), the budget of false alarms
(:mod:`~.false_alarm`) and the table of what they measured (:mod:`~.monitor_table`). What baselines can see is in
:mod:`~.gradient_detectability`. Loops that run every epoch, and the formulas that analyses share with them, are
compiled: :mod:`~.kernels`. A monitor of one's own need not be: arrays will do.
"""

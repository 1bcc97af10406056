"""The absolute slant ionosphere gradient monitor and the siting of its receivers.

Source: B. Belabbas, T. Dautermann, M. Felux, M. Rippl, S. Schlüter, V. Wilken, A. Hornbostel, M. Meurer, A GBAS Testbed
to Support New Monitoring Algorithms Development for CAT III Precision Approach.

=======================  ==========================================================================
:mod:`~.testbed`         the receivers of table 1, baselines and angles
:mod:`~.detectability`   figures 4, 5, 9 and 11: detectable gradients over the noise
:mod:`~.optima`          figures 7 and 10, the optima for three and four receivers, grids
:mod:`~.extensions`      more receivers, all baselines, tolerance, L5
:mod:`~.noise`           the statistic under noise: analytic P_fa and P_md, and by Monte Carlo
:mod:`~.projection`      fronts that are not along the runway: projected, and their direction estimated
:mod:`~.coverage`        what a station's monitor detects on the satellites of a day
:mod:`~.recorded`        the monitor on recorded pairs of receivers
:mod:`~.reproduction`    all of it as one report
=======================  ==========================================================================
"""

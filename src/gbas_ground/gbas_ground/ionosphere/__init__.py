"""What the station does about ionospheric fronts for approach service type C: position-domain geometry screening.

A front that has not reached the station is seen by none of its monitors, and a type C aircraft has none of its own: the
worst a front of the threat model may do to the position of any aircraft is computed beforehand, and the broadcast
sigmas are raised until no aircraft whose position would be too wrong still has a protection level below its alert
limit.

- :mod:`~gbas_ground.ionosphere.threat`: the fronts there may be;
- :mod:`~gbas_ground.ionosphere.range_error`: what one of them does to a corrected, smoothed range;
- :mod:`~gbas_ground.ionosphere.places`: where aircraft may be;
- :mod:`~gbas_ground.ionosphere.cases`: what is screened, of one sky;
- :mod:`~gbas_ground.ionosphere.geometry_screening`: what that does to positions, and the least inflation that is safe;
- :mod:`~gbas_ground.ionosphere.protection`: the station's state, renewed each minute;
- :mod:`~gbas_ground.ionosphere.section`: parameters.
"""

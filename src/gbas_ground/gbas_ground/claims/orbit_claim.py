"""What the station can claim of its satellites' orbits: the parameter P of each, at each epoch.

P is the largest error per metre of separation that an orbit error causes which nothing has found. There are three
things it can rest on:

- the station's ephemeris monitor (:mod:`~gbas_ground.monitors.ephemeris_residual`), while it excludes: P follows from
  the satellite's elevation, from the baselines that see it at this epoch, and from the noise of the reference
  satellites it is compared with at this epoch (:func:`orbit_bound`);
- a monitor elsewhere that the configuration names (``ephemeris.external_monitor``), with the P that it supports;
- nothing: one or two receivers, all in a line, or a monitor that only watches. P is then the largest that the message
  carries, and the station's statement says that it is not monitored (:mod:`gbas_ground.claims.broadcast_claims`).

The largest P is a claim too: no orbit error of more than 25 km across the line of sight at 20 000 km. What stands
behind that is not this monitor. A new ephemeris more than 250 m from the old one is refused (type B faults: P of
1.3e-5; the 250 m are uncertain). A satellite that leaves a valid ephemeris by a manoeuvre (type A) needs 1.8 m/s across
the line of sight to get there within the four hours an ephemeris is used, without ever being 150 m from its expected
range (uncertain, ours: nobody has shown it to the probability that P is claimed with). So no service rests on it: a
station that claims type D does not use such satellites, others may be told the same (``ephemeris_residual.required``),
and :func:`~gbas_ground.claims.broadcast_claims.supported_gcid` gives such a station no healthy designator. Data
recorded with one receiver can still be processed with it.

When receivers drop out P grows with the next epoch. A user takes it with the satellite's next turn at the head of a
type 1 message, within 10 s; until then the smaller P holds by what was monitored before, because no orbit goes the
kilometres between the two in seconds.

Source: P = MDE / range and the types of faults as in :mod:`~gbas_ground.monitors.ephemeris_residual` (known); the 250 m
(uncertain); the turn at the head of the message within 10 s (known). That the largest value stands for "not monitored"
is ours: the message has no code for it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from gbas_core.compiled import compiled
from gbas_core.record import BoolArray, FloatArray
from gbas_ground.claims.limits import MAX_DECORRELATION
from gbas_ground.monitors.carrier_noise import CarrierNoise
from gbas_ground.monitors.double_difference import Baselines, DoubleDifferences
from gbas_ground.monitors.ephemeris_residual import EphemerisResidualParams, assumed_sigma_m, site_decorrelation

DECORRELATION_STEP: Final = 5.0e-6
"""Step of it in the messages [m/m]."""

_NODES_RAD: Final = np.radians(np.arange(0.0, 91.0))
_AZIMUTHS_RAD: Final = np.radians(np.arange(0.0, 360.0, 5.0))
_BETWEEN_AZIMUTHS: Final = 1.001  # the largest P lies between two azimuths by at most 0.03 % (bench and demo sites)


@dataclass(frozen=True, kw_only=True, eq=False)
class OrbitSite:
    """What the claim needs to know of a station; made once.

    Attributes
    ----------
    baselines : Baselines
    noise : CarrierNoise
    monitor : EphemerisResidualParams
        Its first band is the one that counts, so that P holds for satellites without a second one.
    """

    baselines: Baselines
    noise: CarrierNoise
    monitor: EphemerisResidualParams
    _tables: dict[bytes, FloatArray] = field(default_factory=dict, repr=False)  # by the baselines that see


def supported_decorrelation(site: OrbitSite, elevation_rad: FloatArray, seen: BoolArray | None = None) -> FloatArray:
    """P that the station's monitor supports at elevations, whatever the azimuth.

    Parameters
    ----------
    site : OrbitSite
    elevation_rad : (N,) array
    seen : (B,) bool array, optional
        Baselines that see the satellite; all if it is left out.

    Returns
    -------
    (N,) array
        [m/m]: the larger one at the two whole degrees around the elevation; infinite where nothing bounds an orbit, and
        for an elevation that is not known.
    """
    given = np.ones(len(site.baselines), dtype=bool) if seen is None else seen
    key = given.tobytes()
    table = site._tables.get(key)
    if table is None:
        table = site._tables[key] = _table(site, given)
    degrees = np.degrees(elevation_rad)
    known = (degrees >= 0.0) & (degrees <= 90.0)
    return np.where(known, table[np.where(known, degrees, 0.0).astype(np.int64)], np.inf)


def _table(site: OrbitSite, seen: BoolArray) -> FloatArray:
    """The largest P over all azimuths between a whole degree of elevation and the next, (91,)."""
    elevation, azimuth = (each.ravel() for each in np.meshgrid(_NODES_RAD, _AZIMUTHS_RAD, indexing="ij"))
    found = site_decorrelation(site.baselines, elevation, azimuth, site.noise, site.monitor, seen=seen)
    nodes = _BETWEEN_AZIMUTHS * found.reshape(len(_NODES_RAD), -1).max(axis=1)
    return np.asarray(np.maximum(nodes, np.append(nodes[1:], nodes[-1])))


def orbit_bound(differences: DoubleDifferences, elevation_rad: FloatArray, site: OrbitSite) -> FloatArray:
    """P that the monitor supports at one epoch, with the baselines and reference satellites there are.

    Parameters
    ----------
    differences : DoubleDifferences
        What the monitor looked at, of `site.baselines` and its bands.
    elevation_rad : (N,) array
    site : OrbitSite

    Returns
    -------
    (N,) array
        [m/m]; infinite for satellites it did not see, or not in two directions.

    Notes
    -----
    P is proportional to the thresholds. Where the references of the epoch are noisier than those the site's P is
    reckoned with, P grows by the worst baseline's ratio.
    """
    bound = np.full(elevation_rad.shape, np.inf)
    count = len(site.baselines)
    if count < 2:
        return bound
    seen = np.isfinite(differences.residual_m[:, 0])
    there = np.flatnonzero(np.logical_or.reduce(seen))
    if not there.size:
        return bound
    seen, elevation_rad = seen.take(there, axis=1), elevation_rad.take(there)
    sigma = np.fmax(differences.sigma_m[:, 0], differences.nominal_sigma_m[:, 0]).take(there, axis=1)
    ratio = sigma / assumed_sigma_m(site.baselines, elevation_rad, site.noise, site.monitor)
    excess = np.maximum.reduce(np.where(seen, ratio, 1.0), initial=1.0)
    code = (1 << np.arange(count)) @ seen
    for each in set(code.tolist()):
        here = np.flatnonzero(code == each)
        bound[there[here]] = excess[here] * supported_decorrelation(site, elevation_rad[here], seen[:, here[0]])
    return bound


@compiled
def claimed_decorrelation(supported: FloatArray, least: float, external: bool = False) -> FloatArray:
    """P as it is broadcast, in steps of the message, rounded up.

    Parameters
    ----------
    supported : (N,) array
        By the station's monitor, :func:`orbit_bound` [m/m].
    least : float
        Configured value: never less than this [m/m].
    external : bool
        Whether `least` is what a monitor elsewhere supports: then it is P.

    Returns
    -------
    (N,) array
        [m/m]; the largest that the message carries where more would be needed.
    """
    claimed = np.empty(len(supported))
    for i in range(len(supported)):
        claimed[i] = claimed_decorrelation_of(supported[i], least, external)
    return claimed


@compiled
def claimed_decorrelation_of(supported: float, least: float, external: bool) -> float:
    """:func:`claimed_decorrelation` of one satellite."""
    wanted = least if external or supported < least else supported
    bounded = wanted if wanted <= MAX_DECORRELATION else MAX_DECORRELATION
    return math.ceil(bounded / DECORRELATION_STEP - 1e-6) * DECORRELATION_STEP


def refuse_smaller(key: str, value: float, site: OrbitSite, mask_rad: float, *, excludes: bool) -> None:
    """Complain of a configured P that the station's monitor does not support at the elevation mask.

    Raises
    ------
    ValueError
        Naming the key, its value and the bound. 0 is no claim: P follows from the monitor.
    """
    if value == 0.0 or value == MAX_DECORRELATION:
        return
    largest = float(supported_decorrelation(site, np.array([mask_rad]))[0]) if excludes else np.inf
    if value >= largest and largest <= MAX_DECORRELATION:
        return
    if not excludes:
        why = "nothing: ephemeris_residual.exclude is false"
    elif np.isinf(largest):
        why = f"nothing: {len(site.baselines)} baselines do not bound an orbit in two directions"
    else:
        why = f"{largest:.3g} at {np.degrees(mask_rad):g} deg"
    raise ValueError(
        f"{key} = {value:g} is below what the site's monitor supports ({why}); without {key} it follows from the "
        "monitor, and a monitor elsewhere is named by ephemeris.external_monitor"
    )

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
from functools import cached_property
from typing import Final

import numpy as np

from gbas_core.compiled import compiled
from gbas_core.record import BoolArray, FloatArray, IntArray
from gbas_ground.claims.limits import MAX_DECORRELATION
from gbas_ground.monitors.carrier_noise import CarrierNoise
from gbas_ground.monitors.double_difference import Baselines, DoubleDifferences
from gbas_ground.monitors.ephemeris_residual import (
    REFERENCE_ELEVATION_RAD,
    EphemerisResidualParams,
    site_decorrelation,
)
from gbas_ground.monitors.kernels import gradient as kernels

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

    @cached_property
    def rows(self) -> IntArray:
        """Places of the baselines."""
        return np.arange(len(self.baselines))

    @cached_property
    def scale(self) -> FloatArray:
        """How the noise of the baselines compares, ``(B,)``."""
        factors = self.noise.factors(len(self.baselines.place_m))
        return np.asarray(np.hypot(factors[self.baselines.first], factors[self.baselines.second]))

    @cached_property
    def reference_m(self) -> float:
        """Sigma of the lowest reference satellite that is reckoned with [m]."""
        return float(self.noise.sigma_m(np.array([REFERENCE_ELEVATION_RAD]), self.monitor.bands[:1])[0, 0])


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
    table = _known_table(site, np.ones(len(site.baselines), dtype=bool) if seen is None else seen)
    return np.array([kernels.supported(float(each), table) for each in elevation_rad])


def _known_table(site: OrbitSite, seen: BoolArray) -> FloatArray:
    """:func:`_table`, made once."""
    key = seen.tobytes()
    if key not in site._tables:
        site._tables[key] = _table(site, seen)
    return site._tables[key]


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
    if len(site.baselines) < 2:
        return bound
    code, excess = np.empty(bound.shape, dtype=np.int64), np.empty(bound.shape)
    (own_m,) = site.noise.sigma_m(elevation_rad, site.monitor.bands[:1])
    residual_m, sigma_m, nominal_m, _ = differences
    kernels.noise_excess(residual_m, sigma_m, nominal_m, own_m, site.scale, site.reference_m, code, excess)
    for each in set(code.tolist()) - {0}:  # type: ignore[call-overload]
        table = _known_table(site, (each >> site.rows & 1) > 0)
        kernels.bound_by(bound, code, each, excess, elevation_rad, table)
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

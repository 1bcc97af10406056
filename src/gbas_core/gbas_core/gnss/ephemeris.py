# mypy: disable-error-code="no-untyped-call"
"""Broadcast ephemerides on the satellite axis."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gbas_core.compiled import compiled
from gbas_core.gnss.gpstime import SECONDS_PER_WEEK
from gbas_core.record import FloatArray, Record, columns_of, per_satellite, scalar
from gbas_core.satellites import IS_GPS, N_SATS, missing


class NavigationMessage(IntEnum):
    """The navigation message an ephemeris came from."""

    GPS_LNAV = 0
    GALILEO_INAV = 1
    GALILEO_FNAV = 2


@dataclass(frozen=True, kw_only=True, eq=False)
class Ephemeris(Record):
    """At most one broadcast ephemeris per satellite; the record's epoch is when they were received.

    Source of the fields: IS-GPS-200N tables 20-I to 20-III; Galileo OS SIS ICD 2.1 tables 58, 60 and 71.
    """

    simulated: float = scalar("-", "1 if a simulator made these ephemerides, 0 if they were recorded")
    message: FloatArray = per_satellite("-", "NavigationMessage")
    iod: FloatArray = per_satellite("-", "issue of data: IODE or IODnav")
    iodc: FloatArray = per_satellite("-", "issue of data, clock; NaN for Galileo")
    toe_week: FloatArray = per_satellite("week", "GPS week of the time of ephemeris")
    toe_tow_s: FloatArray = per_satellite("s", "time of ephemeris")
    toc_week: FloatArray = per_satellite("week", "GPS week of the time of clock")
    toc_tow_s: FloatArray = per_satellite("s", "time of clock")
    sqrt_a: FloatArray = per_satellite("m^0.5", "square root of the semi-major axis")
    e: FloatArray = per_satellite("-", "eccentricity")
    m0_rad: FloatArray = per_satellite("rad", "mean anomaly at toe")
    delta_n_radps: FloatArray = per_satellite("rad/s", "mean motion difference")
    omega0_rad: FloatArray = per_satellite("rad", "longitude of the ascending node at weekly epoch")
    i0_rad: FloatArray = per_satellite("rad", "inclination at toe")
    omega_rad: FloatArray = per_satellite("rad", "argument of perigee")
    omega_dot_radps: FloatArray = per_satellite("rad/s", "rate of right ascension")
    idot_radps: FloatArray = per_satellite("rad/s", "rate of inclination")
    cuc_rad: FloatArray = per_satellite("rad", "argument of latitude, cosine")
    cus_rad: FloatArray = per_satellite("rad", "argument of latitude, sine")
    crc_m: FloatArray = per_satellite("m", "orbit radius, cosine")
    crs_m: FloatArray = per_satellite("m", "orbit radius, sine")
    cic_rad: FloatArray = per_satellite("rad", "inclination, cosine")
    cis_rad: FloatArray = per_satellite("rad", "inclination, sine")
    af0_s: FloatArray = per_satellite("s", "clock bias")
    af1_sps: FloatArray = per_satellite("s/s", "clock drift")
    af2_sps2: FloatArray = per_satellite("s/s^2", "clock drift rate")
    group_delay_s: FloatArray = per_satellite("s", "GPS TGD; Galileo BGD(E1,E5a)")
    group_delay_e5b_s: FloatArray = per_satellite("s", "Galileo BGD(E1,E5b); NaN for GPS")
    health: FloatArray = per_satellite("-", "signal health, 0 is healthy")
    accuracy_m: FloatArray = per_satellite("m", "URA or SISA")

    @cached_property
    def values(self) -> FloatArray:
        """All fields of all satellites, ``(fields, N_SATS)``, in the order of :data:`FIELDS`. Not to be written to."""
        return np.array([getattr(self, name) for name in FIELDS], dtype=np.float64)

    def same_as(self, other: Ephemeris) -> NDArray[np.bool_]:
        """Satellites of which both say the same, field by field, or nothing: ``(N_SATS,)``."""
        ours, theirs = self.values, other.values
        return np.asarray(((ours == theirs) | (np.isnan(ours) & np.isnan(theirs))).all(axis=0))


VALIDITY_S: Final[FloatArray] = np.where(IS_GPS, 2 * 3600.0, 4 * 3600.0)
"""Largest |t - toe| an ephemeris is used at, on the satellite axis.

Source: GPS, half of the fit interval of 4 h (IS-GPS-200N 20.3.4.4); Galileo, 4 h (OS Service Definition Document).
"""
STORE_DEPTH: Final = 4
VDB_IOD_MODULUS: Final = 256
"""The VDB has eight bits for an issue of data (Annex 10 vol. I, B.3.6.4.2: IOD)."""

FIELDS: Final[tuple[str, ...]] = tuple(item.name for item, spec in columns_of(Ephemeris) if spec.satellite)
"""Names of the per-satellite fields of :class:`Ephemeris`, in order."""
_ROW: Final[dict[str, int]] = {name: row for row, name in enumerate(FIELDS)}
# Rows of the store after the ephemeris' own fields.
_RECEIVED_WEEK: Final = len(FIELDS)
_RECEIVED_TOW: Final = _RECEIVED_WEEK + 1
_IOD, _TOE_WEEK, _TOE_TOW, _HEALTH = (_ROW[name] for name in ("iod", "toe_week", "toe_tow_s", "health"))
_SIMULATED: Final = _RECEIVED_WEEK + 2
_COMPLETE: Final = _RECEIVED_WEEK + 3
_N_ROWS: Final = _RECEIVED_WEEK + 4


def is_complete(ephemeris: Ephemeris) -> NDArray[np.bool_]:
    """Mask ``(N_SATS,)`` of the satellites with everything their message should hold.

    GPS LNAV has no BGD(E1,E5b), Galileo no IODC, F/NAV no BGD(E1,E5b). GPS is complete without an accuracy, which
    nothing is computed from; Galileo is not, since a satellite without an accuracy prediction is marginal (Galileo OS
    Service Definition Document 1.3, 2.3.1.4).
    """
    finite = np.isfinite(ephemeris.values)
    message = ephemeris.message
    finite[_ROW["accuracy_m"]] |= message == NavigationMessage.GPS_LNAV
    finite[_ROW["iodc"]] |= message != NavigationMessage.GPS_LNAV
    finite[_ROW["group_delay_e5b_s"]] |= message != NavigationMessage.GALILEO_INAV
    own_message = np.where(IS_GPS, message == NavigationMessage.GPS_LNAV, message != NavigationMessage.GPS_LNAV)
    return np.asarray(finite.all(axis=0) & own_message)


@dataclass(frozen=True, kw_only=True, eq=False)
class EphemerisStore:
    """The ephemerides received so far, the last few of each satellite. Frozen: adding makes a new store.

    Attributes
    ----------
    values : (STORE_DEPTH, rows, N_SATS) array
        Newest first: the fields of :class:`Ephemeris` and when each was received. Not to be written to.
    """

    values: FloatArray = field(default_factory=lambda: _read_only(missing(STORE_DEPTH, _N_ROWS)))
    _chosen: dict[bytes, Ephemeris] = field(default_factory=dict, init=False, repr=False)
    """The last choice: it is asked for at every epoch and changes with the hour."""

    def add(self, ephemeris: Ephemeris) -> EphemerisStore:
        """Store with the ephemerides of one reception added; one that is stored already changes nothing.

        To be added in order of reception and as time goes on: of each satellite only the last STORE_DEPTH are kept.
        """
        new = np.full((_N_ROWS, N_SATS), np.nan)
        new[: len(FIELDS)] = ephemeris.values
        new[_RECEIVED_WEEK] = ephemeris.gps_week
        new[_RECEIVED_TOW] = ephemeris.tow_s
        new[_SIMULATED] = ephemeris.simulated
        new[_COMPLETE] = is_complete(ephemeris)
        present = np.isfinite(ephemeris.message)
        old, fields = self.values[:, : len(FIELDS)], new[: len(FIELDS)]
        known = ((old == fields) | (np.isnan(old) & np.isnan(fields))).all(axis=1).any(axis=0)
        push = present & ~known
        if not push.any():
            return self
        shifted = np.concatenate([new[np.newaxis], self.values[:-1]])
        return EphemerisStore(values=_read_only(np.where(push, shifted, self.values)))

    def usable(self, gps_week: int, tow_s: float, settle_s: float) -> Ephemeris:
        """The ephemeris of each satellite to use at a time: the latest received that has settled.

        Parameters
        ----------
        gps_week, tow_s
            The time.
        settle_s : float
            How long ago an ephemeris must have been received [s].

        Returns
        -------
        Ephemeris
            The same object while the choice is the same; its epoch is when it was first made. A satellite is missing
            (NaN) without an ephemeris that was received at least `settle_s` ago, is complete and within
            :data:`VALIDITY_S`; and whenever the newest ephemeris received, settled or not, does not say that the
            satellite is healthy.
        """
        chosen = choose_settled(self.values, VALIDITY_S, int(gps_week), float(tow_s), float(settle_s))
        return self._ephemeris(chosen, gps_week, tow_s)

    def matching(self, iod: FloatArray, gps_week: int, tow_s: float) -> Ephemeris:
        """The ephemeris of each satellite with the given issue of data ``(N_SATS,)``; missing as in :meth:`usable`.

        The issue of data is compared as the VDB carries it: eight bits, the lower ones of Galileo's IODnav.
        """
        chosen = choose_matching(self.values, VALIDITY_S, int(gps_week), float(tow_s), np.array(iod, dtype=np.float64))
        return self._ephemeris(chosen, gps_week, tow_s)

    def _ephemeris(self, chosen: NDArray[np.int64], gps_week: int, tow_s: float) -> Ephemeris:
        """The ephemerides at the given depths, missing where the depth is -1."""
        choice = chosen.tobytes()
        if choice not in self._chosen:
            picked = np.full((_N_ROWS, N_SATS), np.nan)
            for satellite in np.flatnonzero(chosen >= 0):
                picked[:, satellite] = self.values[chosen[satellite], :, satellite]
            simulated = float((picked[_SIMULATED] > 0.0).any()) if (chosen >= 0).any() else float("nan")
            fields = dict(zip(FIELDS, picked, strict=False))
            self._chosen.clear()
            self._chosen[choice] = Ephemeris(gps_week=gps_week, tow_s=tow_s, simulated=simulated, **fields)
        return self._chosen[choice]


def _read_only(values: FloatArray) -> FloatArray:
    values.flags.writeable = False
    return values


@compiled
def choose_settled(values, validity_s, gps_week, tow_s, settle_s):  # type: ignore[no-untyped-def]
    """Depth of the ephemeris of each satellite that :meth:`EphemerisStore.usable` finds, -1 for none."""
    chosen = np.empty(values.shape[2], np.int64)
    for s in range(values.shape[2]):
        chosen[s] = _youngest(values, s, validity_s[s], gps_week, tow_s, settle_s, np.nan)
    return chosen


@compiled
def choose_matching(values, validity_s, gps_week, tow_s, iod):  # type: ignore[no-untyped-def]
    """The same of :meth:`EphemerisStore.matching`."""
    chosen = np.full(values.shape[2], -1)
    for s in range(values.shape[2]):
        if np.isfinite(iod[s]):
            chosen[s] = _youngest(values, s, validity_s[s], gps_week, tow_s, 0.0, iod[s] % VDB_IOD_MODULUS)
    return chosen


@compiled
def _youngest(values, s, validity_s, gps_week, tow_s, settle_s, iod):  # type: ignore[no-untyped-def]
    """Depth of the youngest ephemeris of a satellite that is received, settled, complete, valid, healthy and not taken
    back by a younger one; of a given issue of data, if that is not NaN. -1 for none.
    """
    best, newest, best_s, newest_s = -1, 0, np.inf, np.inf
    for depth in range(values.shape[0]):
        weeks = gps_week - values[depth, _RECEIVED_WEEK, s]
        age_s = weeks * SECONDS_PER_WEEK + (tow_s - values[depth, _RECEIVED_TOW, s])
        if age_s >= 0.0 and age_s < newest_s:
            newest, newest_s = depth, age_s
        weeks = gps_week - values[depth, _TOE_WEEK, s]
        since_toe_s = weeks * SECONDS_PER_WEEK + (tow_s - values[depth, _TOE_TOW, s])
        usable = age_s >= settle_s and abs(since_toe_s) <= validity_s and values[depth, _COMPLETE, s] == 1.0
        usable = usable and (np.isnan(iod) or values[depth, _IOD, s] % VDB_IOD_MODULUS == iod)
        if usable and age_s < best_s:
            best, best_s = depth, age_s
    if best < 0 or values[best, _HEALTH, s] != 0.0 or values[newest, _HEALTH, s] != 0.0:
        return -1
    return best

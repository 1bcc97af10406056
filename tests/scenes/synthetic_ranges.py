"""A made-up constellation and noise-free observations of it: expected values are known by construction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gbas_core.gnss.ephemeris import Ephemeris, NavigationMessage
from gbas_core.gnss.frames import ecef_from_geodetic, rot_enu_ecef
from gbas_core.gnss.observations import ObservationEpoch
from gbas_core.gnss.orbits import predicted_state, rotated_range
from gbas_core.record import FloatArray
from gbas_core.satellites import IS_GPS, N_SATS, missing
from gbas_core.signals import L1, N_BANDS, SPEED_OF_LIGHT_MPS

WEEK, TOW_S = 2300, 302_400.0
LATITUDE_RAD, LONGITUDE_RAD, HEIGHT_M = np.radians(52.32), np.radians(10.55), 130.0
REFERENCE_M = ecef_from_geodetic(LATITUDE_RAD, LONGITUDE_RAD, HEIGHT_M)


def receiver_positions_m(count: int) -> FloatArray:
    """Up to four antennas within 600 m of the reference point, ECEF, ``(count, 3)``."""
    enu = np.array([[300.0, 120.0, 2.0], [-400.0, 60.0, 3.0], [20.0, -500.0, 1.0], [150.0, 380.0, 4.0]])
    return REFERENCE_M + enu[:count] @ rot_enu_ecef(LATITUDE_RAD, LONGITUDE_RAD)


def constellation(week: int = WEEK, tow_s: float = TOW_S, *, iod: int = 17, systems: str = "GE") -> Ephemeris:
    """Ephemerides of 30 GPS and 30 Galileo satellites in evenly filled planes, received and of reference time now."""
    number = np.arange(N_SATS, dtype=np.float64)
    slot = np.where(IS_GPS, number, number - 32)
    here = (slot < 30) & ((IS_GPS & ("G" in systems)) | (~IS_GPS & ("E" in systems)))
    plane, place = slot % 6, slot // 6
    values = {
        "message": np.where(IS_GPS, float(NavigationMessage.GPS_LNAV), float(NavigationMessage.GALILEO_INAV)),
        "iod": np.full(N_SATS, float(iod)),
        "iodc": np.where(IS_GPS, float(iod), np.nan),
        "toe_week": np.full(N_SATS, float(week)),
        "toe_tow_s": np.full(N_SATS, tow_s),
        "toc_week": np.full(N_SATS, float(week)),
        "toc_tow_s": np.full(N_SATS, tow_s),
        "sqrt_a": np.where(IS_GPS, 5153.7, 5440.6),
        "e": 0.001 + 0.0005 * (slot % 7),
        "m0_rad": (2.0 * np.pi * place / 5.0 + 0.3 * plane + np.where(IS_GPS, 0.0, 0.5)) % np.pi,
        "delta_n_radps": np.full(N_SATS, 4.5e-9),
        "omega0_rad": 2.0 * np.pi * plane / 6.0 - np.pi + np.where(IS_GPS, 0.1, 0.6),
        "i0_rad": np.full(N_SATS, np.radians(55.5)),
        "omega_rad": (2.0 * np.pi * place / 5.0) % np.pi,
        "omega_dot_radps": np.full(N_SATS, -8.0e-9),
        "idot_radps": np.full(N_SATS, 1.0e-10),
        "af0_s": 1e-5 * (slot - 15.0),
        "af1_sps": 1e-12 * (slot % 5),
        "af2_sps2": np.zeros(N_SATS),
        "group_delay_s": np.full(N_SATS, -1.1e-8),
        "group_delay_e5b_s": np.where(IS_GPS, np.nan, 2.0e-9),
        "health": np.zeros(N_SATS),
        "accuracy_m": np.full(N_SATS, 2.4),
    }
    for name in ("cuc_rad", "cus_rad", "cic_rad", "cis_rad"):
        values[name] = np.full(N_SATS, 2.0e-6)
    values["crc_m"], values["crs_m"] = np.full(N_SATS, 200.0), np.full(N_SATS, 30.0)
    arrays = {name: np.where(here, value, np.nan) for name, value in values.items()}
    return Ephemeris(gps_week=week, tow_s=tow_s, simulated=1.0, **arrays)


@dataclass(frozen=True, kw_only=True)
class Truth:
    """What receivers at known places measure of a constellation: geometry, clocks, and what a test adds."""

    ephemeris: Ephemeris
    positions_m: FloatArray
    clock_s: FloatArray  # (R,) receiver clocks

    def range_m(self, week: int, tow_s: float) -> FloatArray:
        """Pseudoranges ``(R, N)`` without errors; the time tag is the receivers' own. NaN below the horizon."""
        tow = tow_s - self.clock_s[:, np.newaxis]
        state = predicted_state(self.ephemeris, week, tow, self.positions_m)
        range_m, los = rotated_range(self.positions_m, state.position_m)
        up = np.einsum("j,rjn->rn", rot_enu_ecef(LATITUDE_RAD, LONGITUDE_RAD)[2], los)
        clocks = self.clock_s[:, np.newaxis] - state.clock_s
        return np.where(up > 0.0, range_m + SPEED_OF_LIGHT_MPS * clocks, np.nan)

    def observe(
        self,
        week: int,
        tow_s: float,
        *,
        code_error_m: FloatArray | float = 0.0,
        carrier_error_m: FloatArray | float | None = None,
        cn0_dbhz: float = 45.0,
    ) -> tuple[ObservationEpoch, ...]:
        """Observations of all receivers on L1.

        The errors broadcast to ``(R, N)``; the carrier has that of the code unless told otherwise.
        """
        range_m = self.range_m(week, tow_s)
        carrier_error = code_error_m if carrier_error_m is None else carrier_error_m
        code, carrier = range_m + code_error_m, range_m + carrier_error + 1000.0
        return tuple(self._epoch(week, tow_s, c, p, cn0_dbhz) for c, p in zip(code, carrier, strict=True))

    @staticmethod
    def _epoch(week: int, tow_s: float, code: FloatArray, carrier: FloatArray, cn0_dbhz: float) -> ObservationEpoch:
        arrays = {name: missing(N_BANDS) for name in ("code_m", "carrier_m", "cn0_dbhz", "lli")}
        arrays["code_m"][L1], arrays["carrier_m"][L1] = code, carrier
        arrays["cn0_dbhz"][L1] = np.where(np.isfinite(code), cn0_dbhz, np.nan)
        arrays["lli"][L1] = np.where(np.isfinite(code), 0.0, np.nan)
        return ObservationEpoch(gps_week=week, tow_s=tow_s, simulated=1.0, **arrays)


def truth(receivers: int, *, systems: str = "GE", clock_s: tuple[float, ...] = (1e-4, -3e-4, 2e-5, 0.0)) -> Truth:
    """Truth for the first `receivers` antennas."""
    return Truth(
        ephemeris=constellation(systems=systems),
        positions_m=receiver_positions_m(receivers),
        clock_s=np.array(clock_s[:receivers]),
    )

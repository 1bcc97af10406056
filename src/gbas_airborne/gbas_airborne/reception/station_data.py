"""What the station's messages say, in the units of the position: station data, corrections, approach, ephemeris checks.

Source: ICAO Annex 10 vol. I, App. B 3.6.4 and 3.6.5.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from typing import Final

import numpy as np

from gbas_airborne.reception.columns import B_VALUES, IOD, LISTED, PRC, RRC, SIGMA
from gbas_core.gnss.frames import ecef_from_geodetic
from gbas_core.positioning.approach import FinalApproach
from gbas_core.record import FloatArray
from gbas_core.satellites import SOURCE_ID_INDEX, missing
from gbas_msgs_py.records import MAX_REFERENCE_RECEIVERS
from gbas_vdb.messages.types import AdditionalBlock3, Correction100, FasDataSet, Type2

# Known (ICAO Annex 10 vol. I, table B-65): 1 to 4 are healthy, 7 is unhealthy; 0, 5 and 6 mean nothing and give no
# service.
HEALTHY_GCID: Final = (1, 2, 3, 4)


@dataclass(frozen=True, kw_only=True, eq=False)
class StationData:
    """Type 2 message in the units of the position; NaN where the station does not provide a value."""

    reference_ecef_m: FloatArray
    reference_height_m: float
    n_receivers: int
    gcid: int
    sigma_vig: float
    refractivity: float
    refractivity_uncertainty: float
    scale_height_m: float
    d_max_m: float
    k_md_e: float
    rsds: int | None
    slots: tuple[int, ...] | None
    k_md_e_d: float = math.nan
    sigma_vig_d: float = math.nan
    y_eig_m: float = math.nan
    m_eig: float = math.nan

    @property
    def healthy(self) -> bool:
        """Whether the station's continuity/integrity designator allows any service."""
        return self.gcid in HEALTHY_GCID


@dataclass(frozen=True, kw_only=True, eq=False)
class Corrections:
    """A complete set of corrections of one product (one message, or a linked pair) on the satellite axis.

    `gps_week`, `tow_s` are the modified Z-count, resolved, `received` is the start of the frame it came in. The sigma
    is NaN where the correction is invalid, `listed` is 1 where there is one at all.
    """

    gps_week: int
    tow_s: float
    received: tuple[int, float]
    columns: FloatArray
    """``(rows, N_SATS)``: listed, issue of data, PRC [m], RRC [m/s], sigma [m], and a B value [m] for each receiver."""

    @property
    def listed(self) -> FloatArray:
        """1 where there is a correction."""
        return self._row(LISTED)

    @property
    def iod(self) -> FloatArray:
        """Issues of data of the corrections' ephemerides."""
        return self._row(IOD)

    @property
    def prc_m(self) -> FloatArray:
        """PRC [m]."""
        return self._row(PRC)

    @property
    def rrc_mps(self) -> FloatArray:
        """RRC [m/s]."""
        return self._row(RRC)

    @property
    def sigma_m(self) -> FloatArray:
        """Sigmas of the corrections [m]."""
        return self._row(SIGMA)

    def _row(self, place: int) -> FloatArray:
        row: FloatArray = self.columns[place]
        return row

    @property
    def b_m(self) -> FloatArray:
        """B values ``(MAX_REFERENCE_RECEIVERS, N_SATS)`` [m]."""
        b_m: FloatArray = self.columns[B_VALUES:]
        return b_m


@dataclass(frozen=True, kw_only=True, eq=False)
class EphemerisChecks:
    """What type 1 messages said about ephemerides, per satellite: the last issue of data, its CRC and P.

    These are the rows of `columns`, ``(3, N_SATS)``.
    """

    columns: FloatArray = field(default_factory=lambda: missing(3))

    @property
    def iod(self) -> FloatArray:
        """Issues of data."""
        row: FloatArray = self.columns[0]
        return row

    @property
    def crc(self) -> FloatArray:
        """CRCs of the ephemerides with these."""
        row: FloatArray = self.columns[1]
        return row

    @property
    def p(self) -> FloatArray:
        """P, decorrelation of the ephemeris error [m/m]."""
        row: FloatArray = self.columns[2]
        return row


def correction_set(
    z_count: tuple[int, float], received: tuple[int, float], measurements: tuple[Correction100, ...]
) -> Corrections:
    """Corrections on the satellite axis; sources the suite does not know are left out.

    A source listed twice contradicts itself: its sigma becomes NaN, so that it is not used.
    """
    known = [(SOURCE_ID_INDEX[m.ranging_source_id], m) for m in measurements if m.ranging_source_id in SOURCE_ID_INDEX]
    columns = missing(B_VALUES + MAX_REFERENCE_RECEIVERS)
    if known:
        index = [number for number, _ in known]
        rows = [(1.0, m.iod, m.prc_m, m.rrc_mps, m.sigma_pr_gnd_m, *m.b_values_m) for _, m in known]
        columns[:, index] = np.array(rows, dtype=np.float64).T
        if len(set(index)) != len(index):
            columns[SIGMA, [number for number in index if index.count(number) > 1]] = np.nan
    return Corrections(gps_week=z_count[0], tow_s=z_count[1], received=received, columns=columns)


def station_data(message: Type2) -> StationData:
    """What a type 2 message says."""
    adb1 = message.adb1
    # A multiplier of zero would bound nothing: the station does not provide it. The message has none for Galileo; the
    # suite's stations mean both constellations by the GPS one.
    k_md_e = adb1.k_md_e_c_gps if adb1 is not None and adb1.k_md_e_c_gps > 0.0 else math.nan
    return StationData(
        reference_ecef_m=ecef_from_geodetic(message.latitude_rad, message.longitude_rad, message.ellipsoid_height_m),
        reference_height_m=message.ellipsoid_height_m,
        n_receivers=message.n_reference_receivers or 1,
        gcid=message.gcid,
        sigma_vig=message.sigma_vert_iono_gradient,
        refractivity=message.refractivity_index,
        refractivity_uncertainty=message.refractivity_uncertainty,
        scale_height_m=message.scale_height_m,
        d_max_m=adb1.d_max_m if adb1 is not None else math.inf,
        k_md_e=k_md_e,
        rsds=adb1.reference_station_data_selector if adb1 is not None else None,
        slots=message.adb4.slots if message.adb4 is not None else None,
        **_service_d(message.adb3),
    )


def _service_d(block: AdditionalBlock3 | None) -> dict[str, float]:
    """What GAST-D adds; as for C, a multiplier of zero is none."""
    if block is None:
        return {}
    return {
        "k_md_e_d": block.k_md_e_d_gps if block.k_md_e_d_gps > 0.0 else math.nan,
        "sigma_vig_d": block.sigma_vert_iono_gradient_d,
        "y_eig_m": block.y_eig_m,
        "m_eig": block.m_eig,
    }


def final_approach(data_set: FasDataSet) -> FinalApproach:
    """The approach a FAS data set describes.

    Raises
    ------
    ValueError
        When a number is out of the approach's bounds.
    """
    fas = data_set.fas
    runway = f"{fas.runway_number:02d}{fas.runway_letter}" if fas.runway_number else ""
    return FinalApproach(
        ltp_lat_rad=fas.ltp_latitude_rad,
        ltp_lon_rad=fas.ltp_longitude_rad,
        ltp_height_m=fas.ltp_height_m,
        delta_fpap_lat_rad=fas.delta_fpap_latitude_rad,
        delta_fpap_lon_rad=fas.delta_fpap_longitude_rad,
        tch_m=fas.tch_m,
        gpa_rad=fas.gpa_rad,
        course_width_m=fas.semi_width_m,
        delta_length_offset_m=fas.delta_length_offset_m,
        fasval_m=data_set.fasval_m,
        faslal_m=data_set.faslal_m,
        apd=fas.approach_performance_designator,
        airport_id=fas.airport_id,
        runway=runway,
        route=fas.route_indicator,
        rpi=fas.reference_path_identifier,
        rpds=fas.reference_path_data_selector,
    )


def same_approach(approach: FinalApproach | None, other: FinalApproach | None) -> bool:
    """Whether two approaches say the same; a number neither gives (NaN) is the same."""
    if approach is None or other is None:
        return approach is other
    pairs = ((getattr(approach, item.name), getattr(other, item.name)) for item in fields(FinalApproach))
    return all(a == b or (a != a and b != b) for a, b in pairs)

"""The VDB messages in physical units (SI, radians). Missing is NaN for quantities and None for designators.

Every record is frozen and compares by value (NaN is equal to NaN only where it is the same object, as `math.nan`).
The tables in :mod:`gbas_vdb.messages.tables` say how each field travels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True, slots=True)
class Correction100:
    """Measurement block of a type 1 message: 100 s smoothed correction of one ranging source.

    `sigma_pr_gnd_m` NaN marks the correction invalid (code 0xFF); its `prc_m` and `rrc_mps` are then NaN too.
    `b_values_m` has one value per reference receiver, NaN where the receiver was not used (code 0x80).
    """

    ranging_source_id: int
    iod: int
    prc_m: float
    rrc_mps: float
    sigma_pr_gnd_m: float
    b_values_m: tuple[float, float, float, float]


@dataclass(frozen=True, kw_only=True, slots=True)
class Type1:
    """Pseudorange corrections, 100 s smoothing.

    The ephemeris decorrelation P [m/m], the ephemeris CRC and the source availability belong to the first measurement's
    satellite. Without measurements they are NaN and None. `additional_message_flag` is 0 for a single message, 1 for
    the first and 3 for the second of a linked pair. Availability None is "not provided"; 2540 means "2540 s or more".
    """

    modified_z_count_s: float
    additional_message_flag: int = 0
    measurement_type: int = 0
    ephemeris_decorrelation: float = math.nan
    ephemeris_crc: int | None = None
    source_availability_s: float | None = None
    measurements: tuple[Correction100, ...] = ()


@dataclass(frozen=True, kw_only=True, slots=True)
class Correction30:
    """Measurement block of a type 11 message: 30 s smoothed correction of one ranging source.

    `sigma_pr_gnd_30_m` bounds this correction; `sigma_pr_gnd_d_m` belongs to the type 1 correction of the same source,
    without inflation for anomalous ionosphere. NaN (code 0xFF) marks each invalid.
    """

    ranging_source_id: int
    prc_30_m: float
    rrc_30_mps: float
    sigma_pr_gnd_d_m: float
    sigma_pr_gnd_30_m: float


@dataclass(frozen=True, kw_only=True, slots=True)
class Type11:
    """Pseudorange corrections, 30 s smoothing; the Z-count is that of the type 1 message.

    `ephemeris_decorrelation_d` (P_D, m/m) belongs to the first measurement's satellite, NaN without measurements.
    """

    modified_z_count_s: float
    additional_message_flag: int = 0
    measurement_type: int = 0
    ephemeris_decorrelation_d: float = math.nan
    measurements: tuple[Correction30, ...] = ()


PRIVATE_FORMAT: int = 0x3547
"""How our private test messages begin: the bytes ``G5``; another layout would begin otherwise."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Type8:
    """Pseudorange corrections of a second frequency, in a private test message: the standard has no message for them.

    `measurement_type` 0 is L5/E5a smoothed over 100 s, 1 over 30 s. Z-count, message flag and measurements are those of
    a type 1 message; issue of data, CRC and P of the ephemeris are told there.
    """

    private_format: int = PRIVATE_FORMAT
    modified_z_count_s: float
    additional_message_flag: int = 0
    measurement_type: int = 0
    measurements: tuple[Correction100, ...] = ()


@dataclass(frozen=True, kw_only=True, slots=True)
class AdditionalBlock1:
    """Positioning service and ephemeris missed detection parameters; `d_max_m` is infinite when not limited."""

    reference_station_data_selector: int | None = None
    d_max_m: float = math.inf
    k_md_e_pos_gps: float
    k_md_e_c_gps: float
    k_md_e_pos_glonass: float = 0.0
    k_md_e_c_glonass: float = 0.0


@dataclass(frozen=True, kw_only=True, slots=True)
class AdditionalBlock3:
    """GAST-D parameters. E_IG = y_eig_m + m_eig * distance."""

    k_md_e_d_gps: float
    k_md_e_d_glonass: float = 0.0
    sigma_vert_iono_gradient_d: float
    y_eig_m: float
    m_eig: float


@dataclass(frozen=True, kw_only=True, slots=True)
class AdditionalBlock4:
    """VDB authentication: the slots assigned to the station, slot A is bit 0."""

    slot_group: int

    @property
    def slots(self) -> tuple[int, ...]:
        """The assigned slots, 0 (A) to 7 (H)."""
        return tuple(slot for slot in range(8) if self.slot_group >> slot & 1)


@dataclass(frozen=True, kw_only=True, slots=True)
class UnknownAdditionalBlock:
    """An additional data block the suite does not know, skipped by its length; `data` is what follows its number."""

    number: int
    data: bytes


@dataclass(frozen=True, kw_only=True, slots=True)
class Type2:
    """Station data. `n_reference_receivers` None is "not applicable"; gradients are in m/m."""

    n_reference_receivers: int | None
    ground_accuracy_designator: str | None
    gcid: int
    magnetic_variation_rad: float
    sigma_vert_iono_gradient: float
    refractivity_index: float
    scale_height_m: float
    refractivity_uncertainty: float
    latitude_rad: float
    longitude_rad: float
    ellipsoid_height_m: float
    adb1: AdditionalBlock1 | None = None
    adb3: AdditionalBlock3 | None = None
    adb4: AdditionalBlock4 | None = None
    unknown: tuple[UnknownAdditionalBlock, ...] = ()


@dataclass(frozen=True, kw_only=True, slots=True)
class Type3:
    """Null message: `n_fill_bytes` zero bytes to fill a slot. Receivers ignore it."""

    n_fill_bytes: int


@dataclass(frozen=True, kw_only=True, slots=True)
class FasBlock:
    """Final approach segment data block: the path in space of one approach.

    `tch_m` is sent in 0.1 ft steps when `tch_in_feet`. `course_width_m` is the semi-width at the threshold;
    use :attr:`semi_width_m`. `delta_length_offset_m` is NaN when not provided.
    """

    operation_type: int = 0
    sbas_provider: int = 15
    airport_id: str
    runway_number: int
    runway_letter: str = ""
    approach_performance_designator: int
    route_indicator: str = ""
    reference_path_data_selector: int
    reference_path_identifier: str
    ltp_latitude_rad: float
    ltp_longitude_rad: float
    ltp_height_m: float
    delta_fpap_latitude_rad: float
    delta_fpap_longitude_rad: float
    tch_m: float
    tch_in_feet: bool = False
    gpa_rad: float
    course_width_m: float
    delta_length_offset_m: float = math.nan

    @property
    def semi_width_m(self) -> float:
        """Semi-width of the course at the threshold: 38 m by convention for runway number 0."""
        return 38.0 if self.runway_number == 0 else self.course_width_m


@dataclass(frozen=True, kw_only=True, slots=True)
class FasDataSet:
    """A FAS block with its alert limits: `fasval_m` NaN is no vertical guidance, `faslal_m` NaN is "do not use"."""

    fas: FasBlock
    fasval_m: float
    faslal_m: float


@dataclass(frozen=True, kw_only=True, slots=True)
class UnknownDataSet:
    """A data set of another length than a FAS, skipped by its length; `data` is what follows the length byte."""

    data: bytes


@dataclass(frozen=True, kw_only=True, slots=True)
class Type4:
    """Approach data."""

    data_sets: tuple[FasDataSet | UnknownDataSet, ...]


@dataclass(frozen=True, kw_only=True, slots=True)
class PredictedSource:
    """When a ranging source will become available or cease to be; 1270 s means "1270 s or more"."""

    ranging_source_id: int
    becomes_available: bool
    duration_s: float


@dataclass(frozen=True, kw_only=True, slots=True)
class ObstructedApproach:
    """Predicted sources of one approach with an obstructed horizon."""

    reference_path_data_selector: int
    sources: tuple[PredictedSource, ...]


@dataclass(frozen=True, kw_only=True, slots=True)
class Type5:
    """Predicted ranging source availability."""

    modified_z_count_s: float
    sources: tuple[PredictedSource, ...] = ()
    approaches: tuple[ObstructedApproach, ...] = ()


@dataclass(frozen=True, kw_only=True, slots=True)
class UnknownMessage:
    """A message of a type the suite does not decode; its CRC was right."""

    message_type: int
    body: bytes


Message = Type1 | Type2 | Type3 | Type4 | Type5 | Type8 | Type11 | UnknownMessage

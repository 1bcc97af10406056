"""A small world for the tests of the airborne side: satellites, a receiver without noise, and a station that knows all.

The station's messages are made here, message by message, without the ground part of the suite: what the airborne
receiver makes of them can then be told beforehand. Nothing here is fast or general.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy import integrate

from gbas_airborne.receiver import AirborneReceiver, AirborneState
from gbas_airborne.reception.receive import AirborneEpoch
from gbas_core.gnss.ephemeris import Ephemeris, NavigationMessage
from gbas_core.gnss.frames import azimuth_elevation, ecef_from_geodetic, geodetic_from_ecef, rot_enu_ecef
from gbas_core.gnss.gpstime import modified_z_count_s, normalised
from gbas_core.gnss.observations import ObservationEpoch
from gbas_core.gnss.orbits import predicted_state, rotated_range
from gbas_core.satellites import IS_GPS, N_GPS, N_SATS, RANGING_SOURCE_ID, missing
from gbas_core.signals import L1, N_BANDS, SPEED_OF_LIGHT_MPS
from gbas_vdb.coding.fec import encode_fec
from gbas_vdb.messages.block import encode_block
from gbas_vdb.messages.ephemeris_crc import ephemeris_crcs
from gbas_vdb.messages.types import (
    AdditionalBlock1,
    AdditionalBlock4,
    Correction100,
    FasBlock,
    FasDataSet,
    Message,
    Type1,
    Type2,
    Type4,
)
from gbas_vdb.transmission.burst import Burst

WEEK = 2300
START_S = 7200.0
MEASUREMENTS_PER_MESSAGE = 17

# Reference point on the lattice of the type 2 message (0.0005 arc seconds, 1 cm), so that it is exact.
LATTICE_RAD = math.radians(0.0005 / 3600.0)
REFERENCE_LAT_RAD = round(math.radians(52.32) / LATTICE_RAD) * LATTICE_RAD
REFERENCE_LON_RAD = round(math.radians(10.56) / LATTICE_RAD) * LATTICE_RAD
REFERENCE_HEIGHT_M = 130.0
REFERENCE_ECEF_M = ecef_from_geodetic(REFERENCE_LAT_RAD, REFERENCE_LON_RAD, REFERENCE_HEIGHT_M)
RUNWAY_COURSE_RAD = math.radians(260.0)
RUNWAY_LENGTH_M = 2500.0
GPA_RAD = math.radians(3.0)
TCH_M = 15.0


def constellation(*, seed: int = 1, gps_week: int = WEEK, toe_tow_s: float = START_S) -> Ephemeris:
    """Twenty-four GPS and twenty-four Galileo satellites on nearly circular orbits, received two hours before toe."""
    rng = np.random.default_rng(seed)
    columns = {name: missing() for name in Ephemeris.__dataclass_fields__}
    for index in [*range(24), *range(N_GPS, N_GPS + 24)]:
        gps = bool(IS_GPS[index])
        number = index if gps else index - N_GPS
        planes = 6 if gps else 3
        values = {
            "message": NavigationMessage.GPS_LNAV if gps else NavigationMessage.GALILEO_INAV,
            "iod": 20.0 + number,
            "iodc": 20.0 + number if gps else math.nan,
            "toe_week": gps_week,
            "toe_tow_s": toe_tow_s,
            "toc_week": gps_week,
            "toc_tow_s": toe_tow_s,
            "sqrt_a": 5153.7 if gps else 5440.6,
            "e": rng.uniform(0.001, 0.01),
            "m0_rad": math.remainder(
                math.tau * (number // planes) * planes / 24 + 0.1 + 0.4 * (number % planes), math.tau
            ),
            "delta_n_radps": 4.5e-9,
            "omega0_rad": math.remainder(math.tau * (number % planes) / planes + 0.2, math.tau),
            "i0_rad": math.radians(55.0 if gps else 56.0),
            "omega_rad": 0.0,
            "omega_dot_radps": -8e-9,
            "idot_radps": 1e-10,
            "af0_s": rng.uniform(-1e-4, 1e-4),
            "af1_sps": rng.uniform(-1e-11, 1e-11),
            "af2_sps2": 0.0,
            "group_delay_s": 4e-9,
            "group_delay_e5b_s": math.nan if gps else 5e-9,
            "health": 0.0,
            "accuracy_m": 2.0,
        }
        for name in ("cuc_rad", "cus_rad", "cic_rad", "cis_rad"):
            values[name] = rng.uniform(-5e-6, 5e-6)
        for name in ("crc_m", "crs_m"):
            values[name] = rng.uniform(-200.0, 200.0)
        for name, value in values.items():
            columns[name][index] = value
    fields = {name: column for name, column in columns.items() if name not in ("gps_week", "tow_s", "simulated")}
    week, tow_s = normalised(gps_week, toe_tow_s - 7200.0)
    return Ephemeris(gps_week=week, tow_s=tow_s, simulated=1.0, **fields)


def changed(ephemeris: Ephemeris, satellite: int, **values: float) -> Ephemeris:
    """The ephemeris with some fields of one satellite changed."""
    columns = {}
    for name, value in values.items():
        columns[name] = getattr(ephemeris, name).copy()
        columns[name][satellite] = value
    return replace(ephemeris, **columns)


def only(ephemeris: Ephemeris, satellites: Sequence[int]) -> Ephemeris:
    """The ephemerides of some satellites."""
    keep = np.isin(np.arange(N_SATS), satellites)
    names = [name for name in Ephemeris.__dataclass_fields__ if name not in ("gps_week", "tow_s", "simulated")]
    return replace(ephemeris, **{name: np.where(keep, getattr(ephemeris, name), np.nan) for name in names})


def above(height_m: float, *, east_m: float = 0.0, north_m: float = 0.0) -> np.ndarray:
    """A place by its distances from the reference point along the local axes there."""
    rot = rot_enu_ecef(REFERENCE_LAT_RAD, REFERENCE_LON_RAD)
    return REFERENCE_ECEF_M + rot.T @ np.array([east_m, north_m, height_m])


def elevation_of(ephemeris: Ephemeris, week: int, tow_s: float, place: np.ndarray) -> np.ndarray:
    """Elevation of every satellite [rad]."""
    satellite = predicted_state(ephemeris, week, tow_s, place)
    _, los = rotated_range(place, satellite.position_m)
    lat, lon, _ = geodetic_from_ecef(place)
    return azimuth_elevation(rot_enu_ecef(lat, lon) @ los)[1]


def fas_data_set(*, rpds: int = 5, rpi: str = "GEDV", apd: int = 1, provider: int = 15, **limits: float) -> FasDataSet:
    """An approach whose threshold is 500 m west of the reference point."""
    ltp = geodetic_from_ecef(above(0.0, east_m=-500.0))
    rot = rot_enu_ecef(ltp[0], ltp[1])
    forward = np.array([math.sin(RUNWAY_COURSE_RAD), math.cos(RUNWAY_COURSE_RAD), 0.0])
    fpap = geodetic_from_ecef(ecef_from_geodetic(*ltp) + rot.T @ (forward * RUNWAY_LENGTH_M))
    return FasDataSet(
        fas=FasBlock(
            sbas_provider=provider,
            airport_id="EDVE",
            runway_number=26,
            approach_performance_designator=apd,
            reference_path_data_selector=rpds,
            reference_path_identifier=rpi,
            ltp_latitude_rad=float(ltp[0]),
            ltp_longitude_rad=float(ltp[1]),
            ltp_height_m=float(ltp[2]),
            delta_fpap_latitude_rad=float(fpap[0] - ltp[0]),
            delta_fpap_longitude_rad=float(fpap[1] - ltp[1]),
            tch_m=TCH_M,
            gpa_rad=GPA_RAD,
            course_width_m=105.0,
        ),
        fasval_m=limits.get("fasval_m", 10.0),
        faslal_m=limits.get("faslal_m", 40.0),
    )


def station_data(**changes: object) -> Type2:
    """Station data of an ordinary station; `k_md_e` and `d_max_m` go into its additional data block 1."""
    adb1 = AdditionalBlock1(
        d_max_m=changes.pop("d_max_m", math.inf),
        k_md_e_pos_gps=5.0,
        k_md_e_c_gps=changes.pop("k_md_e", 5.0),
        reference_station_data_selector=changes.pop("rsds", 3),
    )
    slot_group = changes.pop("slot_group", None)
    values = {
        "n_reference_receivers": 4,
        "ground_accuracy_designator": "C",
        "gcid": 1,
        "magnetic_variation_rad": 0.0,
        "sigma_vert_iono_gradient": 4e-6,
        "refractivity_index": 379.0,
        "scale_height_m": 7900.0,
        "refractivity_uncertainty": 20.0,
        "latitude_rad": REFERENCE_LAT_RAD,
        "longitude_rad": REFERENCE_LON_RAD,
        "ellipsoid_height_m": REFERENCE_HEIGHT_M,
        "adb1": adb1,
        "adb4": AdditionalBlock4(slot_group=slot_group) if slot_group is not None else None,
    }
    return Type2(**(values | changes))


def burst_of(
    messages: Sequence[Message],
    week: int,
    tow_s: float,
    *,
    slot: int = 0,
    in_frame: int = 1,
    station_id: str = "EDVE",
    test: bool = False,
) -> Burst:
    """Messages of a station as one burst."""
    data = b"".join(encode_block(message, station_id, test=test) for message in messages)
    assert len(data) <= 222, f"{len(data)} bytes do not fit one burst"
    return Burst(gps_week=week, tow_s=tow_s, slot=slot, bursts_in_frame=in_frame, payload=data + encode_fec(data))


@dataclass
class World:
    """Satellites whose clocks err, a station that corrects them exactly, and an aircraft that measures without noise.

    Attributes
    ----------
    path : callable
        Position of the aircraft [m] at a time since the start [s].
    station, aircraft : Ephemeris
        Ephemerides at either end.
    truth : Ephemeris
        Where the satellites are.
    satellites : list of int
        Satellites seen and corrected.
    amend : callable
        Changes a correction (correction, satellite index, time), or leaves it out (None).
    code_error_m : callable
        Error of the aircraft's codes at a time, on the satellite axis [m].
    troposphere : bool
        Whether there is air between the station's height and the aircraft's.
    """

    path: Callable[[float], np.ndarray] = field(default=lambda t: above(300.0, east_m=4000.0))
    truth: Ephemeris = field(default_factory=constellation)
    station: Ephemeris | None = None
    aircraft: Ephemeris | None = None
    satellites: list[int] = field(default_factory=list)
    week: int = WEEK
    start_s: float = START_S
    n_receivers: int = 4
    sigma_m: float = 0.2
    p: float = 2e-4
    b_values_m: Callable[[int], tuple[float, float, float, float]] | None = None
    station_message: Type2 | None = None
    approaches: tuple[FasDataSet, ...] = ()
    amend: Callable[[Correction100, int, float], Correction100 | None] = field(default=lambda c, satellite, t: c)
    code_error_m: Callable[[float], np.ndarray] = field(default=lambda t: np.zeros(N_SATS))
    troposphere: bool = True
    clock_m: Callable[[float], float] = field(default=lambda t: 1234.5 + 0.3 * t)
    mask_rad: float = math.radians(6.0)
    _crcs: tuple[Ephemeris, np.ndarray] | None = None

    def __post_init__(self) -> None:
        self.station = self.station or self.truth
        self.aircraft = self.aircraft or self.truth
        self.station_message = self.station_message or station_data(
            n_reference_receivers=self.n_receivers if self.n_receivers > 1 else None
        )
        if not self.satellites:
            elevation = elevation_of(self.truth, self.week, self.start_s, self.path(0.0))
            self.satellites = np.flatnonzero(elevation > self.mask_rad).tolist()
        # On the lattice of PRC and RRC at every half second, so that corrections are exact.
        rng = np.random.default_rng(7)
        self.bias_m = np.round(rng.uniform(-30.0, 30.0, N_SATS), 2)
        self.drift_mps = np.round(rng.uniform(-0.5, 0.5, N_SATS) / 0.02) * 0.02

    def time(self, t: float) -> tuple[int, float]:
        return normalised(self.week, self.start_s + t)

    def satellite_error_m(self, t: float) -> np.ndarray:
        """Error of the satellites' clocks: what the corrections are for [m]."""
        return self.bias_m + self.drift_mps * t

    def troposphere_m(self, t: float) -> np.ndarray:
        """What the aircraft's troposphere is short of the station's, at the aircraft's elevations [m].

        The delay above a height is the integral of the refractivity N_r exp(-h / h_0) from there up, times the
        mapping of the standard; it is integrated numerically here.
        """
        week, tow_s = self.time(t)
        place, station = self.path(t), self.station_message
        sine = np.sin(elevation_of(self.truth, week, tow_s, place))
        height_m = float(geodetic_from_ecef(place)[2]) - station.ellipsoid_height_m

        def refractivity(h: float) -> float:
            return 1e-6 * station.refractivity_index * math.exp(-h / station.scale_height_m)

        above_m = integrate.quad(refractivity, 0.0, height_m, epsabs=1e-9)[0]
        return -above_m / np.sqrt(0.002 + sine**2)

    def ranges_m(self, t: float) -> np.ndarray:
        """What the aircraft measures, without receiver clock [m]."""
        # The receiver's time tag has its clock error in it.
        late_s = self.clock_m(t) / SPEED_OF_LIGHT_MPS
        week, tow_s = self.time(t)
        place = self.path(t - late_s)
        satellite = predicted_state(self.truth, week, tow_s - late_s, place)
        distance, _ = rotated_range(place, satellite.position_m)
        ranges = distance - SPEED_OF_LIGHT_MPS * satellite.clock_s + self.satellite_error_m(t)
        return ranges + self.troposphere_m(t) if self.troposphere else ranges

    def observations(self, t: float) -> ObservationEpoch:
        week, tow_s = self.time(t)
        seen = np.isin(np.arange(N_SATS), self.satellites)
        code, carrier, lli = missing(N_BANDS), missing(N_BANDS), missing(N_BANDS)
        true = self.ranges_m(t) + self.clock_m(t)
        code[L1] = np.where(seen, true + self.code_error_m(t), np.nan)
        carrier[L1] = np.where(seen, true + 1000.0 * np.arange(N_SATS), np.nan)
        lli[L1] = np.where(seen, 0.0, np.nan)
        return ObservationEpoch(
            gps_week=week, tow_s=tow_s, simulated=1.0, code_m=code, carrier_m=carrier, doppler_hz=missing(N_BANDS),
            cn0_dbhz=np.where(np.isfinite(code), 45.0, np.nan), lli=lli,
        )  # fmt: skip

    def correction(self, satellite: int, t: float) -> Correction100:
        """Correction of one satellite."""
        spare = (math.nan,) * (4 - self.n_receivers)
        values = (0.0,) * self.n_receivers + spare if self.n_receivers > 1 else (math.nan,) * 4
        return Correction100(
            ranging_source_id=int(RANGING_SOURCE_ID[satellite]),
            iod=int(self.station.iod[satellite]) % 256,
            prc_m=-float(self.satellite_error_m(t)[satellite]),
            rrc_mps=-float(self.drift_mps[satellite]),
            sigma_pr_gnd_m=self.sigma_m,
            b_values_m=self.b_values_m(satellite) if self.b_values_m else values,
        )

    def amended(self, satellite: int, t: float) -> Correction100 | None:
        """The correction as sent: what `amend` makes of it, None to leave it out."""
        return self.amend(self.correction(satellite, t), satellite, t)

    def _station_crcs(self) -> np.ndarray:
        """Ephemeris CRCs of the station's ephemerides, made once for each set."""
        if self._crcs is None or self._crcs[0] is not self.station:
            self._crcs = (self.station, ephemeris_crcs(self.station))
        return self._crcs[1]

    def type1(self, t: float, *, z_count_s: float | None = None) -> list[Type1]:
        """Type 1 message or linked pair; the first satellite rotates from frame to frame."""
        turn = round(2.0 * t) % max(len(self.satellites), 1)
        order = self.satellites[turn:] + self.satellites[:turn]
        order = [satellite for satellite in order if self.amended(satellite, t) is not None]
        crcs = self._station_crcs()
        parts = [order[k : k + MEASUREMENTS_PER_MESSAGE] for k in range(0, len(order), MEASUREMENTS_PER_MESSAGE)]
        parts = parts or [[]]
        flags = [0] if len(parts) == 1 else [1, 3]
        return [
            Type1(
                modified_z_count_s=modified_z_count_s(self.time(t)[1]) if z_count_s is None else z_count_s,
                additional_message_flag=flag,
                ephemeris_decorrelation=self.p if part else math.nan,
                ephemeris_crc=int(crcs[part[0]]) if part else None,
                measurements=tuple(self.amended(satellite, t) for satellite in part),
            )
            for flag, part in zip(flags, parts, strict=True)
        ]

    def bursts(self, t: float) -> tuple[Burst, ...]:
        """The frame of an epoch: type 1 in slots from A on, type 2 and type 4 in G and H."""
        week, tow_s = self.time(t)
        groups: list[tuple[int, list[Message]]] = [(slot, [message]) for slot, message in enumerate(self.type1(t))]
        groups.append((6, [self.station_message]))
        if self.approaches:
            groups.append((7, [Type4(data_sets=self.approaches)]))
        return tuple(burst_of(group, week, tow_s, slot=slot, in_frame=len(groups)) for slot, group in groups)

    def epoch(self, t: float, **changes: object) -> AirborneEpoch:
        """Everything the receiver gets at an epoch."""
        week, tow_s = self.time(t)
        parts: dict[str, object] = {
            "observations": self.observations(t),
            "bursts": self.bursts(t),
            "ephemerides": (self.aircraft,) if t == 0.0 else (),
        }
        return AirborneEpoch(gps_week=week, tow_s=tow_s, **(parts | changes))


@dataclass
class Flight:
    """A receiver in a world: steps it and keeps what it said."""

    world: World
    params: object
    state: AirborneState = field(default_factory=AirborneState)
    solutions: list = field(default_factory=list)
    protections: list = field(default_factory=list)
    events: list = field(default_factory=list)

    def step(self, t: float, **changes: object) -> tuple:
        epoch = changes.pop("epoch", None) or self.world.epoch(t, **changes)
        self.state, output = AirborneReceiver.step(self.state, epoch, self.params)
        self.solutions.append(output.solutions[0])
        self.protections.append(output.protections[0])
        self.events.extend(output.events)
        return output.solutions[0], output.protections[0], output.events

    def run(self, start: float, stop: float, *, interval_s: float = 0.5) -> tuple:
        result = ()
        for k in range(round((stop - start) / interval_s)):
            result = self.step(start + k * interval_s)
        return result

    def causes(self, subject: str | None = None) -> set[str]:
        return {event.cause for event in self.events if subject is None or event.subject == subject}


def position_of(solution: object) -> np.ndarray:
    return np.array([solution.x_m, solution.y_m, solution.z_m])

"""Parameters of a ground station: what it is, what it claims, and when it stops claiming it.

:class:`GroundParams` is frozen and checked when it is made; every complaint names the field as it stands in a
configuration file, its value and its bound (:mod:`gbas_ground.declared`).

Where a parameter is part of the integrity claim, its default is the most conservative value the broadcast can carry, or
the one that withholds service, so that leaving it out is never optimistic.

Angles are degrees in files only.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import yaml

from gbas_core.gnss.frames import ecef_from_geodetic
from gbas_core.parameters import ParameterError, unknown_parameters
from gbas_core.positioning.approach import FinalApproach
from gbas_core.positioning.approach_keys import RECORD_KEY, approach_from_mapping
from gbas_core.record import FloatArray
from gbas_core.satellites import SYSTEM_MASKS
from gbas_ground.approaches import fas_data_set
from gbas_ground.claims.gradient_claim import MAX_M_EIG, MAX_Y_EIG_M, GradientClaim, gradient_claim
from gbas_ground.claims.gradient_claim import refuse_smaller as refuse_smaller_gradient
from gbas_ground.claims.orbit_claim import MAX_DECORRELATION, OrbitSite
from gbas_ground.claims.orbit_claim import refuse_smaller as refuse_smaller_decorrelation
from gbas_ground.declared import REQUIRED, Declared, all_specs, arguments_from, flatten, listed, nested, parameter
from gbas_ground.ionosphere.section import IonosphereSection
from gbas_ground.monitor_params import MonitorParams
from gbas_ground.monitors.double_difference import baselines_of
from gbas_ground.monitors.ephemeris_residual import EphemerisResidualParams
from gbas_ground.monitors.ionosphere_gradient import IonosphereGradientParams, gradient_site
from gbas_msgs_py.records import MAX_REFERENCE_RECEIVERS
from gbas_vdb.errors import VdbError
from gbas_vdb.messages.block import encode_body
from gbas_vdb.messages.path_point import trusted_path_point
from gbas_vdb.messages.types import AdditionalBlock1, AdditionalBlock3, AdditionalBlock4, FasDataSet, Type2, Type4
from gbas_vdb.transmission.burst import SLOT_NAMES
from gbas_vdb.transmission.schedule import ScheduleParams, sources_that_fit

_DEGREE: Final = math.pi / 180.0
ROOT_KEY: Final = "ground"
GCID_UNHEALTHY: Final = 7
TYPE_D_GCID: Final = (2, 3, 4)
"""Designators of stations that serve type D as well. Known for 2; what 3 and 4 add is not in a public text."""
RSDS_NONE: Final = 255
MAX_SIGMA_VIG: Final = 25.5e-6
"""Largest vertical ionosphere gradient sigma that a type 2 message carries [m/m]."""
MAX_SCREENED_M: Final = 60_000.0
"""Largest distance of use that can be protected against ionospheric fronts [m]. Ours."""
MIN_SERVICE_SATELLITES: Final = 4
"""Fewer corrections than this give nobody a position: the station then says that it is not healthy."""


@dataclass(frozen=True, kw_only=True)
class GroundParams(Declared):
    """Everything a ground station has to be told. Units are SI; files use the units of their key names."""

    # --- station: what the type 2 message says of the station
    station_id: str = parameter("station", "id", REQUIRED, "-", "GBAS ID, 3 or 4 characters A-Z, 0-9")
    latitude_rad: float = parameter(
        "station", "latitude_deg", REQUIRED, "deg", "reference point", low=-90.0, high=90.0, per_unit=_DEGREE
    )
    longitude_rad: float = parameter(
        "station", "longitude_deg", REQUIRED, "deg", "reference point", low=-180.0, high=180.0, per_unit=_DEGREE
    )
    height_m: float = parameter(
        "station", "height_m", REQUIRED, "m", "reference point above the ellipsoid", low=-1000.0, high=20_000.0
    )
    magnetic_variation_rad: float = parameter(
        "station", "magnetic_variation_deg", 0.0, "deg", "positive east", low=-180.0, high=180.0, per_unit=_DEGREE
    )
    gcid: int = parameter(
        "station",
        "gcid",
        GCID_UNHEALTHY,
        "-",
        "continuity/integrity designator; 7 is unhealthy",
        choices=(1, 2, 3, 4, 7),
    )
    rsds: int = parameter(
        "station", "rsds", RSDS_NONE, "-", "reference station data selector, 0-48; 255 no positioning service",
        choices=(*range(49), RSDS_NONE),
    )  # fmt: skip
    max_use_distance_m: float = parameter(
        "station", "max_use_distance_m", 50_000.0, "m", "D_max; 0 is unlimited", low=0.0, high=510_000.0
    )
    systems: str = parameter("station", "systems", "G", "-", "satellite systems corrected: G, E or GE")

    # --- receivers
    receiver_ecef_m: tuple[tuple[float, float, float], ...] = parameter(
        "receivers", "rr1_ecef_m", REQUIRED, "m", "antenna positions of the 1 to 4 reference receivers (rr1, rr2, ...)"
    )
    min_receivers: int = parameter(
        "receivers", "minimum", 2, "-", "fewest receivers behind a broadcast correction", low=1, high=4
    )

    # --- accuracy
    accuracy_designator: str = parameter(
        "accuracy", "designator", "A", "-", "ground accuracy designator", choices=("A", "B", "C")
    )
    sigma_elevation_rad: tuple[float, ...] = parameter(
        "accuracy", "sigma_elevation_deg", (), "deg", "nodes of a measured sigma table, rising; empty: the designator",
        low=0.0, high=90.0, per_unit=_DEGREE,
    )  # fmt: skip
    sigma_table_m: tuple[float, ...] = parameter(
        "accuracy", "sigma_m", (), "m", "measured sigma of one receiver's 100 s correction at the nodes",
        low=0.001, high=100.0,
    )  # fmt: skip
    sigma_inflation: float = parameter(
        "accuracy", "inflation", 1.0, "-", "factor on every sigma (tails, mean errors)", low=1.0, high=100.0
    )
    sigma_inflation_iono: float = parameter(
        "accuracy", "inflation_iono", 1.0, "-", "further factor on sigma_pr_gnd alone (anomalous ionosphere)",
        low=1.0, high=100.0,
    )  # fmt: skip
    sigma_30_factor: float = parameter(
        "accuracy", "factor_30s", math.sqrt(100.0 / 30.0), "-", "sigma of the 30 s corrections over the 100 s ones",
        low=1.0, high=10.0,
    )  # fmt: skip

    # --- atmosphere
    sigma_vert_iono_gradient: float = parameter(
        "atmosphere",
        "sigma_vert_iono_gradient",
        MAX_SIGMA_VIG,
        "m/m",
        "for the type 2 message",
        low=0.0,
        high=MAX_SIGMA_VIG,
    )
    sigma_vert_iono_gradient_d: float = parameter(
        "atmosphere",
        "sigma_vert_iono_gradient_d",
        MAX_SIGMA_VIG,
        "m/m",
        "for additional data block 3",
        low=0.0,
        high=MAX_SIGMA_VIG,
    )
    refractivity: float = parameter("atmosphere", "refractivity", 400.0, "N", "at the site", low=16.0, high=781.0)
    refractivity_uncertainty: float = parameter(
        "atmosphere", "refractivity_uncertainty", 255.0, "N", "one sigma", low=0.0, high=255.0
    )
    scale_height_m: float = parameter(
        "atmosphere", "scale_height_m", 7900.0, "m", "of the troposphere", low=100.0, high=25_500.0
    )

    # --- ephemeris
    p_ephemeris: float = parameter(
        "ephemeris",
        "p",
        0.0,
        "m/m",
        "least decorrelation parameter of the type 1 message; 0: it follows from the station's ephemeris monitor",
        low=0.0,
        high=MAX_DECORRELATION,
    )
    p_ephemeris_d: float = parameter(
        "ephemeris",
        "p_d",
        0.0,
        "m/m",
        "the same of the type 11 message",
        low=0.0,
        high=MAX_DECORRELATION,
    )
    external_monitor: str = parameter(
        "ephemeris",
        "external_monitor",
        "",
        "-",
        "what else monitors the orbits and supports p, which is then broadcast as it stands; empty: nothing does",
    )
    k_md_e_pos: float = parameter("ephemeris", "k_md_e_pos", 12.75, "-", "positioning service", low=0.0, high=12.75)
    k_md_e_c: float = parameter("ephemeris", "k_md_e_c", 12.75, "-", "service type C", low=0.0, high=12.75)
    k_md_e_d: float = parameter("ephemeris", "k_md_e_d", 12.75, "-", "service type D", low=0.0, high=12.75)
    ephemeris_settle_s: float = parameter(
        "ephemeris",
        "settle_s",
        120.0,
        "s",
        "a new ephemeris is used this long after its reception",
        low=0.0,
        high=180.0,
    )
    ephemeris_max_change_m: float = parameter(
        "ephemeris", "max_change_m", 250.0, "m", "a new ephemeris further from the last one is not used",
        low=1.0, high=100_000.0,
    )  # fmt: skip

    # --- service type D
    gast_d: bool = parameter("gast_d", "enabled", False, "-", "broadcast type 11 messages and additional data block 3")
    y_eig_m: float = parameter(
        "gast_d", "y_eig_m", MAX_Y_EIG_M, "m", "ionospheric error at the station", low=0.0, high=MAX_Y_EIG_M
    )
    m_eig: float = parameter("gast_d", "m_eig", MAX_M_EIG, "m/m", "its growth with distance", low=0.0, high=MAX_M_EIG)

    # --- vdb
    slots: str = parameter("vdb", "slots", "A", "-", "slots assigned, such as AB or ACEG")
    authentication: bool = parameter("vdb", "authentication", False, "-", "broadcast additional data block 4")
    test: bool = parameter("vdb", "test", False, "-", "mark every message as a test: no guidance from it")
    period_frames: int = parameter(
        "vdb", "period_frames", 20, "-", "frames within which types 2 and 4 are sent", low=1, high=20
    )
    occupancy_min: float = parameter(
        "vdb", "occupancy_min", 0.95, "-", "filled part of a burst when authenticated", low=0.0, high=1.0
    )

    # --- smoothing
    tau_s: tuple[float, float] = parameter(
        "smoothing", "tau_s", (100.0, 30.0), "s", "time constants of the two corrections; 0: no smoothing (tests only)",
        low=0.0, high=1000.0,
    )  # fmt: skip
    settle_time_s: float = parameter(
        "smoothing",
        "settle_time_s",
        230.0,
        "s",
        "time a filter has to run before its output is used (docs/decisions/0002)",
        low=0.0,
        high=3600.0,
    )
    max_gap_s: float = parameter(
        "smoothing", "max_gap_s", 3.5, "s", "longest gap in the data a filter survives", low=0.1, high=3600.0
    )

    # --- monitors
    elevation_mask_rad: float = parameter(
        "monitors", "elevation_mask_deg", 5.0, "deg", "lowest elevation corrected", low=5.0, high=60.0, per_unit=_DEGREE
    )
    min_cn0_dbhz: float = parameter(
        "monitors", "min_cn0_dbhz", 30.0, "dB-Hz", "lowest C/N0 of a channel in use", low=0.0, high=60.0
    )
    require_cn0: bool = parameter(
        "monitors", "require_cn0", True, "-", "do not use a channel whose receiver gives no C/N0"
    )
    max_range_residual_m: float = parameter(
        "monitors",
        "max_range_residual_m",
        150.0,
        "m",
        "raw pseudorange against the expected one",
        low=10.0,
        high=10_000.0,
    )
    max_prc_m: float = parameter("monitors", "max_prc_m", 327.67, "m", "limit of |PRC|", low=1.0, high=327.67)
    max_rrc_mps: float = parameter("monitors", "max_rrc_mps", 3.4, "m/s", "limit of |RRC|", low=0.01, high=32.767)
    k_b: float = parameter("monitors", "k_b", 5.5, "-", "multiplier of the B value threshold", low=1.0, high=20.0)
    receiver_fault_channels: int = parameter(
        "monitors", "receiver_fault_channels", 3, "-",
        "channels failing by B values, or by their ranges, that make the receiver the fault", low=1, high=68,
    )  # fmt: skip
    readmission_time_s: float = parameter(
        "monitors",
        "readmission_time_s",
        60.0,
        "s",
        "time without a failing monitor before use again",
        low=0.0,
        high=7200.0,
    )
    readmission_longest_s: float = parameter(
        "monitors", "readmission_longest_s", 960.0, "s",
        "the time doubles with each further exclusion of the same thing, up to this; free for as long, and it is new",
        low=0.0, high=86_400.0,
    )  # fmt: skip
    readmission_share: float = parameter(
        "monitors", "readmission_share", 0.6, "-", "of a threshold that what is excluded has to stay below",
        low=0.1, high=1.0,
    )  # fmt: skip
    min_common_satellites: int = parameter(
        "monitors", "min_common_satellites", 3, "-", "fewest common satellites a constellation is corrected with",
        low=1, high=36,
    )  # fmt: skip
    clock_weighting: str = parameter(
        "monitors",
        "clock_weighting",
        "plain",
        "-",
        "mean that removes a receiver's clock",
        choices=("plain", "elevation"),
    )

    monitors: MonitorParams = nested(MonitorParams())
    ionosphere: IonosphereSection = nested(IonosphereSection())

    approaches: tuple[FinalApproach, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_station(self)
        _check_receivers(self)
        _check_sigma_table(self)
        _check_vdb(self)
        _check_messages(self)
        _check_orbit_claim(self)
        _check_gradient_claim(self)
        _check_ionosphere(self)

    @property
    def n_receivers(self) -> int:
        """Reference receivers the station has, working or not."""
        return len(self.receiver_ecef_m)

    def receiver_positions_m(self) -> FloatArray:
        """Antenna positions of the reference receivers, ECEF, ``(R, 3)`` [m]."""
        return np.array(self.receiver_ecef_m, dtype=np.float64)

    def reference_point_m(self) -> FloatArray:
        """Reference point of the station, ECEF, ``(3,)`` [m]."""
        return ecef_from_geodetic(self.latitude_rad, self.longitude_rad, self.height_m)

    def gradient_monitor(self) -> IonosphereGradientParams:
        """Settings of the gradient monitor."""
        courses = tuple(approach.course_rad for approach in self.approaches)
        return self.monitors.gradient.params(courses, self.monitors.carrier_noise.params())

    def ephemeris_monitor(self) -> EphemerisResidualParams:
        """Settings of the ephemeris monitor; its double differences are those of the gradient monitor."""
        return self.monitors.ephemeris.params(self.gradient_monitor().bands)

    def orbit_site(self) -> OrbitSite:
        """What the claim of orbits follows from."""
        pairing = self.gradient_monitor().pairing
        return OrbitSite(
            baselines=baselines_of(self.receiver_positions_m(), self.reference_point_m(), pairing),
            noise=self.monitors.carrier_noise.params(),
            monitor=self.ephemeris_monitor(),
        )

    def gradient_claim(self) -> GradientClaim:
        """Bound on gradients that the station's monitor supports."""
        monitor = self.gradient_monitor()
        site = gradient_site(self.receiver_positions_m(), self.reference_point_m(), monitor)
        return gradient_claim(site, monitor, excludes=self.monitors.gradient.exclude, tau_s=self.tau_s[1])

    def station_message(self) -> Type2:
        """Station data as declared; the broadcast puts in what an epoch does not support."""
        return Type2(
            n_reference_receivers=self.n_receivers if self.n_receivers >= 2 else None,
            ground_accuracy_designator=self.accuracy_designator,
            gcid=self.gcid,
            magnetic_variation_rad=self.magnetic_variation_rad,
            sigma_vert_iono_gradient=self.sigma_vert_iono_gradient,
            refractivity_index=self.refractivity,
            scale_height_m=self.scale_height_m,
            refractivity_uncertainty=self.refractivity_uncertainty,
            latitude_rad=self.latitude_rad,
            longitude_rad=self.longitude_rad,
            ellipsoid_height_m=self.height_m,
            adb1=AdditionalBlock1(
                reference_station_data_selector=None if self.rsds == RSDS_NONE else self.rsds,
                d_max_m=self.max_use_distance_m or math.inf,
                k_md_e_pos_gps=self.k_md_e_pos,
                k_md_e_c_gps=self.k_md_e_c,
            ),
            adb3=self._service_d_block() if self.gast_d else None,
            adb4=AdditionalBlock4(slot_group=sum(1 << slot for slot in self.schedule().slots))
            if self.authentication
            else None,
        )

    def _service_d_block(self) -> AdditionalBlock3:
        return AdditionalBlock3(
            k_md_e_d_gps=self.k_md_e_d,
            sigma_vert_iono_gradient_d=self.sigma_vert_iono_gradient_d,
            y_eig_m=self.y_eig_m,
            m_eig=self.m_eig,
        )

    def approach_messages(self) -> tuple[FasDataSet, ...]:
        """Approaches as broadcast."""
        return tuple(fas_data_set(approach) for approach in self.approaches)

    def schedule(self) -> ScheduleParams:
        """Settings of the frame schedule."""
        return ScheduleParams(
            station_id=self.station_id,
            slots=tuple(SLOT_NAMES.index(slot) for slot in self.slots),
            message_types=(1, 11) if self.gast_d else (1,),
            test=self.test,
            period_frames=self.period_frames,
            occupancy_min=self.occupancy_min,
        )

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any], *, source: str = "parameters") -> GroundParams:
        """Parameters from nested sections or dotted keys.

        Parameters
        ----------
        mapping : mapping
            Sections of keys as in the configuration files; a section may also be flattened to ``section.key``.
        source : str
            Where the mapping came from, for messages.

        Raises
        ------
        ParameterError
            For a key that does not exist, a required one that is missing, and values out of bounds.
        """
        try:
            return cls(**_arguments(mapping))
        except ParameterError as error:
            raise ParameterError(f"{source}: {error}") from None

    @classmethod
    def from_yaml(cls, path: str | Path) -> GroundParams:
        """Parameters from a ROS parameter file or a plain one: the sections stand under the key ``ground``.

        Raises
        ------
        ParameterError
            As :meth:`from_mapping`, and when the file is missing, is not YAML, or has no ``ground`` key.
        """
        try:
            document = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError) as error:
            raise ParameterError(f"{path}: cannot be read: {error}") from None
        except yaml.YAMLError as error:
            raise ParameterError(f"{path}: is not YAML: {error}") from None
        return cls.from_mapping(ground_section(document, str(path)), source=str(path))


def ground_section(document: Any, source: str) -> Mapping[str, Any]:
    """The ``ground`` section of a parsed file, with or without the ROS wrapping (``/**: ros__parameters:``)."""
    node = document
    for key in ("/**", "ros__parameters", ROOT_KEY):
        if isinstance(node, Mapping) and key in node:
            node = node[key]
    if not isinstance(node, Mapping) or (isinstance(document, Mapping) and node is document):
        raise ParameterError(f"{source}: has no section '{ROOT_KEY}'")
    return node


def _arguments(mapping: Mapping[str, Any]) -> dict[str, Any]:
    """Keyword arguments of :class:`GroundParams` from a nested or flat mapping."""
    flat = flatten(mapping)
    given = {"approaches": _approaches(flat), "receiver_ecef_m": _receivers(flat)}
    arguments = arguments_from(GroundParams, flat, given)
    unknown_parameters(sorted(flat), [spec.key for spec in all_specs(GroundParams)])
    return arguments


def _receivers(flat: dict[str, Any]) -> tuple[Any, ...]:
    """Take ``receivers.rrN_ecef_m`` out of a flat mapping; they must be rr1, rr2, ... without a hole."""
    positions: list[Any] = []
    for number in range(1, MAX_REFERENCE_RECEIVERS + 1):
        key = f"receivers.rr{number}_ecef_m"
        if key not in flat:
            break
        positions.append(listed(flat.pop(key)))
    if beyond := sorted(key for key in flat if re.fullmatch(r"receivers\.rr\d+_ecef_m", key)):
        raise ParameterError(
            f"{beyond[0]} has no place: receivers are rr1 to rr{MAX_REFERENCE_RECEIVERS}, without a gap"
        )
    if not positions:
        raise ParameterError("receivers.rr1_ecef_m is missing: at least one reference receiver is needed")
    return tuple(positions)


def _approaches(flat: dict[str, Any]) -> tuple[FinalApproach, ...]:
    """Take ``approaches.<name>.*`` out of a flat mapping, in the order of the names."""
    by_name: dict[str, dict[str, Any]] = {}
    for key in [key for key in flat if key.startswith("approaches.")]:
        _, name, *rest = key.split(".")
        by_name.setdefault(name, {})[".".join(rest)] = flat.pop(key)
    approaches = []
    for name in sorted(by_name):
        try:
            approach = approach_from_mapping(by_name[name])
            if RECORD_KEY in by_name[name]:
                trusted_path_point(by_name[name][RECORD_KEY])
            encode_body(Type4(data_sets=(fas_data_set(approach),)))  # what cannot be broadcast is refused here
            approaches.append(approach)
        except ValueError as error:
            raise ParameterError(f"approaches.{name}: {error}") from None
    return tuple(approaches)


def _check_station(params: GroundParams) -> None:
    if not isinstance(params.station_id, str) or not re.fullmatch(r"[A-Z0-9]{3,4}", params.station_id):
        raise ParameterError(f"station.id = {params.station_id!r} is not 3 or 4 characters of A-Z, 0-9")
    systems = params.systems
    if (
        not isinstance(systems, str)
        or not systems
        or len(set(systems)) != len(systems)
        or set(systems) - set(SYSTEM_MASKS)
    ):
        raise ParameterError(f"station.systems = {systems!r} is not one of G, E, GE")


MAX_DISTANCE_FROM_REFERENCE_M: Final = 10_000.0
"""A reference receiver further from the reference point than this is a mistake in the configuration. Ours."""


def _check_receivers(params: GroundParams) -> None:
    positions = params.receiver_ecef_m
    if not isinstance(positions, tuple) or not 1 <= len(positions) <= MAX_REFERENCE_RECEIVERS:
        raise ParameterError(f"receivers: {len(positions)} are not within 1 to {MAX_REFERENCE_RECEIVERS}")
    for number, position in enumerate(positions, start=1):
        key = f"receivers.rr{number}_ecef_m"
        numbers = isinstance(position, tuple) and all(type(each) in (int, float) for each in position)
        if not numbers or len(position) != 3:
            raise ParameterError(f"{key} = {position!r} is not three numbers")
        distance = float(np.linalg.norm(np.array(position, dtype=np.float64) - params.reference_point_m()))
        if not distance <= MAX_DISTANCE_FROM_REFERENCE_M:
            raise ParameterError(
                f"{key} lies {distance:.0f} m from the reference point, more than {MAX_DISTANCE_FROM_REFERENCE_M:.0f} m"
            )
    if params.min_receivers > len(positions):
        raise ParameterError(
            f"receivers.minimum = {params.min_receivers} is more than the {len(positions)} receivers there are"
        )
    factors = params.monitors.carrier_noise.receiver_factor
    if len(factors) not in (1, len(positions)):
        raise ParameterError(
            f"carrier_noise.receiver_factor = {factors} is neither one number nor one for each of the "
            f"{len(positions)} receivers"
        )


def _check_sigma_table(params: GroundParams) -> None:
    nodes, sigmas = params.sigma_elevation_rad, params.sigma_table_m
    if not isinstance(nodes, tuple) or not isinstance(sigmas, tuple) or len(nodes) != len(sigmas):
        raise ParameterError("accuracy.sigma_elevation_deg and accuracy.sigma_m are not lists of one length")
    if nodes and (np.diff(nodes) <= 0.0).any():
        raise ParameterError("accuracy.sigma_elevation_deg does not rise")
    if nodes and nodes[0] > params.elevation_mask_rad:
        raise ParameterError("accuracy.sigma_elevation_deg starts above monitors.elevation_mask_deg")


def _check_vdb(params: GroundParams) -> None:
    slots = params.slots
    if not isinstance(slots, str) or not re.fullmatch(r"[A-H]{1,8}", slots) or "".join(sorted(set(slots))) != slots:
        raise ParameterError(f"vdb.slots = {slots!r} is not letters A to H, each once, in order")
    if not isinstance(params.tau_s, tuple) or len(params.tau_s) != 2:
        raise ParameterError(f"smoothing.tau_s = {params.tau_s!r} is not two numbers")


def _check_messages(params: GroundParams) -> None:
    """Station data and approaches must fit the messages, and the messages the slots."""
    try:
        room = sources_that_fit(params.station_message(), params.approach_messages(), params.schedule())
    except (VdbError, ValueError) as error:
        raise ParameterError(f"cannot be broadcast: {error}") from None
    if room < MIN_SERVICE_SATELLITES:
        raise ParameterError(f"vdb.slots = {params.slots!r} leaves room for {room} satellites; 4 are needed")


def _check_orbit_claim(params: GroundParams) -> None:
    """What the station does not monitor itself it must not claim, unless it says who does."""
    if not isinstance(params.external_monitor, str):
        raise ParameterError(f"ephemeris.external_monitor = {params.external_monitor!r} is not a name")
    given = {"ephemeris.p": params.p_ephemeris} | ({"ephemeris.p_d": params.p_ephemeris_d} if params.gast_d else {})
    for key, value in given.items():
        if params.external_monitor:
            if value == 0.0:
                raise ParameterError(
                    f"{key} is missing: what ephemeris.external_monitor = {params.external_monitor!r} supports"
                )
        elif value > 0.0:
            excludes = params.monitors.ephemeris.exclude
            try:
                refuse_smaller_decorrelation(
                    key, value, params.orbit_site(), params.elevation_mask_rad, excludes=excludes
                )
            except ValueError as error:
                raise ParameterError(str(error)) from None


def _check_gradient_claim(params: GroundParams) -> None:
    """A bound on gradients has to follow from what the gradient monitor detects."""
    if params.gcid in TYPE_D_GCID and not params.gast_d:
        raise ParameterError(f"station.gcid = {params.gcid} claims service type D, and gast_d.enabled is false")
    if not params.gast_d or (params.y_eig_m >= MAX_Y_EIG_M and params.m_eig >= MAX_M_EIG):
        return
    try:
        refuse_smaller_gradient(params.y_eig_m, params.m_eig, params.gradient_claim())
    except ValueError as error:
        raise ParameterError(str(error)) from None


def _check_ionosphere(params: GroundParams) -> None:
    """Only what is screened may be claimed: approaches, out to a largest distance of use."""
    if not params.ionosphere.protects:
        return
    model = f"ionosphere.threat_model = {params.ionosphere.threat_model!r}"
    if not params.approaches:
        raise ParameterError(f"{model} needs at least one approach to be protected")
    if not 0.0 < params.max_use_distance_m <= MAX_SCREENED_M:
        raise ParameterError(
            f"{model} needs station.max_use_distance_m above 0 (not unlimited) and at most {MAX_SCREENED_M:g} m, "
            f"not {params.max_use_distance_m:g}"
        )
    if params.tau_s[0] <= 0.0:
        raise ParameterError(f"{model} needs smoothing.tau_s above 0 s")

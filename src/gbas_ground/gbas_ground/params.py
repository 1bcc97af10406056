"""Parameters of a ground station: what it is, what it claims, and when it stops claiming it.

Each monitor declares its own, beside its code; they are sections here. What a monitor takes from the rest of the
station (the longest gap, the sites of the antennas) is put together at the end of :class:`GroundParams`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import numpy as np
from pydantic import BeforeValidator, WithJsonSchema

from gbas_core.configuration import read_configuration
from gbas_core.gnss.frames import ecef_from_geodetic
from gbas_core.parameters import ParameterError, from_mapping, json_schema, nested, parameters
from gbas_core.positioning.approach import FinalApproach
from gbas_core.positioning.approach_keys import ApproachSection
from gbas_core.ranging.divergence import DivergenceParams
from gbas_core.record import FloatArray
from gbas_ground.approaches import fas_data_set
from gbas_ground.claims.gradient_claim import GradientClaim, gradient_claim
from gbas_ground.claims.orbit_claim import OrbitSite
from gbas_ground.ionosphere.section import IonosphereSection
from gbas_ground.monitors.b_value import BValueParams
from gbas_ground.monitors.carrier_acceleration import CarrierAccelerationParams
from gbas_ground.monitors.carrier_noise import CarrierNoise
from gbas_ground.monitors.ccd import CcdParams
from gbas_ground.monitors.ccd_f import LARGEST_ZENITH_DELAY_M, TwoFrequencyParams
from gbas_ground.monitors.correction_limits import CorrectionLimitsParams
from gbas_ground.monitors.double_difference import baselines_of
from gbas_ground.monitors.ephemeris_residual import EphemerisResidualParams
from gbas_ground.monitors.expected_power import PowerExpectationParams
from gbas_ground.monitors.expected_range import ExpectedRangeParams
from gbas_ground.monitors.gradient_coverage import gradient_site
from gbas_ground.monitors.ionosphere_gradient import IonosphereGradientParams
from gbas_ground.monitors.registry import SIGNAL_MONITORS
from gbas_ground.monitors.sigma_monitor import SigmaMonitorParams
from gbas_ground.monitors.signal_power import SignalPowerParams
from gbas_ground.param_checks import check_station
from gbas_ground.sections import (
    RSDS_NONE,
    AccuracySection,
    AtmosphereSection,
    EphemerisSection,
    GastDSection,
    MonitorsSection,
    ReceiversSection,
    SecondBandSection,
    SmoothingSection,
    StationSection,
    VdbSection,
)
from gbas_msgs_py.products import PRODUCTS
from gbas_vdb.messages.block import encode_body
from gbas_vdb.messages.path_point import trusted_path_point
from gbas_vdb.messages.types import AdditionalBlock1, AdditionalBlock3, AdditionalBlock4, FasDataSet, Type2, Type4
from gbas_vdb.transmission.burst import SLOT_NAMES
from gbas_vdb.transmission.frame import ScheduleParams

SECTION: Final = "ground"
RENAMED: Final = {
    "power": "signal_power",
    "acceleration": "carrier_acceleration",
    "gradient": "ionosphere_gradient",
    "gradient.baselines": "ionosphere_gradient.pairing",
    "gradient.range": "ionosphere_gradient.gradient_range",
    "gradient.bands": "ionosphere_gradient.carriers",
    "monitors.min_cn0_dbhz": "signal_power.min_cn0_dbhz",
    "monitors.require_cn0": "signal_power.require_cn0",
    "monitors.max_range_residual_m": "expected_range.max_residual_m",
    "monitors.max_prc_m": "correction_limits.max_prc_m",
    "monitors.max_rrc_mps": "correction_limits.max_rrc_mps",
    "monitors.k_b": "b_value.k_b",
}
"""Keys of earlier files, and what they are called now."""


def _approaches(given: Any) -> Any:
    """Approaches of a file, in the order of their names; what cannot be broadcast is refused."""
    if not isinstance(given, Mapping):
        return given
    approaches = []
    for name, keys in sorted(given.items()):
        section = from_mapping(ApproachSection, keys if isinstance(keys, Mapping) else {}, section=name)
        approach = section.approach()
        try:
            if section.arinc424 is not None:
                trusted_path_point(section.arinc424)
            encode_body(Type4(data_sets=(fas_data_set(approach),)))
        except ValueError as error:
            raise ParameterError.at(f"{name}: ", error) from None
        approaches.append(approach)
    return tuple(approaches)


Approaches = Annotated[
    tuple[FinalApproach, ...],
    BeforeValidator(_approaches),
    WithJsonSchema({
        "type": "object",
        "description": "final approaches by name",
        "additionalProperties": json_schema(ApproachSection),
    }),
]  # fmt: skip


@parameters
class GroundParams:
    """Everything a ground station has to be told. Units are SI; files use the units of their key names."""

    station: StationSection
    receivers: ReceiversSection
    accuracy: AccuracySection = AccuracySection()
    atmosphere: AtmosphereSection = AtmosphereSection()
    ephemeris: EphemerisSection = EphemerisSection()
    gast_d: GastDSection = GastDSection()
    vdb: VdbSection = VdbSection()
    smoothing: SmoothingSection = SmoothingSection()
    second_band: SecondBandSection = SecondBandSection()
    ionosphere: IonosphereSection = IonosphereSection()
    approaches: Approaches = ()

    monitors: MonitorsSection = MonitorsSection()
    carrier_noise: CarrierNoise = CarrierNoise()
    expected_range: ExpectedRangeParams = ExpectedRangeParams()
    signal_power: SignalPowerParams = SignalPowerParams()
    expected_power: PowerExpectationParams = PowerExpectationParams()
    ccd: CcdParams = CcdParams()
    ccd_f: TwoFrequencyParams = TwoFrequencyParams()
    carrier_acceleration: CarrierAccelerationParams = CarrierAccelerationParams()
    ionosphere_gradient: IonosphereGradientParams = IonosphereGradientParams()
    ephemeris_residual: EphemerisResidualParams = EphemerisResidualParams()
    b_value: BValueParams = BValueParams()
    correction_limits: CorrectionLimitsParams = CorrectionLimitsParams()
    sigma_monitor: SigmaMonitorParams = SigmaMonitorParams()

    def __post_init__(self) -> None:
        check_station(self)

    # --- the site

    @property
    def n_receivers(self) -> int:
        """Reference receivers the station has, working or not."""
        return len(self.receivers.ecef_m)

    def receiver_positions_m(self) -> FloatArray:
        """Antenna positions of the reference receivers, ECEF, ``(R, 3)`` [m]."""
        return np.array(self.receivers.ecef_m, dtype=np.float64)

    def reference_point_m(self) -> FloatArray:
        """Reference point of the station, ECEF, ``(3,)`` [m]."""
        station = self.station
        return ecef_from_geodetic(station.latitude_rad, station.longitude_rad, station.height_m)

    # --- monitors, with what they take from the station

    def ccd_monitor(self) -> CcdParams:
        """Settings of the single-band divergence monitor: its filters settle with those of the smoothing."""
        settle_s = max(self.ccd.settle_s, self.smoothing.settle_time_s)
        filters = DivergenceParams(tau_s=self.ccd.tau_s, settle_s=settle_s, max_gap_s=self.smoothing.max_gap_s)
        return replace(self.ccd, filters=filters)

    def ccd_f_monitor(self) -> TwoFrequencyParams:
        """Settings of the two-band divergence monitor."""
        zenith_delay_m = self.atmosphere.refractivity * 1e-6 * self.atmosphere.scale_height_m
        return replace(
            self.ccd_f, filters=self.ccd_monitor().filters, zenith_delay_m=min(zenith_delay_m, LARGEST_ZENITH_DELAY_M)
        )

    def carrier_acceleration_monitor(self) -> CarrierAccelerationParams:
        """Settings of the carrier monitor; its noise within seconds is its own, how receivers compare the station's."""
        factor = self.carrier_noise.receiver_factor
        return replace(self.carrier_acceleration, max_gap_s=self.smoothing.max_gap_s, receiver_factor=factor)

    def expected_power_monitor(self) -> PowerExpectationParams:
        """Settings of the monitor of expected C/N0."""
        return replace(self.expected_power, max_gap_s=self.smoothing.max_gap_s)

    def gradient_monitor(self) -> IonosphereGradientParams:
        """Settings of the gradient monitor; a station without approaches is monitored along and across."""
        courses = tuple(approach.course_rad for approach in self.approaches)
        bearings = self.ionosphere_gradient.runway_bearing_rad or courses or (0.0, 0.5 * math.pi)
        return replace(self.ionosphere_gradient, runway_bearing_rad=bearings, noise=self.carrier_noise)

    def ephemeris_monitor(self) -> EphemerisResidualParams:
        """Settings of the ephemeris monitor; its double differences are those of the gradient monitor."""
        return replace(self.ephemeris_residual, bands=self.ionosphere_gradient.bands)

    # --- claims

    def orbit_site(self) -> OrbitSite:
        """What the claim of orbits follows from."""
        return OrbitSite(
            baselines=baselines_of(
                self.receiver_positions_m(), self.reference_point_m(), self.ionosphere_gradient.pairing
            ),
            noise=self.carrier_noise,
            monitor=self.ephemeris_monitor(),
        )

    def gradient_claim(self) -> GradientClaim:
        """Bound on gradients that the station's monitor supports."""
        monitor = self.gradient_monitor()
        site = gradient_site(self.receiver_positions_m(), self.reference_point_m(), monitor)
        return gradient_claim(site, monitor, excludes=monitor.exclude, tau_s=self.smoothing.tau_s[1])

    # --- messages

    def station_message(self) -> Type2:
        """Station data as declared; the broadcast puts in what an epoch does not support."""
        station, atmosphere = self.station, self.atmosphere
        return Type2(
            n_reference_receivers=self.n_receivers if self.n_receivers >= 2 else None,
            ground_accuracy_designator=self.accuracy.designator,
            gcid=station.gcid,
            magnetic_variation_rad=station.magnetic_variation_rad,
            sigma_vert_iono_gradient=atmosphere.sigma_vert_iono_gradient,
            refractivity_index=atmosphere.refractivity,
            scale_height_m=atmosphere.scale_height_m,
            refractivity_uncertainty=atmosphere.refractivity_uncertainty,
            latitude_rad=station.latitude_rad,
            longitude_rad=station.longitude_rad,
            ellipsoid_height_m=station.height_m,
            adb1=AdditionalBlock1(
                reference_station_data_selector=None if station.rsds == RSDS_NONE else station.rsds,
                d_max_m=station.max_use_distance_m or math.inf,
                k_md_e_pos_gps=self.ephemeris.k_md_e_pos,
                k_md_e_c_gps=self.ephemeris.k_md_e_c,
            ),
            adb3=self._service_d_block() if self.gast_d.enabled else None,
            adb4=AdditionalBlock4(slot_group=sum(1 << slot for slot in self.schedule().slots))
            if self.vdb.authentication
            else None,
        )

    def _service_d_block(self) -> AdditionalBlock3:
        return AdditionalBlock3(
            k_md_e_d_gps=self.ephemeris.k_md_e_d,
            sigma_vert_iono_gradient_d=self.atmosphere.sigma_vert_iono_gradient_d,
            y_eig_m=self.gast_d.y_eig_m,
            m_eig=self.gast_d.m_eig,
        )

    def approach_messages(self) -> tuple[FasDataSet, ...]:
        """Approaches as broadcast."""
        return tuple(fas_data_set(approach) for approach in self.approaches)

    def schedule(self) -> ScheduleParams:
        """Settings of the frame schedule."""
        return ScheduleParams(
            station_id=self.station.id,
            slots=tuple(SLOT_NAMES.index(slot) for slot in self.vdb.slots),
            message_types=(1, 11) if self.gast_d.enabled else (1,),
            test=self.vdb.test,
            period_frames=self.vdb.period_frames,
            occupancy_min=self.vdb.occupancy_min,
        )

    def private_kinds(self) -> tuple[int, ...]:
        """Measurement types of the messages with corrections of a second band."""
        return tuple(product.measurement_type for product in PRODUCTS if product.name in self.second_band.products)

    # --- files

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
        sections = nested(mapping)
        _refuse_renamed(sections, source)
        return from_mapping(cls, sections, source=source)

    @classmethod
    def from_yaml(cls, path: str | Path) -> GroundParams:
        """Parameters from a ROS parameter file or a plain one: the sections stand under the key ``ground``.

        Raises
        ------
        ParameterError
            As :meth:`from_mapping`, and when the file is missing, is not YAML, or has no ``ground`` key.
        """
        return cls.from_mapping(read_configuration(path).section(SECTION), source=str(path))


def _with_further_monitors(station: type[GroundParams]) -> type[GroundParams]:
    """The class with a section for each monitor of the registry that has parameters and no section there."""
    known = {each.name for each in fields(station)}
    further = {
        monitor.entry.name: monitor.parameters
        for monitor in SIGNAL_MONITORS
        if monitor.parameters is not None and monitor.entry.name not in known
    }
    if not further:
        return station
    sections = {name: kind() for name, kind in further.items()}
    body = {"__annotations__": further, "__doc__": station.__doc__, "__module__": station.__module__, **sections}
    return parameters(type(station.__name__, (station,), body))


if not TYPE_CHECKING:
    GroundParams = _with_further_monitors(GroundParams)


def watching(params: GroundParams) -> GroundParams:
    """The same, with no monitor of signals or of B values over time that excludes."""
    names = ("ccd", "carrier_acceleration", "ionosphere_gradient", "ephemeris_residual", "signal_power")
    changes: dict[str, Any] = {
        name: replace(getattr(params, name), exclude=False) for name in (*names, "expected_power", "sigma_monitor")
    }
    return replace(params, ccd_f=replace(params.ccd_f, exclude="none"), **changes)


def _refuse_renamed(sections: Mapping[str, Any], source: str) -> None:
    """Say the new name of a key of an earlier file."""
    for old, new in sorted(RENAMED.items(), key=lambda each: "." not in each[0]):
        first, _, key = old.partition(".")
        section = sections.get(first)
        if first in sections and (not key or (isinstance(section, Mapping) and key in section)):
            raise ParameterError(f"{source}: {old} is now called {new}")

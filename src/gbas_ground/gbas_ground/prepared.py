"""A station made ready: its parameters with everything that follows from them once and for all."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from gbas_core.ranging.channel_filter import ChannelFilterParams
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import satellites_of
from gbas_ground.channels.predicted_ranges import Site, site_of
from gbas_ground.channels.tracking import SMOOTHED_BANDS, filter_params
from gbas_ground.claims.limits import MAX_DECORRELATION
from gbas_ground.claims.orbit_claim import OrbitSite, orbit_bound
from gbas_ground.corrections.kernels.consistency import Settings
from gbas_ground.corrections.second_band import BAND, SecondBandSettings, second_band_of
from gbas_ground.corrections.sigma import settings_of
from gbas_ground.ionosphere.places import Places, places_of
from gbas_ground.monitors.carrier_acceleration import CarrierAccelerationParams
from gbas_ground.monitors.ccd import CcdParams
from gbas_ground.monitors.ccd_f import TwoFrequencyParams
from gbas_ground.monitors.double_difference import DoubleDifferences, Troposphere
from gbas_ground.monitors.ephemeris_residual import EphemerisResidualParams
from gbas_ground.monitors.expected_power import PowerExpectationParams
from gbas_ground.monitors.gradient_coverage import GradientSite, gradient_site
from gbas_ground.monitors.ionosphere_gradient import IonosphereGradientParams
from gbas_ground.monitors.shared_receiver import Planes, planes_of
from gbas_ground.params import GroundParams
from gbas_vdb.messages.types import FasDataSet, Type2
from gbas_vdb.transmission.frame import ScheduleParams
from gbas_vdb.transmission.schedule import further_sources_that_fit, sources_that_fit


class FrameSettings(NamedTuple):
    """What every frame is made with: station data, approaches, schedule, and how many satellites fit.

    `second_rooms` says how many fit with a second band too, by how many are sent; -1 where not even a message without
    any does. It is empty where there is no second band.
    """

    station: Type2
    approaches: tuple[FasDataSet, ...]
    schedule: ScheduleParams
    room: int
    second_rooms: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class PreparedStation:
    """What the stages of an epoch work with; made once when the station is switched on.

    Attributes
    ----------
    params : GroundParams
    """

    params: GroundParams

    @cached_property
    def site(self) -> Site:
        """Places of the antennas and the axes at the reference point."""
        return site_of(self.params)

    @cached_property
    def satellites(self) -> BoolArray:
        """Satellites of the systems that are corrected, ``(N,)``."""
        return satellites_of(self.params.station.systems)

    @cached_property
    def filters(self) -> ChannelFilterParams:
        """Settings of the channels' filters."""
        return filter_params(self.params, SMOOTHED_BANDS if self.second is None else (*SMOOTHED_BANDS, BAND))

    @cached_property
    def second(self) -> SecondBandSettings | None:
        """What the second band is made with; None of a station that corrects one only."""
        return second_band_of(self.params)

    @cached_property
    def consistency(self) -> Settings:
        """What the corrections are formed and judged with."""
        return settings_of(self.params)

    @cached_property
    def frames(self) -> FrameSettings:
        """What every frame is made with."""
        params = self.params
        given = params.station_message(), params.approach_messages(), params.schedule()
        room, kinds = sources_that_fit(*given), params.private_kinds()
        second_rooms = [further_sources_that_fit(number, kinds, *given) for number in range(room + 1) if kinds]
        return FrameSettings(*given, room=room, second_rooms=tuple(second_rooms))

    @cached_property
    def places(self) -> Places | None:
        """Where aircraft may be that are protected against ionospheric fronts; None when none are."""
        return places_of(self.params) if self.params.ionosphere.protects else None

    # --- monitors

    @cached_property
    def ccd(self) -> CcdParams:
        """Settings of the single-band divergence monitor."""
        return self.params.ccd_monitor()

    @cached_property
    def ccd_f(self) -> TwoFrequencyParams:
        """Settings of the two-band divergence monitor."""
        return self.params.ccd_f_monitor()

    @cached_property
    def carrier_acceleration(self) -> CarrierAccelerationParams:
        """Settings of the carrier monitor."""
        return self.params.carrier_acceleration_monitor()

    @cached_property
    def ionosphere_gradient(self) -> IonosphereGradientParams:
        """Settings of the gradient monitor."""
        return self.params.gradient_monitor()

    @cached_property
    def ephemeris_residual(self) -> EphemerisResidualParams:
        """Settings of the ephemeris monitor."""
        return self.params.ephemeris_monitor()

    @cached_property
    def expected_power(self) -> PowerExpectationParams:
        """Settings of the monitor of expected C/N0."""
        return self.params.expected_power_monitor()

    @cached_property
    def gradient_site(self) -> GradientSite:
        """Baselines, thresholds and coverage of the gradient monitor."""
        return gradient_site(
            self.params.receiver_positions_m(), self.params.reference_point_m(), self.ionosphere_gradient
        )

    @cached_property
    def orbit_site(self) -> OrbitSite:
        """What the claim of orbits follows from."""
        return self.params.orbit_site()

    @cached_property
    def planes(self) -> tuple[Planes, ...]:
        """Planes through the antennas, by which a receiver at fault is told from a gradient."""
        return planes_of(self.gradient_site.baselines, self.ionosphere_gradient.bands)

    @cached_property
    def troposphere(self) -> Troposphere:
        """Troposphere over the baselines."""
        atmosphere = self.params.atmosphere
        return Troposphere(refractivity=atmosphere.refractivity, scale_height_m=atmosphere.scale_height_m)

    @property
    def largest_decorrelation(self) -> float:
        """Largest P a message carries: an orbit that is not bounded within it is not monitored [m/m]."""
        return MAX_DECORRELATION

    def orbit_bound(self, differences: DoubleDifferences, elevation_rad: FloatArray) -> FloatArray:
        """P that the ephemeris monitor supports at one epoch, ``(N,)``; nothing when it excludes nothing [m/m]."""
        if not self.ephemeris_residual.exclude:
            return np.full(elevation_rad.shape, np.inf)
        return orbit_bound(differences, elevation_rad, self.orbit_site)

    @property
    def gradient_required(self) -> bool:
        """Whether satellites must be monitored for gradients."""
        return self.params.ionosphere_gradient.required or self.params.gast_d.demands_monitors

    @property
    def orbit_required(self) -> bool:
        """Whether orbits must be bounded by the station's own monitor."""
        required = self.params.ephemeris_residual.required or self.params.gast_d.demands_monitors
        return required and not self.params.ephemeris.external_monitor

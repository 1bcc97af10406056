"""Decide: what every satellite may be used for, and the protection against ionospheric fronts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from gbas_ground.broadcast import highest_sent
from gbas_ground.ionosphere.protection import IonosphereState, Protection, Sky, changes, protect
from gbas_ground.prepared import PreparedStation
from gbas_ground.stages.correct import Corrected
from gbas_ground.stages.kernels.status import Channels
from gbas_ground.stages.satellite_status import SatelliteStatus, channels_of, satellite_status, withheld
from gbas_msgs_py.codes import EventKind


@dataclass(frozen=True, kw_only=True, eq=False)
class DecideState:
    """Memory of this stage: the protection in force."""

    ionosphere: IonosphereState


class Decided(NamedTuple):
    """Record of this stage.

    Attributes
    ----------
    corrected : Corrected
    channels : Channels
    status : SatelliteStatus
    protection : Protection
    """

    corrected: Corrected
    channels: Channels
    status: SatelliteStatus
    protection: Protection


def decide(state: DecideState, corrected: Corrected, station: PreparedStation) -> tuple[DecideState, Decided]:
    """Status of the satellites; what would be sent and cannot be protected is not used."""
    events = corrected.monitored.tracked.received.now.events
    for each in corrected.findings:
        events.add(EventKind.EXCLUSION, each.subject, each.cause.word, each.value, each.threshold)
    channels = channels_of(corrected)
    status = satellite_status(corrected, channels, station)
    ionosphere, protection = _protect(state.ionosphere, status, corrected, station)
    status = status if protection.available else withheld(status)
    return DecideState(ionosphere=ionosphere), Decided(corrected, channels, status, protection)


def _protect(
    state: IonosphereState, status: SatelliteStatus, corrected: Corrected, station: PreparedStation
) -> tuple[IonosphereState, Protection]:
    """Protection of what would be sent against ionospheric fronts."""
    params, predicted = station.params, corrected.monitored.tracked.predicted
    now = corrected.monitored.tracked.received.now
    if math.isnan(now.dt_s) and not params.ionosphere.protects:
        now.events.add(EventKind.STATION, "station", "ionosphere_no_threat_model")
    usable = status.usable
    sent = highest_sent(usable, predicted.elevation_rad, station.frames.room) if params.ionosphere.protects else usable
    corrections = corrected.corrections
    sky = Sky(predicted.elevation_rad, predicted.azimuth_rad, corrections.sigmas_m[0], corrections.count)
    ionosphere, protection = protect(state, now.epoch_ms, sent, sky, params, station.places)
    if ionosphere.protection is not None and ionosphere.protection is not state.protection:
        for cause, value, threshold in changes(state.protection, ionosphere.protection):
            now.events.add(EventKind.STATION, "station", cause, value, threshold)
    return ionosphere, protection

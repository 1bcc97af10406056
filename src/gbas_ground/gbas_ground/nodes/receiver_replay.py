"""Node: recorded receiver files as live receivers; it drives time for all the others."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np

from gbas_core.gnss.gpstime import from_epoch_key
from gbas_core.gnss.observations import ObservationEpoch
from gbas_core.io.recording import RecordedEpoch, Recording
from gbas_core.parameters import Parameter, ParameterError, parameters
from gbas_core.satellites import satellites_of
from gbas_msgs_py import tables, topics
from gbas_msgs_py.records import MAX_REFERENCE_RECEIVERS
from gbas_node.driver import DriverNode, EphemerisFeed
from gbas_node.params import DriverParams
from gbas_node.serving import run


@parameters
class ReceiverReplayParams(DriverParams):
    """Parameters of the node beside those of every driver. Files are RINEX or recorded RTCM 3."""

    ground_files: Annotated[
        tuple[str, ...], Parameter("observation files of one to four reference receivers, rr1 first")
    ]
    nav_files: Annotated[tuple[str, ...], Parameter("navigation files")]
    user_file: Annotated[str, Parameter("observation file of the aircraft; empty: a station alone")] = ""
    user_nav_files: Annotated[
        tuple[str, ...],
        Parameter("navigation files of the aircraft where they differ; they go to airborne/ephemeris"),
    ] = ()
    galileo: Annotated[Literal["inav", "fnav"], Parameter("preferred Galileo navigation message")] = "inav"
    gps_week: Annotated[
        int,
        Parameter(
            "GPS week of the first epoch of RTCM 3 streams; -1 where they have ephemerides that say it",
            "weeks", -1, 10_000,
        ),
    ] = -1  # fmt: skip
    systems: Annotated[Literal["G", "E", "GE", "EG"], Parameter("satellite systems that are sent")] = "GE"
    start_s: Annotated[
        float, Parameter("first epoch sent, after that of the recording; -1: its beginning", "s", -1.0, 1e9)
    ] = -1.0
    stop_s: Annotated[
        float, Parameter("last epoch sent, after the first of the recording; -1: its end", "s", -1.0, 1e9)
    ] = -1.0

    def __post_init__(self) -> None:
        if not 1 <= len(self.ground_files) <= MAX_REFERENCE_RECEIVERS:
            raise ParameterError(f"ground_files = {self.ground_files!r} is not 1 to {MAX_REFERENCE_RECEIVERS} files")
        if not self.nav_files:
            raise ParameterError("nav_files = () is not 1 or more files")
        if 0.0 <= self.stop_s < self.start_s:
            raise ParameterError(f"stop_s = {self.stop_s!r} is before start_s = {self.start_s!r}")


class ReceiverReplay(DriverNode[RecordedEpoch]):
    """Sends a :class:`gbas_core.io.recording.Recording`, epoch by epoch; a receiver without data sends a marker row."""

    params_type = ReceiverReplayParams

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("receiver_replay", **kwargs)
        files = self.params
        self.recording = Recording.open(
            files.ground_files, files.user_file or None, files.nav_files,
            user_navigation=files.user_nav_files, galileo=files.galileo,
            gps_week=None if files.gps_week < 0 else files.gps_week,
        )  # fmt: skip
        self.unused = ~satellites_of(files.systems)
        self.feeds = [EphemerisFeed(self, topics.EPHEMERIS, self.recording.ephemerides())]
        if files.user_nav_files:
            self.feeds.append(EphemerisFeed(self, topics.AIRBORNE_EPHEMERIS, self.recording.user_ephemerides()))
        self.receivers = [
            self.table_publisher(topic, tables.OBSERVATIONS, readers=1)
            for topic in topics.GROUND_OBSERVATIONS[: len(files.ground_files)]
        ]
        if files.user_file:
            self.user = self.table_publisher(topics.AIRBORNE_OBSERVATIONS, tables.OBSERVATIONS, readers=1)
        for note in self.recording.notes():
            self.log(note)

    def epochs(self) -> Iterator[RecordedEpoch]:
        first, last = self.recording.overlap
        start = first + round(max(self.params.start_s, 0.0) * 1000.0)
        stop = last if self.params.stop_s < 0.0 else min(last, first + round(self.params.stop_s * 1000.0))
        return self.recording.epochs(first=start, last=stop)

    def flies(self) -> bool:
        return bool(self.params.user_file)

    def is_airborne(self, epoch: RecordedEpoch) -> bool:
        return epoch.user is not None

    def send(self, epoch: RecordedEpoch) -> None:
        for feed in self.feeds:
            feed.send(epoch.key)
        week, tow_s = from_epoch_key(epoch.key)
        for publisher, observations in zip(self.receivers, epoch.ground, strict=True):
            publisher.publish(self._sent_part(observations or ObservationEpoch(gps_week=week, tow_s=tow_s)))
        if epoch.user is not None:
            self.user.publish(self._sent_part(epoch.user))

    def _sent_part(self, observations: ObservationEpoch) -> ObservationEpoch:
        if not self.unused.any():
            return observations
        names = ("code_m", "carrier_m", "doppler_hz", "cn0_dbhz", "lli")
        kept: dict[str, Any] = {name: np.where(self.unused, np.nan, getattr(observations, name)) for name in names}
        return replace(observations, **kept)


def main() -> None:
    """Console script."""
    run(ReceiverReplay)


if __name__ == "__main__":
    main()

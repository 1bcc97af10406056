"""Node: recorded receiver files as live receivers; it drives time for all the others."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gbas_core.gnss.gpstime import from_epoch_key
from gbas_core.gnss.observations import ObservationEpoch
from gbas_core.io.recording import RecordedEpoch, Recording
from gbas_core.satellites import SYSTEM_MASKS, satellites_of
from gbas_msgs_py import tables, topics
from gbas_msgs_py.records import MAX_REFERENCE_RECEIVERS
from gbas_node.driver import DriverNode, DriverParams, EphemerisFeed
from gbas_node.node import require, run


@dataclass(frozen=True, kw_only=True)
class ReceiverReplayParams(DriverParams):
    """Parameters of the node beside those of every driver.

    Attributes
    ----------
    ground_files : tuple of str
        Observation files of one to four reference receivers, rr1 first: RINEX or recorded RTCM 3, like all files here.
    user_file : str
        Observation file of the aircraft; none for a station alone.
    nav_files : tuple of str
        Navigation files.
    user_nav_files : tuple of str
        Navigation files of the aircraft where they differ; they go to ``airborne/ephemeris``.
    galileo : str
        Preferred Galileo navigation message, ``"inav"`` or ``"fnav"``.
    gps_week : int
        GPS week of the first epoch of RTCM 3 streams; -1 where they have ephemerides that say it.
    systems : str
        Satellite systems that are sent.
    start_s, stop_s : float
        Part of the recording, in seconds after its first epoch; -1 for its beginning and end.
    """

    ground_files: tuple[str, ...] = ()
    user_file: str = ""
    nav_files: tuple[str, ...] = ()
    user_nav_files: tuple[str, ...] = ()
    galileo: str = "inav"
    gps_week: int = -1
    systems: str = "GE"
    start_s: float = -1.0
    stop_s: float = -1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        count = len(self.ground_files)
        require("ground_files", self.ground_files, 1 <= count <= MAX_REFERENCE_RECEIVERS, "1 to 4 files")
        require("nav_files", self.nav_files, bool(self.nav_files), "1 or more files")
        require("galileo", self.galileo, self.galileo in ("inav", "fnav"), "inav or fnav")
        require("gps_week", self.gps_week, self.gps_week >= -1, "-1 or a GPS week")
        known = bool(self.systems) and set(self.systems) <= set(SYSTEM_MASKS)
        require("systems", self.systems, known, f"letters of {''.join(SYSTEM_MASKS)}")
        later = self.stop_s < 0.0 or self.stop_s >= self.start_s
        require("stop_s", self.stop_s, later, f"-1 or not before start_s ({self.start_s:g})")


class ReceiverReplay(DriverNode[RecordedEpoch]):
    """Sends a :class:`gbas_core.io.recording.Recording`, epoch by epoch; a receiver without data sends a marker row."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("receiver_replay", ReceiverReplayParams, **kwargs)
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

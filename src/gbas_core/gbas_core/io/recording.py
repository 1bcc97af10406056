"""Several receivers' files as one recording: what a station and an aircraft saw, epoch by epoch.

The offline command and the replay node both read files through this module, so they see the same epochs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.gnss.gpstime import calendar_text, from_epoch_key
from gbas_core.gnss.observations import ObservationEpoch
from gbas_core.io.rinex import NavigationFile, ObservationFile, read_navigation, read_observations
from gbas_core.io.rtcm import is_rtcm, read_rtcm, read_rtcm_navigation


class RecordingError(ValueError):
    """Files that do not go together; the text names them and says why."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedEpoch:
    """One epoch of a recording; a receiver without any satellite then is None.

    Attributes
    ----------
    key : int
        Epoch [ms since the start of GPS time].
    ground : tuple of ObservationEpoch or None
        One place a reference receiver.
    user : ObservationEpoch or None
    """

    key: int
    ground: tuple[ObservationEpoch | None, ...]
    user: ObservationEpoch | None


@dataclass(frozen=True, kw_only=True, eq=False)
class Recording:
    """Observation files of one to four reference receivers and a user, with navigation for both.

    Attributes
    ----------
    ground : tuple of ObservationFile
    user : ObservationFile or None
        None for a station alone.
    navigation : NavigationFile
    user_navigation : NavigationFile
        What the user received; usually the same.
    """

    ground: tuple[ObservationFile, ...]
    user: ObservationFile | None
    navigation: NavigationFile
    user_navigation: NavigationFile

    @classmethod
    def open(
        cls,
        ground: Sequence[str | Path],
        user: str | Path | None,
        navigation: Sequence[str | Path],
        *,
        user_navigation: Sequence[str | Path] = (),
        galileo: str = "inav",
        gps_week: int | None = None,
    ) -> Recording:
        """Read the files: RINEX or recorded RTCM 3, by their content.

        Parameters
        ----------
        ground, user, navigation, user_navigation
            Files; no user is a station alone, no navigation of the user is the station's.
        galileo : {"inav", "fnav"}
            Preferred Galileo navigation message.
        gps_week : int or None
            GPS week of the first epoch of RTCM 3 streams; None where they have ephemerides that say it.

        Raises
        ------
        RinexError, RtcmError
            When a file cannot be used.
        RecordingError
            When the files do not go together: no epoch in common, or navigation of another time or of two formats.
        """
        # Another site or antenna of a reference receiver: nothing smoothed before it is of use after it.
        files = tuple(_read_observations(path, gps_week).restarted_at_site_changes() for path in ground)
        user_file = None if user is None else _read_observations(user, gps_week)
        own = _read_navigation(navigation, galileo, gps_week)
        theirs = _read_navigation(user_navigation, galileo, gps_week) if user_navigation else own
        recording = cls(ground=files, user=user_file, navigation=own, user_navigation=theirs)
        recording._check()
        return recording

    @property
    def keys(self) -> NDArray[np.int64]:
        """Epochs of all files together, in order."""
        return np.asarray(np.unique(np.concatenate([file.keys for file in self._files()])))

    @property
    def overlap(self) -> tuple[int, int]:
        """First and last epoch between which both a reference receiver and the user (if any) were observing."""
        first = min(int(file.keys[0]) for file in self.ground)
        last = max(int(file.keys[-1]) for file in self.ground)
        if self.user is None:
            return first, last
        return max(first, int(self.user.keys[0])), min(last, int(self.user.keys[-1]))

    def epochs(self, *, first: int = 0, last: int | None = None) -> Iterator[RecordedEpoch]:
        """The epochs from key `first` to key `last`, both included, in order."""
        rows = [{int(key): row for row, key in enumerate(file.keys)} for file in self._files()]
        for key in self.keys.tolist():
            if key < first or (last is not None and key > last):
                continue
            seen = [_observed(file, places.get(key)) for file, places in zip(self._files(), rows, strict=True)]
            count = len(self.ground)
            yield RecordedEpoch(key=key, ground=tuple(seen[:count]), user=None if self.user is None else seen[count])

    def ephemerides(self) -> tuple[Ephemeris, ...]:
        """What the station received, in order of reception."""
        return self.navigation.received(*from_epoch_key(int(self.keys[0])))

    def user_ephemerides(self) -> tuple[Ephemeris, ...]:
        """What the user received, in order of reception."""
        return self.user_navigation.received(*from_epoch_key(int(self.keys[0])))

    def notes(self) -> tuple[str, ...]:
        """What the readers left out or repaired, with the file it concerns."""
        observed = [f"{file.path}: {note}" for file in self._files() for note in file.notes]
        navigation = self.navigation.notes
        if self.user_navigation is not self.navigation:
            navigation = (*navigation, *self.user_navigation.notes)
        return (*observed, *navigation)

    def _files(self) -> tuple[ObservationFile, ...]:
        return self.ground if self.user is None else (*self.ground, self.user)

    def _check(self) -> None:
        for file in self._files():
            for navigation in (self.navigation, self.user_navigation):
                if not any(navigation.valid_at(*place).any() for place in (file.first, file.last)):
                    raise RecordingError(
                        f"{navigation.describe()}, but {file.path} was observed from {calendar_text(*file.first)} "
                        f"to {calendar_text(*file.last)}; expected navigation files of that time"
                    )
        if self.user is not None:
            for file in self.ground:
                if not np.intersect1d(file.keys, self.user.keys, assume_unique=True).size:
                    raise RecordingError(
                        f"{file.path} ({_span(file)}) and {self.user.path} ({_span(self.user)}) "
                        "have no epoch in common; expected recordings of the same time"
                    )


def _read_observations(path: str | Path, gps_week: int | None) -> ObservationFile:
    return read_rtcm(path, gps_week=gps_week) if is_rtcm(path) else read_observations(path)


def _read_navigation(paths: Sequence[str | Path], galileo: str, gps_week: int | None) -> NavigationFile:
    streams = [path for path in paths if is_rtcm(path)]
    if not streams:
        return read_navigation(paths, galileo=galileo)
    if len(streams) < len(paths):
        names = ", ".join(map(str, streams))
        raise RecordingError(f"navigation: {names} is RTCM 3 and the rest is not; expected files of one format")
    return read_rtcm_navigation(paths, galileo=galileo, gps_week=gps_week)


def _observed(file: ObservationFile, row: int | None) -> ObservationEpoch | None:
    """The observations in a row of a file; None without a row, or when it has no satellite."""
    if row is None:
        return None
    observation = file.epoch(row)
    return None if observation.empty else observation


def _span(file: ObservationFile) -> str:
    return f"{calendar_text(*file.first)} to {calendar_text(*file.last)}"

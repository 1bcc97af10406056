"""Several receivers' files as one recording: what a station and an aircraft saw, epoch by epoch.

The offline command and the replay node both read files through this module, so they see the same epochs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gbas_core.ephemeris import Ephemeris
from gbas_core.gpstime import calendar_text, from_epoch_key
from gbas_core.observations import ObservationEpoch
from gbas_core.rinex import NavigationFile, ObservationFile, read_navigation, read_observations


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
    ) -> Recording:
        """Read the files.

        Raises
        ------
        RinexError
            When a file cannot be used.
        RecordingError
            When the files do not go together: no epoch in common, or navigation of another time.
        """
        files = tuple(read_observations(path) for path in ground)
        user_file = None if user is None else read_observations(user)
        own = read_navigation(navigation, galileo=galileo)
        theirs = read_navigation(user_navigation, galileo=galileo) if user_navigation else own
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


def _observed(file: ObservationFile, row: int | None) -> ObservationEpoch | None:
    """The observations in a row of a file; None without a row, or when it has no satellite."""
    if row is None:
        return None
    observation = file.epoch(row)
    return None if observation.empty else observation


def _span(file: ObservationFile) -> str:
    return f"{calendar_text(*file.first)} to {calendar_text(*file.last)}"

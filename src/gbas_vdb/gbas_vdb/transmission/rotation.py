"""Which satellite's measurement is first in a type 1 message: only the first one's ephemeris CRC and P are sent.

Rules, over frames: every satellite is first at least once in any 20 frames; after a change of ephemeris it is first in
3 consecutive frames. With many satellites both cannot be done at once at any moment (18 satellites leave 2 spare frames
in 20, a change takes 2 more), so the limit of 20 frames goes first and a change waits where it must:

1. three consecutive frames once begun are finished;
2. a changed ephemeris begins its three frames when all other satellites still keep their limit;
3. a satellite whose present ephemeris was never sent is sent once, on the same condition: an aircraft cannot use it
   before;
4. otherwise the satellite whose limit comes first.

A linked pair of messages has two first places a frame. When a pair becomes one message (18 satellites left of 19) while
many changes are waiting, the limit can be exceeded by a few frames: the places are then not there.

Source: ICAO Annex 10 vol. I, App. B 3.6.7.2.2.8 and table B-75.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

FRAMES_BETWEEN: Final = 20
FRAMES_AFTER_CHANGE: Final = 3


@dataclass(frozen=True, kw_only=True, slots=True)
class SourceHistory:
    """What was sent of one satellite's ephemeris.

    Attributes
    ----------
    key : object
        Names the ephemeris; a new key is a change.
    due : int
        Last frame in which it may next be first.
    sent : bool
        The present ephemeris was sent at least once.
    changed : bool
        The three frames after a change are still owed.
    run_left : int
        Frames left of three consecutive frames in progress.
    """

    key: object
    due: int
    sent: bool = False
    changed: bool = False
    run_left: int = 0


def _updated(history: Mapping[int, SourceHistory], keys: Mapping[int, object], frame: int) -> dict[int, SourceHistory]:
    """History of the satellites that are there now, with new ones and changes entered."""
    updated = {}
    for source in sorted(keys):
        known = history.get(source)
        if known is None:
            known = SourceHistory(key=keys[source], due=frame + FRAMES_BETWEEN - 1)
        elif known.key != keys[source]:
            known = replace(known, key=keys[source], sent=False, changed=True, run_left=0)
        updated[source] = known
    return updated


def choose_first(
    history: Mapping[int, SourceHistory], keys: Mapping[int, object], frame: int, places: int
) -> tuple[tuple[int, ...], dict[int, SourceHistory]]:
    """The satellites that are first in this frame's messages.

    Parameters
    ----------
    history : mapping of ranging source to SourceHistory
        As returned for the frame before; empty at the start.
    keys : mapping of ranging source to object
        The satellites of this frame and what names their ephemeris.
    frame : int
        Counts up by one from frame to frame.
    places : int
        First places in this frame: the number of type 1 messages.

    Returns
    -------
    chosen : tuple of int
        As many as there are places, or all the satellites.
    history : dict
        For the next frame.
    """
    updated = _updated(history, keys, frame)
    chosen: list[int] = []
    running = [source for source, known in updated.items() if known.run_left > 0]
    for source in running[places:]:  # fewer messages than before: this run must begin again
        updated[source] = replace(updated[source], run_left=0, changed=True)
    for source in running[:places]:
        updated[source] = _sent(updated[source], frame)
        chosen.append(source)
    while len(chosen) < min(places, len(updated)):
        source, begins_run = _next(updated, chosen, frame, places)
        if begins_run:
            updated[source] = replace(updated[source], changed=False, run_left=FRAMES_AFTER_CHANGE)
        updated[source] = _sent(updated[source], frame)
        chosen.append(source)
    return tuple(chosen), updated


def _sent(known: SourceHistory, frame: int) -> SourceHistory:
    return SourceHistory(
        key=known.key,
        due=frame + FRAMES_BETWEEN,
        sent=True,
        changed=known.changed,
        run_left=max(known.run_left - 1, 0),
    )


def _next(history: Mapping[int, SourceHistory], chosen: Sequence[int], frame: int, places: int) -> tuple[int, bool]:
    limits = [(known.due, source) for source, known in history.items() if source not in chosen]
    if not any(known.changed or not known.sent for known in history.values()):
        return min(limits)[1], False
    waiting = [source for _, source in sorted(limits)]
    others = {source: [other for other in waiting if other != source] for source in waiting}
    for source in waiting:
        if history[source].changed and _others_keep_limit(history, others[source], chosen, frame, places, 3):
            return source, True
    for source in waiting:
        if not history[source].sent and _others_keep_limit(history, others[source], chosen, frame, places, 1):
            return source, False
    return waiting[0], False


def _others_keep_limit(
    history: Mapping[int, SourceHistory],
    others: Sequence[int],
    chosen: Sequence[int],
    frame: int,
    places: int,
    frames_taken: int,
) -> bool:
    """Whether the others, sent in the order of their limits, all keep them when a source takes a place for some frames.

    A run in progress has its place until it ends.
    """
    position = 0
    ahead = 0
    while position < len(others):
        if ahead == 0:
            taken = len(chosen) + 1
        else:
            taken = sum(history[other].run_left >= ahead for other in chosen) + (ahead < frames_taken)
        for other in others[position : position + max(places - taken, 0)]:
            if history[other].due < frame + ahead:
                return False
            position += 1
        ahead += 1
    return True

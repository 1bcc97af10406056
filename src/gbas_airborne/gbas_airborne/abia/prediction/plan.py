"""What the aircraft flies now, and the attitudes it plans to fly."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from gbas_core.record import FloatArray

MAX_ROLL_RATE_RADPS: Final = math.radians(720.0)
"""No aircraft rolls faster: a larger rate is an attitude in the wrong unit. Ours."""


@dataclass(frozen=True, kw_only=True)
class Attitude:
    """Attitude and motion at one time; anything not finite is not known.

    Attributes
    ----------
    bank_rad, pitch_rad, heading_rad : float
        Roll angle (right wing down), pitch angle (nose up), true heading [rad].
    roll_rate_radps : float
    speed_mps : float
        Speed through the air, which makes a rate of turn of a bank.
    """

    bank_rad: float
    pitch_rad: float
    heading_rad: float
    roll_rate_radps: float
    speed_mps: float

    @property
    def is_known(self) -> bool:
        """Whether all of it is there and possible: in radians, and rolling no faster than aircraft do."""
        return (
            abs(self.bank_rad) <= math.pi
            and abs(self.pitch_rad) <= 0.5 * math.pi
            and math.isfinite(self.heading_rad)
            and abs(self.roll_rate_radps) <= MAX_ROLL_RATE_RADPS
            and 1.0 <= self.speed_mps < 1000.0
        )

    def vector(self) -> FloatArray:
        """In the order of the kernels."""
        return np.array([self.bank_rad, self.pitch_rad, self.heading_rad, self.roll_rate_radps, self.speed_mps])


@dataclass(frozen=True, kw_only=True, eq=False)
class AttitudePlan:
    """Bank and pitch to be flown, in samples of equal step; between them they go straight.

    Headings follow from the rate of turn of the bank, from the heading that is flown.

    Attributes
    ----------
    start_s, step_s : float
        Time of the first sample and between samples [s].
    bank_rad, pitch_rad : (K,) arrays
    """

    start_s: float
    step_s: float
    bank_rad: FloatArray
    pitch_rad: FloatArray

    def __post_init__(self) -> None:
        if self.bank_rad.ndim != 1 or self.bank_rad.shape != self.pitch_rad.shape or self.bank_rad.size < 2:
            raise ValueError(
                "attitude plan: bank and pitch are not two or more samples each, as many of one as of both"
            )
        if not (math.isfinite(self.start_s) and 0.0 < self.step_s <= 10.0):
            raise ValueError(f"attitude plan: step_s = {self.step_s!r} is not above 0, at most 10 s")

    @classmethod
    def from_points(
        cls, time_s: ArrayLike, bank_rad: ArrayLike, pitch_rad: ArrayLike, *, step_s: float = 0.1
    ) -> AttitudePlan:
        """A plan of points at any increasing times, straight between them.

        Raises
        ------
        ValueError
            For times that do not increase.
        """
        times = np.asarray(time_s, dtype=np.float64)
        if times.size < 2 or not (np.diff(times) > 0.0).all():
            raise ValueError("attitude plan: times do not increase")
        at = times[0] + step_s * np.arange(math.floor((times[-1] - times[0]) / step_s + 1e-9) + 1)
        bank, pitch = (np.interp(at, times, np.asarray(each, dtype=np.float64)) for each in (bank_rad, pitch_rad))
        return cls(start_s=float(times[0]), step_s=step_s, bank_rad=bank, pitch_rad=pitch)

    def place(self, time_s: float) -> float:
        """Where a time is in the samples."""
        return (time_s - self.start_s) / self.step_s

    def covers(self, from_s: float, to_s: float) -> bool:
        """Whether the plan is there, with possible attitudes, over a time."""
        first, last = self.place(from_s), self.place(to_s)
        if not (first >= -1e-6 and last <= self.bank_rad.size - 1 + 1e-6):
            return False
        window = slice(max(math.floor(first), 0), math.ceil(last) + 1)
        bank, pitch = self.bank_rad[window], self.pitch_rad[window]
        with np.errstate(invalid="ignore"):
            return bool((np.abs(bank) < 0.5 * math.pi).all() and (np.abs(pitch) <= 0.5 * math.pi).all())

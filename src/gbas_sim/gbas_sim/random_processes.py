"""Random processes that remember, but any epoch of which can be had by itself, with the same bits.

Every epoch has its own innovations, drawn by a counter based generator (Philox) whose counter starts at the epoch. A
process is laid out from them as Levy laid out Brownian motion: the ends of a block first, then the middle given the
ends, then the quarters given their neighbours, and so on. Because the processes are Markov and Gaussian, what lies
between two epochs depends on these two only, by a formula, and the result has exactly the law asked for. An epoch
needs as many steps as its block has halvings; the last ones are kept, so that epochs in order need one step each.

Sources: Levy's construction as in Karatzas and Shreve, Brownian Motion and Stochastic Calculus (1991), 2.3, with the
bridges of the processes here; Salmon, Moraes, Dror, Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC11 (Philox).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import IntEnum
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from gbas_core.record import FloatArray

EVERYONE: Final = 2**32 - 1
"""Number in place of a receiver's, for what all receivers of a kind have in common."""

_WORD: Final = 2**64 - 1
_KEPT: Final = 96
# Ends of blocks this many correlation times apart are drawn independently: exp(-40) = 4e-18 is below the rounding.
_BLOCK_IN_CORRELATION_TIMES: Final = 40.0


class Stream(IntEnum):
    """What a random number is for: the second word of the generator's key."""

    OSCILLATOR = 30
    HARDWARE = 31
    CLOCK_WALK = 32
    CODE_NOISE = 33
    WHITE_NOISE = 34
    NOISE_BURST = 35
    CORRELATED_ERRORS = 40
    """The first of as many streams as there are kinds of correlated errors, times two (code, carrier)."""


class Normals:
    """Standard normal numbers of one seed and purpose, by receiver and epoch.

    The bits of ``Generator(Philox(key=[seed, stream], counter=[0, 0, epoch, number]))``, without making a generator
    each time.

    Parameters
    ----------
    seed : int
        0 to 2^63 - 1.
    stream : int
        What the numbers are for.
    """

    def __init__(self, seed: int, stream: int) -> None:
        self._philox = np.random.Philox(key=[seed, stream])
        self._generator = np.random.Generator(self._philox)
        self._state = self._philox.state

    def draw(self, number: int, epoch: int, shape: tuple[int, ...]) -> FloatArray:
        """Numbers of one receiver and epoch; epochs may be negative."""
        counter = self._state["state"]["counter"]
        counter[:2] = 0
        counter[2], counter[3] = epoch & _WORD, number
        self._philox.state = self._state
        return self._generator.standard_normal(shape)

    def rows(self, numbers: tuple[int, ...], epoch: int, shape: tuple[int, ...]) -> FloatArray:
        """Numbers ``(R, *shape)`` of several receivers."""
        drawn = np.empty((len(numbers), *shape))
        for row, number in enumerate(numbers):
            drawn[row] = self.draw(number, epoch, shape)
        return drawn


class _Kept:
    """The values of the last nodes computed; what is kept has no influence on what comes out."""

    def __init__(self, compute: Callable[[int], FloatArray]) -> None:
        self._compute = compute
        self._values: dict[int, FloatArray] = {}

    def __call__(self, epoch: int) -> FloatArray:
        value = self._values.pop(epoch, None)
        if value is None:
            value = self._compute(epoch)
            value.flags.writeable = False
        self._values[epoch] = value
        if len(self._values) > _KEPT:
            del self._values[next(iter(self._values))]
        return value


class GaussMarkov:
    """Independent stationary first-order Gauss-Markov processes of unit variance on a grid of epochs.

    Their autocorrelation is ``exp(-|k| / correlation_epochs)`` at any lag k, between any epochs, also of different
    blocks, to within 4e-18; a process that depends on time is this times its standard deviation.

    Parameters
    ----------
    normals : Normals
    numbers : tuple of int
        The receivers, one row each: a receiver's values do not depend on which others there are.
    shape : tuple of int
        Of the processes of one receiver.
    correlation_epochs : array_like
        Correlation time over the interval between epochs, broadcast to `shape` [-]; 0 is white noise.

    Notes
    -----
    With r = exp(-h / correlation_epochs), the middle of two values a and b that are 2 h apart is normal, with mean
    ``r (a + b) / (1 + r^2)`` and variance ``(1 - r^2) / (1 + r^2)``.
    """

    def __init__(
        self, normals: Normals, numbers: tuple[int, ...], shape: tuple[int, ...], correlation_epochs: ArrayLike
    ) -> None:
        self._normals, self._numbers, self._shape = normals, numbers, shape
        correlation = np.broadcast_to(np.asarray(correlation_epochs, dtype=np.float64), shape)
        if not bool((correlation >= 0.0).all()):
            raise ValueError(f"correlation time of {float(correlation.min())!r} epochs is below 0")
        longest = float(correlation.max(initial=0.0))
        halvings = max(0, math.ceil(math.log2(max(1.0, _BLOCK_IN_CORRELATION_TIMES * longest))))
        self._block = 2**halvings
        steps = 2.0 ** np.arange(halvings).reshape((-1,) + (1,) * len(shape))
        with np.errstate(divide="ignore"):
            decay = steps / correlation
        across = 1.0 + np.exp(-2.0 * decay)
        self._weight = np.exp(-decay) / across
        self._spread = np.sqrt(-np.expm1(-2.0 * decay) / across)
        self._node = _Kept(self._compute)

    def at(self, epoch: int) -> FloatArray:
        """Values ``(R, *shape)`` at an epoch, which may be negative; not to be written to."""
        return self._node(epoch)

    def _compute(self, epoch: int) -> FloatArray:
        innovation = self._normals.rows(self._numbers, epoch, self._shape)
        offset = epoch % self._block
        if offset == 0:
            return innovation
        half = offset & -offset
        level = half.bit_length() - 1
        between = self._node(epoch - half) + self._node(epoch + half)
        return np.asarray(self._weight[level] * between + self._spread[level] * innovation)


class TwoStateWalk:
    """A clock's phase and frequency: a random walk in each, the phase also the integral of the frequency.

    Parameters
    ----------
    normals : Normals
    numbers : tuple of int
        The clocks, one row each.
    start : (R, 2) array
        Phase [s] and frequency [s/s] at epoch -1.
    phase_s2ps, frequency_ps : float
        Variances of the two random walks per time: white frequency noise, ``h_0 / 2`` [s^2/s], and random walk of
        frequency, ``2 pi^2 h_-2`` [1/s].
    interval_s : float
        Between epochs [s].

    Source: van Dierendonck, McGraw, Brown, "Relationship between Allan variances and Kalman filter parameters", PTTI
    1984; Brown and Hwang, Introduction to Random Signals and Applied Kalman Filtering, 4th edition (2012), 9.3. The
    middle given both ends is the Kalman update of the prediction from the left end by the right one.
    """

    HALVINGS: Final = 24
    """The walk has 2^24 epochs from -1 on: 97 days at 2 Hz."""

    def __init__(
        self,
        normals: Normals,
        numbers: tuple[int, ...],
        start: FloatArray,
        *,
        phase_s2ps: float,
        frequency_ps: float,
        interval_s: float,
    ) -> None:
        self._normals, self._numbers = normals, numbers
        self._start = np.array(start, dtype=np.float64)
        self._interval_s = interval_s
        steps_s = interval_s * 2.0 ** np.arange(self.HALVINGS + 1)
        noise = [_walk_covariance(step, phase_s2ps, frequency_ps) for step in steps_s]
        self._whole = _root(noise[-1])
        bridges = [_bridge(covariance) for covariance in noise[:-1]]
        self._gain = [gain for gain, _ in bridges]
        self._root = [root for _, root in bridges]
        self._node = _Kept(self._compute)

    def at(self, epoch: int) -> FloatArray:
        """Phase [s] and frequency [s/s] at an epoch, ``(R, 2)``.

        Raises
        ------
        IndexError
            For an epoch before -1 or beyond the walk.
        """
        if not -1 <= epoch < 2**self.HALVINGS:
            raise IndexError(f"epoch {epoch} is not within -1 to {2**self.HALVINGS - 1} of the clock's walk")
        return self._node(epoch + 1)

    def _compute(self, place: int) -> FloatArray:
        if place == 0:
            return self._start
        normal = self._normals.rows(self._numbers, place, (2,))
        whole = 2**self.HALVINGS
        if place == whole:
            return self._moved(self._start, whole) + self._scaled(_times(self._whole, normal), whole)
        half = place & -place
        level = half.bit_length() - 1
        left, right = self._node(place - half), self._node(place + half)
        surprise = right - self._moved(left, 2 * half)
        surprise = surprise * np.array([1.0, half * self._interval_s])
        bridged = _times(self._gain[level], surprise) + _times(self._root[level], normal)
        return np.asarray(self._moved(left, half) + self._scaled(bridged, half))

    def _moved(self, state: FloatArray, epochs: int) -> FloatArray:
        """States some epochs later if nothing happened."""
        phase = state[:, 0] + epochs * self._interval_s * state[:, 1]
        return np.stack([phase, state[:, 1]], axis=-1)

    def _scaled(self, change: FloatArray, epochs: int) -> FloatArray:
        """Phase and frequency from the scaled unknowns of :func:`_walk_covariance`."""
        return np.asarray(change * np.array([1.0, 1.0 / (epochs * self._interval_s)]))


_STEP: Final[FloatArray] = np.array([[1.0, 1.0], [0.0, 1.0]])


def _walk_covariance(step_s: float, phase_s2ps: float, frequency_ps: float) -> FloatArray:
    """Covariance of what a step adds to (phase, frequency times step), both in seconds."""
    white, walk = phase_s2ps * step_s, frequency_ps * step_s**3
    return np.array([[white + walk / 3.0, walk / 2.0], [walk / 2.0, walk]])


def _bridge(noise: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Gain of the middle on the surprise at the right end, and a root of the middle's covariance."""
    surprise = _STEP @ noise @ _STEP.T + noise
    gain = noise @ _STEP.T @ np.linalg.pinv(surprise, hermitian=True)
    return np.asarray(gain), _root(noise - gain @ _STEP @ noise)


def _times(matrix: FloatArray, rows: FloatArray) -> FloatArray:
    """A 2 by 2 matrix times each row, by itself: the bits of a row do not depend on how many there are."""
    first, second = rows[:, 0], rows[:, 1]
    return np.stack([matrix[0, 0] * first + matrix[0, 1] * second, matrix[1, 0] * first + matrix[1, 1] * second], -1)


def _root(covariance: FloatArray) -> FloatArray:
    """A matrix whose product with its transpose is a covariance, which may be singular."""
    values, vectors = np.linalg.eigh(0.5 * (covariance + covariance.T))
    return np.asarray(vectors * np.sqrt(np.clip(values, 0.0, None)))

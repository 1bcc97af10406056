"""Processes any epoch of which can be had by itself: exactly the law asked for, the same bits in any order."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gbas_sim.random_processes import GaussMarkov, Normals, Stream, TwoStateWalk

NUMBERS = (0, 1, 2, 3, 100)
SHAPE = (2, 68)


class UnitInnovations:
    """In place of random numbers: place k is 1 at epoch k, so that a process is the vector of what it is made of."""

    def __init__(self, epochs: int) -> None:
        self.epochs = epochs

    def rows(self, numbers: tuple[int, ...], epoch: int, shape: tuple[int, ...]) -> np.ndarray:
        drawn = np.zeros((len(numbers), self.epochs))
        drawn[:, epoch % self.epochs] = 1.0
        return drawn


def gauss_markov(correlation_epochs: float = 60.0, *, seed: int = 7, numbers: tuple[int, ...] = NUMBERS) -> GaussMarkov:
    return GaussMarkov(Normals(seed, Stream.CODE_NOISE), numbers, SHAPE, correlation_epochs)


def test_normals_are_those_of_a_philox_generator():
    normals = Normals(2**62 + 5, 44)
    for number, epoch in ((0, 0), (100, 123_456), (2**32 - 1, 3), (1, -2)):
        counter = np.array([0, 0, epoch % 2**64, number], dtype=np.uint64)
        generator = np.random.Generator(np.random.Philox(key=[2**62 + 5, 44], counter=counter))
        np.testing.assert_array_equal(normals.draw(number, epoch, (3, 4)), generator.standard_normal((3, 4)))


@pytest.mark.parametrize("correlation_epochs", [0.0, 0.3, 1.0, 5.0])
def test_autocorrelation_is_exactly_exponential(correlation_epochs):
    """From what the values are made of, no statistics: their products are the covariance, across ends of blocks too."""
    block = 2 ** math.ceil(math.log2(max(1.0, 40.0 * correlation_epochs)))
    epochs = 3 * block + 1
    process = GaussMarkov(UnitInnovations(epochs), (0,), (epochs,), correlation_epochs)  # type: ignore[arg-type]
    made_of = np.array([process.at(epoch)[0] for epoch in range(epochs)])
    lag = np.abs(np.arange(epochs)[:, np.newaxis] - np.arange(epochs))
    expected = np.exp(-lag / correlation_epochs) if correlation_epochs else np.eye(epochs)
    # Rounding; blocks are joined as if independent beyond 40 correlation times, exp(-40) = 4e-18.
    np.testing.assert_allclose(made_of @ made_of.T, expected, rtol=0.0, atol=1e-14)


def test_any_order_and_any_company_give_the_same_bits():
    inorder = gauss_markov()
    values = {epoch: inorder.at(epoch) for epoch in range(-300, 4500)}
    shuffled = gauss_markov(numbers=(100, 2))
    for epoch in np.random.default_rng(1).permutation(np.arange(-300, 4500))[:400]:
        np.testing.assert_array_equal(shuffled.at(int(epoch)), values[int(epoch)][[4, 2]])
    np.testing.assert_array_equal(gauss_markov().at(2777), values[2777])
    assert not np.array_equal(gauss_markov(seed=8).at(2777), values[2777])


def test_innovations_are_white_and_normal():
    """x(k+1) - r x(k) is normal white noise of variance 1 - r^2 that knows nothing of what was before."""
    process, r = gauss_markov(20.0), math.exp(-1.0 / 20.0)
    values = np.array([process.at(epoch) for epoch in range(900, 1200)])  # 1024 is the end of a block
    innovation = (values[1:] - r * values[:-1]) / math.sqrt(1.0 - r**2)
    count = innovation.size
    # Standard errors of the moments of normal numbers: 1, sqrt(2), sqrt(6), sqrt(24) over the root of their count.
    for moment, expected, error in ((1, 0.0, 1.0), (2, 1.0, 2.0**0.5), (3, 0.0, 15.0**0.5), (4, 3.0, 96.0**0.5)):
        assert abs((innovation**moment).mean() - expected) < 5.0 * error / math.sqrt(count)
    assert abs((innovation[1:] * innovation[:-1]).mean()) < 5.0 / math.sqrt(count)
    assert abs((innovation[1:] * values[:-2]).mean()) < 5.0 / math.sqrt(count)
    # Receivers, bands and satellites are independent of each other.
    assert abs((innovation[:, 0] * innovation[:, 4]).mean()) < 5.0 / math.sqrt(count / 5)
    assert abs((innovation[..., 0, :] * innovation[..., 1, :]).mean()) < 5.0 / math.sqrt(count / 2)


def test_different_correlation_times_in_one_process():
    slow_and_white = np.array([[10.0], [0.0]]) * np.ones(68)
    process = GaussMarkov(Normals(3, Stream.CODE_NOISE), NUMBERS, SHAPE, slow_and_white)
    values = np.array([process.at(epoch) for epoch in range(200)])
    count = values[1:, :, 0].size
    products = (values[1:] * values[:-1]).mean(axis=(0, 1, 3))
    # Products of neighbours have variance 1 + r^2; those of a slow process come in groups of about 10 of a kind.
    assert abs(products[0] - math.exp(-0.1)) < 5.0 * math.sqrt(2.0 * 10.0 / count)
    assert abs(products[1]) < 5.0 / math.sqrt(count)


def test_negative_correlation_time_is_refused():
    with pytest.raises(ValueError, match="correlation time of -1.0 epochs is below 0"):
        GaussMarkov(Normals(1, 1), (0,), (2,), -1.0)


# --- clocks


class SmallWalk(TwoStateWalk):
    HALVINGS = 5


class UnitPairs:
    """As UnitInnovations, with two numbers an epoch, one clock for each."""

    def __init__(self, places: int) -> None:
        self.places = places

    def rows(self, numbers: tuple[int, ...], epoch: int, shape: tuple[int, ...]) -> np.ndarray:
        drawn = np.zeros((2 * self.places, 2))
        drawn[2 * epoch, 0] = drawn[2 * epoch + 1, 1] = 1.0
        return drawn


@pytest.mark.parametrize(("white", "walk"), [(1e-19, 4e-19), (1e-19, 0.0), (0.0, 4e-19)])
def test_walk_has_exactly_the_covariance_of_the_two_state_clock(white, walk):
    places, interval_s = 2**SmallWalk.HALVINGS + 1, 0.5
    clocks = SmallWalk(
        UnitPairs(places),  # type: ignore[arg-type]
        tuple(range(2 * places)),
        np.zeros((2 * places, 2)),
        phase_s2ps=white,
        frequency_ps=walk,
        interval_s=interval_s,
    )
    made_of = np.array([clocks.at(epoch) for epoch in range(-1, places - 2)])  # (epochs, innovations, 2)
    time_s = interval_s * np.arange(places - 1)
    early = np.minimum.outer(time_s, time_s)
    between = np.abs(np.subtract.outer(time_s, time_s))
    # Integrals of white noise: phase with phase, q1 s + q2 (s^3/3 + s^2 u/2), u later; frequency with frequency, q2 s.
    phases = white * early + walk * (early**3 / 3.0 + early**2 * between / 2.0)
    scale = phases.max()
    np.testing.assert_allclose(made_of[..., 0] @ made_of[..., 0].T, phases, rtol=0.0, atol=1e-12 * scale)
    frequencies = made_of[..., 1] @ made_of[..., 1].T
    np.testing.assert_allclose(frequencies, walk * early, rtol=0.0, atol=1e-12 * scale / time_s[-1] ** 2)


def test_walk_in_any_order_and_company():
    def walk(numbers):
        start = np.array([[1e-6 * number, 1e-9] for number in numbers])
        return TwoStateWalk(
            Normals(5, Stream.CLOCK_WALK), numbers, start, phase_s2ps=1e-19, frequency_ps=4e-19, interval_s=0.5
        )

    inorder = walk((0, 1, 2))
    values = {epoch: inorder.at(epoch) for epoch in range(-1, 600)}
    alone = walk((2,))
    for epoch in (599, 17, 300, -1, 0):
        np.testing.assert_array_equal(alone.at(epoch)[0], values[epoch][2])
    np.testing.assert_array_equal(values[-1][:, 0], [0.0, 1e-6, 2e-6])
    alone.at(2**24 - 1)
    for outside in (-2, 2**24):
        with pytest.raises(IndexError, match="is not within -1 to"):
            alone.at(outside)

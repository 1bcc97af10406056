"""The whole receiver with noise: errors of the position exceed protection levels as often as they may, and no more.

Every epoch is a trial: smoothing is off, so that noise is new each time. Probabilities are raised by scaled
multipliers, so that some hundred trials see the rare events.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from airborne_world import Flight, World, position_of
from gbas_airborne.params import AirborneParams
from gbas_airborne.protection.levels import Multipliers, protection_levels
from gbas_core.gnss.frames import geodetic_from_ecef, rot_enu_ecef
from gbas_core.satellites import N_SATS
from gbas_core.signals import SPEED_OF_LIGHT_MPS

M = 4
TRIALS = 400
WARM_UP_S = 10.0


class NoisyWorld(World):
    """A world whose ranges have the noise of the sigmas: the ground's in the corrections, the rest in the code."""

    def prepare(self, ground: np.ndarray, air: np.ndarray, fault_m: np.ndarray) -> None:
        self._ground, self._air, self._fault = ground, air, fault_m
        self._last = (math.nan, None)
        self.code_error_m = lambda t: self._draw(t)[0]
        self.amend = self._noisy
        self.b_values_m = None

    def _draw(self, t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Code errors, correction errors and B values of an epoch; the same whenever asked."""
        if self._last[0] == t:
            return self._last[1]
        rng = np.random.default_rng(round(1000.0 * t) + 17)
        receivers = rng.normal(size=(M, N_SATS)) * math.sqrt(M) * self._ground
        receivers[0] += self._fault
        mean = receivers.mean(axis=0)
        b_values = mean - (receivers.sum(axis=0) - receivers) / (M - 1)
        self._last = (t, (rng.normal(size=N_SATS) * self._air, mean, b_values))
        return self._last[1]

    def _noisy(self, correction, satellite: int, t: float):
        _, mean, b_values = self._draw(t)
        return replace(
            correction,
            prc_m=correction.prc_m + float(mean[satellite]),
            b_values_m=tuple(float(b) for b in b_values[:, satellite]),
        )


def errors_and_levels(fault_m: np.ndarray, multipliers: Multipliers) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertical and lateral errors and levels under both hypotheses, (TRIALS, 2)."""
    world = NoisyWorld()
    params = AirborneParams(
        smoothing_tau_s=0.0, settle_s=0.0, inflate_unsettled=False, range_test_floor_m=1000.0, max_speed_mps=0.0,
        speed_history_s=0.0,
    )  # fmt: skip
    flight = Flight(world, params)
    flight.run(0.0, WARM_UP_S)
    quiet = flight.solutions[-1]
    other = np.sqrt(quiet.sigma_air_m**2 + quiet.sigma_tropo_m**2 + quiet.sigma_iono_m**2)
    world.prepare(quiet.sigma_gnd_m, other, fault_m)
    errors, h0, h1 = np.zeros((TRIALS, 2)), np.zeros((TRIALS, 2)), np.zeros((TRIALS, 2))
    for k in range(TRIALS):
        t = WARM_UP_S + 0.5 * k
        solution, _, _ = flight.step(t)
        place = world.path(t - world.clock_m(t) / SPEED_OF_LIGHT_MPS)
        lat, lon, _ = geodetic_from_ecef(place)
        east, _, up = rot_enu_ecef(lat, lon) @ (position_of(solution) - place)
        levels = protection_levels(solution, multipliers)
        errors[k], h0[k], h1[k] = np.abs([up, -east]), levels.h0_m, levels.h1_m
    return errors, h0, h1


def most(probability: float) -> float:
    """Largest count that fits a probability: four standard deviations of the binomial above its mean."""
    return TRIALS * probability + 4.0 * math.sqrt(TRIALS * probability * (1.0 - probability))


def least(probability: float) -> float:
    return TRIALS * probability - 4.0 * math.sqrt(TRIALS * probability * (1.0 - probability))


def test_fault_free_coverage() -> None:
    """P(|error| > K sigma) is p / (M + 1) = 10 %: from bits to position, sigmas and projection are what they say."""
    multipliers = Multipliers.generate(0.1 * (M + 1), 0.99, 6.86)
    errors, h0, _ = errors_and_levels(np.zeros(N_SATS), multipliers)
    for count in (errors > h0).sum(axis=0):
        assert least(0.1) <= count <= most(0.1)


@pytest.mark.parametrize("fault_m", [1.0, 12.0])
def test_faulted_receiver_coverage(fault_m: float) -> None:
    """A fault of one receiver on every third satellite: the H1 level fails with at most Q(K_md) = 10 %.

    12 m put 3 m on the corrections, far beyond the fault-free level of this scaled K; the B values carry it to the H1
    level. They come in steps of 5 cm, which is small against the noise.
    """
    k_md = np.full(5, np.nan)
    k_md[M] = 1.2816  # Q^-1(0.1)
    k_ffmd = np.full(5, 1.6449)
    fault = np.where(np.arange(N_SATS) % 3 == 0, fault_m, 0.0)
    errors, h0, h1 = errors_and_levels(fault, Multipliers(k_ffmd=k_ffmd, k_md=k_md))
    for count in (errors > h1).sum(axis=0):
        assert count <= most(0.1)
    if fault_m > 10.0:
        # Without the B values the fault would go unnoticed: the guard that the test tests something.
        assert ((errors > h0).sum(axis=0) > most(0.1)).any()

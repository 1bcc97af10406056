"""The station's double differences at one epoch, and the receivers they speak of.

The gradient monitor and the ephemeris monitor judge satellites by the same double differences. A receiver that is wrong
itself is named by them (:mod:`~gbas_ground.monitors.shared_receiver`), and then it is not the satellites'.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from gbas_core.record import BoolArray, FloatArray
from gbas_ground.monitors.double_difference import DoubleDifferences, double_differences, reference_satellites
from gbas_ground.monitors.kernels.double_difference import any_beyond
from gbas_ground.monitors.result import MonitorResult
from gbas_ground.monitors.shared_receiver import SharedReceiver, seen_quiet, shared_receiver

if TYPE_CHECKING:
    from gbas_ground.monitors.interface import MonitorInputs
    from gbas_ground.prepared import PreparedStation


class FittingDifferences(NamedTuple):
    """Double differences to judge satellites by, and the receiver that is named by them.

    Attributes
    ----------
    differences : DoubleDifferences
    receivers : MonitorResult
        ``(R,)``: satellites that point to each receiver; it fails where they name it.
    """

    differences: DoubleDifferences
    receivers: MonitorResult


def fitting_differences(channels: BoolArray, inputs: MonitorInputs, station: PreparedStation) -> FittingDifferences:
    """Double differences of the channels given, ``(R, N)``.

    When most satellites point to one receiver, theirs are those without it: they are judged at once as it will be from
    now on. Otherwise the satellites bear it as if nothing were known of the receiver.
    """
    differences = _double_differences(channels, inputs, station)
    found = _shared_receiver(differences, inputs, station)
    if not found.most:
        return FittingDifferences(differences, found.receivers)
    kept = channels & ~found.receivers.failed[:, np.newaxis]
    return FittingDifferences(_double_differences(kept, inputs, station), found.receivers)


def quiet_receivers(channels: BoolArray, inputs: MonitorInputs, station: PreparedStation) -> FloatArray:
    """1 for receivers that would do on their baselines, 0 for those that would not, NaN where nobody can tell, (R,)."""
    quiet = np.ones(len(inputs.code_m))
    if not inputs.suspended.any():
        return quiet
    site = station.gradient_site
    for receiver in np.flatnonzero(inputs.suspended.any(axis=1)):
        again = channels.copy()
        again[receiver] |= inputs.suspended[receiver]
        differences = _double_differences(again, inputs, station)
        threshold_m = site.k_ffd * differences.sigma_m
        least = station.params.monitors.min_common_satellites
        found = seen_quiet(differences, threshold_m, site.baselines, int(receiver), least)
        quiet[receiver] = np.nan if found is None else float(found)
    return quiet


def _double_differences(channels: BoolArray, inputs: MonitorInputs, station: PreparedStation) -> DoubleDifferences:
    """Of the channels given, over all baselines."""
    params, elevation_rad = station.ionosphere_gradient, inputs.predicted.elevation_rad
    references = reference_satellites(inputs.may_refer, elevation_rad, params.references)
    used_m = np.where(channels[:, np.newaxis], inputs.residual_of(params.bands), np.nan)
    baselines = station.gradient_site.baselines
    return double_differences(used_m, baselines, references, elevation_rad, params.noise, params.bands)


def _shared_receiver(differences: DoubleDifferences, inputs: MonitorInputs, station: PreparedStation) -> SharedReceiver:
    least = station.params.monitors.receiver_fault_channels
    k_ffd = station.gradient_site.k_ffd
    excludes = station.params.ionosphere_gradient.exclude
    if not (excludes and any_beyond(differences.residual_m, differences.sigma_m, k_ffd, inputs.due)):
        return _nobody(len(inputs.code_m), least)
    return shared_receiver(
        differences,
        k_ffd * differences.sigma_m,
        station.planes,
        inputs.due,
        (inputs.predicted.elevation_rad, inputs.predicted.azimuth_rad),
        least,
    )


@lru_cache(maxsize=8)
def _nobody(n_receivers: int, least: int) -> SharedReceiver:
    """No satellite points to any receiver."""
    number, needed = np.zeros(n_receivers), np.full(n_receivers, float(least))
    failed = np.zeros(n_receivers, dtype=bool)
    return SharedReceiver(receivers=MonitorResult(statistic=number, threshold=needed, failed=failed), most=False)

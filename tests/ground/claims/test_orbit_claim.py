"""P of each satellite: what the station's ephemeris monitor supports, and nothing smaller."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from gbas_core.parameters import ParameterError, replaced
from gbas_ground.claims.orbit_claim import (
    MAX_DECORRELATION,
    OrbitSite,
    claimed_decorrelation,
    orbit_bound,
    supported_decorrelation,
)
from gbas_ground.monitors.double_difference import DoubleDifferences
from gbas_ground.monitors.ephemeris_residual import assumed_sigma_m
from gbas_msgs_py.codes import ExclusionCause
from gbas_msgs_py.records import ChannelState
from ground_runs import half_seconds, params, run
from monitor_scenes import BRAUNSCHWEIG_M, braunschweig_station, station_of
from synthetic_ranges import truth

WATCHING = {"ephemeris_residual__exclude": False}
DESCENT_RAD = np.radians(3.0)


def site_of(count: int = 4, **changes: object) -> OrbitSite:
    station = station_of(BRAUNSCHWEIG_M[:count], "G")
    return replaced(station, {name.replace("__", "."): value for name, value in changes.items()}).orbit_site()


def scanned(site: OrbitSite, elevation_rad: float, seen: np.ndarray, azimuths: int = 72) -> float:
    """Largest P by a scan of directions: the angle that grows until one baseline sees it, for all azimuths.

    A second formulation: no corners, no cross products.
    """
    sigma = assumed_sigma_m(site.baselines, np.array([elevation_rad]), site.noise, site.monitor)[:, 0]
    limit = (site.monitor.multiplier(len(sigma)) + site.monitor.k_md) * sigma
    turn = np.radians(np.arange(0.0, 180.0, 0.05))
    largest = 0.0
    for azimuth in np.linspace(0.0, 2.0 * np.pi, azimuths, endpoint=False):
        across = np.array([np.cos(azimuth), -np.sin(azimuth), 0.0])
        up = np.array(
            [-np.sin(elevation_rad) * np.sin(azimuth), -np.sin(elevation_rad) * np.cos(azimuth), np.cos(elevation_rad)]
        )
        direction = np.cos(turn)[:, np.newaxis] * across + np.sin(turn)[:, np.newaxis] * up
        slope = np.abs(direction @ site.baselines.vector_m[seen].T)
        angle = (limit[seen] / slope).min(axis=1)[:, np.newaxis] * direction
        size = np.hypot(angle[:, 0], angle[:, 1]) * np.cos(DESCENT_RAD) + np.abs(angle[:, 2]) * np.sin(DESCENT_RAD)
        largest = max(largest, float(size.max()))
    return largest


@pytest.mark.parametrize("elevation_deg", [5.0, 12.3, 40.5, 90.0])
@pytest.mark.parametrize("receivers", [(0, 1, 2, 3), (0, 1, 2), (1, 2, 3)])
def test_supported_p_is_that_of_a_scan(elevation_deg: float, receivers: tuple[int, ...]) -> None:
    site = site_of()
    pairs = set(combinations(receivers, 2))
    seen = np.array([pair in pairs for pair in zip(site.baselines.first, site.baselines.second, strict=True)])
    ours = float(supported_decorrelation(site, np.radians([elevation_deg]), seen)[0])
    assert ours >= scanned(site, np.radians(elevation_deg), seen)
    # never more than at the whole degree below; 1 %: the margin between azimuths and the steps of the scan
    assert ours <= 1.01 * scanned(site, np.radians(np.floor(elevation_deg)), seen)


def test_demo_site_supports_what_an_independent_audit_found() -> None:
    """Recomputed with other code for this site: 3.2 to 3.6e-4 at 5 degrees, 2.2 to 2.4e-4 at 10, printed digits."""
    five, ten = supported_decorrelation(site_of(), np.radians([5.0, 10.0]))
    assert 3.15e-4 <= five <= 3.65e-4
    assert 2.15e-4 <= ten <= 2.45e-4


@pytest.mark.parametrize("count", [1, 2])
def test_one_or_two_receivers_support_nothing(count: int) -> None:
    assert np.isinf(supported_decorrelation(site_of(count), np.radians([5.0, 45.0, 90.0]))).all()


def test_receivers_in_a_line_support_nothing() -> None:
    line = BRAUNSCHWEIG_M[0] + np.outer([0.0, 1.0, 2.0], BRAUNSCHWEIG_M[1] - BRAUNSCHWEIG_M[0])
    site = station_of(line, "G").orbit_site()
    assert np.isinf(supported_decorrelation(site, np.radians([5.0, 45.0]))).all()


def test_unknown_elevation_supports_nothing() -> None:
    assert np.isinf(supported_decorrelation(site_of(), np.array([np.nan, -0.1, 1.6]))).all()


def differences_of(site: OrbitSite, sigma_m: np.ndarray) -> DoubleDifferences:
    """An epoch's double differences of one band with these sigmas (B, N), none where a sigma is missing."""
    sigma = sigma_m[:, np.newaxis]
    residual = np.where(np.isfinite(sigma), 0.0, np.nan)
    return DoubleDifferences(residual_m=residual, sigma_m=sigma, nominal_sigma_m=sigma, reference=np.zeros(sigma.shape))


def test_noisier_references_and_lost_baselines_of_an_epoch_count() -> None:
    site, elevation = site_of(), np.radians([20.0, 20.0, 20.0, 20.0, 20.0])
    sigma = assumed_sigma_m(site.baselines, elevation, site.noise, site.monitor)
    sigma[:, 1] *= 0.5  # better references than reckoned with: no smaller P
    sigma[2, 2] *= 1.7  # one baseline noisier
    lost = (site.baselines.first == 2) | (site.baselines.second == 2)
    sigma[lost, 3] = np.nan
    sigma[1:, 4] = np.nan
    nominal, better, noisier, without, alone = orbit_bound(differences_of(site, sigma), elevation, site)
    assert nominal == better == supported_decorrelation(site, elevation)[0]
    assert noisier == pytest.approx(1.7 * nominal, rel=1e-12)  # thresholds are proportional to sigmas
    assert without == supported_decorrelation(site, elevation[:1], ~lost)[0] > nominal
    assert np.isinf(alone)


def test_p_is_in_steps_of_the_message_and_never_smaller() -> None:
    supported = np.array([1.0e-4, 1.001e-4, 1.2751e-3, np.inf])
    assert claimed_decorrelation(supported, 0.0) == pytest.approx([1.0e-4, 1.05e-4, 1.275e-3, 1.275e-3], abs=1e-12)
    assert claimed_decorrelation(supported, 2.0e-4)[:2] == pytest.approx([2.0e-4, 2.0e-4], abs=1e-12)
    assert claimed_decorrelation(supported, 1.5e-4, external=True) == pytest.approx([1.5e-4] * 4, abs=1e-12)


# --- the station


def ran(receivers: int, seconds: int = 8, **changes: object):
    station = params(receivers, station__systems="G", vdb__slots="ABC", smoothing__settle_time_s=2.0, **changes)
    return station, run(truth(receivers), station, half_seconds(2 * seconds))


def broadcast_p(integrity) -> np.ndarray:
    usable = integrity.state == ChannelState.USABLE
    assert usable.sum() >= 4
    return integrity.p_ephemeris[usable]


def test_running_station_broadcasts_what_its_monitor_supports() -> None:
    station, out = ran(4)
    last = out.integrity[-1]
    usable = last.state == ChannelState.USABLE
    least = supported_decorrelation(station.orbit_site(), last.elevation_rad[usable])
    assert (broadcast_p(last) >= least - 1e-12).all()
    assert (broadcast_p(last) < MAX_DECORRELATION).all()
    assert np.array_equal(last.p_ephemeris, last.p_ephemeris_d, equal_nan=True)


def test_receivers_that_drop_out_take_the_claim_with_them() -> None:
    station = params(4, station__systems="G", smoothing__settle_time_s=2.0)

    def three_then_two(second: float, observed):
        gone = 0 if second < 4.0 else 1 if second < 6.0 else 2
        return (*observed[: 4 - gone], *([None] * gone))

    out = run(truth(4), station, half_seconds(16), change=three_then_two)
    four, three, two = (out.integrity[out.seconds.index(second)] for second in (3.5, 5.5, 7.5))
    both = (four.state == ChannelState.USABLE) & (three.state == ChannelState.USABLE)
    assert both.sum() >= 4
    assert (three.p_ephemeris[both] >= four.p_ephemeris[both]).all()
    assert (three.p_ephemeris[both] > four.p_ephemeris[both]).sum() > both.sum() / 2  # the others are in one step
    assert broadcast_p(two) == pytest.approx(MAX_DECORRELATION, abs=1e-12)


@pytest.mark.parametrize(("receivers", "changes"), [(1, {}), (2, {}), (4, WATCHING)], ids=["one", "two", "watching"])
def test_what_is_not_monitored_is_not_claimed(receivers: int, changes: dict) -> None:
    _, out = ran(receivers, **changes)
    assert broadcast_p(out.integrity[-1]) == pytest.approx(MAX_DECORRELATION, abs=1e-12)


def test_external_monitor_is_taken_at_its_word() -> None:
    _, out = ran(2, ephemeris__external_monitor="network of reference stations", ephemeris__p=1.5e-4)
    assert broadcast_p(out.integrity[-1]) == pytest.approx(1.5e-4, abs=1e-12)


@pytest.mark.parametrize(
    "changes",
    [{"ephemeris_residual__required": True}, {"gast_d__enabled": True}],
    ids=["required", "type D"],
)
def test_unmonitored_orbits_are_not_used_where_they_must_be_monitored(changes: dict) -> None:
    _, out = ran(2, **changes)
    last = out.integrity[-1]
    assert not (last.state == ChannelState.USABLE).any()
    assert ExclusionCause.UNMONITORED in last.cause


# --- configurations


@pytest.mark.parametrize(
    ("count", "sections", "expected"),
    [
        (
            4,
            {"ephemeris": {"p": 1.5e-4}},
            "site.yaml: ephemeris.p = 0.00015 is below what the site's monitor supports (0.000357 at 5 deg)",
        ),
        (
            4,
            {"ephemeris": {"p": 2.0e-4}, "monitors": {"elevation_mask_deg": 10.0}},
            "ephemeris.p = 0.0002 is below what the site's monitor supports (0.000239 at 10 deg)",
        ),
        (2, {"ephemeris": {"p": 1.0e-3}}, "ephemeris.p = 0.001 is below what the site's monitor supports (nothing: 1 "),
        (
            4,
            {"ephemeris": {"p": 1.0e-3}, "ephemeris_residual": {"exclude": False}},
            "(nothing: ephemeris_residual.exclude is false)",
        ),
        (
            4,
            {
                "ephemeris": {"p": 5.0e-4, "p_d": 1.0e-4},
                "gast_d": {"enabled": True},
            },
            "ephemeris.p_d = 0.0001 is below",
        ),
        (4, {"ephemeris": {"external_monitor": "SBAS"}}, "ephemeris.p is missing: what ephemeris.external_monitor"),
        (4, {"ephemeris": {"external_monitor": 1}}, "ephemeris.external_monitor = 1 is not a text"),
    ],
)
def test_smaller_p_is_refused_by_name(count: int, sections: dict, expected: str) -> None:
    with pytest.raises(ParameterError) as caught:
        braunschweig_station(count, **sections)
    assert expected in str(caught.value)


@pytest.mark.parametrize(
    ("count", "ephemeris"),
    [
        (4, {}),
        (1, {}),
        (4, {"p": 3.6e-4}),
        (1, {"p": MAX_DECORRELATION}),
        (1, {"p": 1.5e-4, "external_monitor": "network of reference stations"}),
    ],
)
def test_supported_or_declared_p_is_accepted_as_given(count: int, ephemeris: dict) -> None:
    assert braunschweig_station(count, ephemeris=ephemeris).ephemeris.p == ephemeris.get("p", 0.0)

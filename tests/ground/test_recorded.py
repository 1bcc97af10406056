"""The station on recorded observations of real receivers; skipped where the data are not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from gbas_core.gnss.frames import geodetic_from_ecef
from gbas_core.gnss.gpstime import epoch_key, from_epoch_key
from gbas_core.io.recording import Recording
from gbas_core.parameters import made_of
from gbas_core.satellites import SAT_INDEX
from gbas_ground.params import GroundParams, watching
from gbas_ground.station import GroundEpoch, GroundStation
from gbas_msgs_py.codes import ChannelState
from gbas_msgs_py.joining import ReceptionQueue
from gbas_msgs_py.products import L1_30, L1_100, L5_30, L5_100
from ground_runs import receiver_values

SETS = yaml.safe_load((Path(__file__).parents[1] / "tables" / "recorded_sets.yaml").read_text())
GARR_M = (4796983.5094, 160309.1219, 4187340.3440)


def station_at(positions_m, **changes):
    latitude, longitude, height = (float(value) for value in geodetic_from_ecef(np.array(positions_m[0])))
    chosen = {
        "station.id": "TEST",
        "station.latitude_rad": latitude,
        "station.longitude_rad": longitude,
        "station.height_m": height,
        **receiver_values(np.array(positions_m)),
        "receivers.minimum": min(2, len(positions_m)),
        "signal_power.require_cn0": False,
        "vdb.slots": "AB",
        "station.gcid": 1,
    }
    return made_of(GroundParams, chosen | {name.replace("__", "."): value for name, value in changes.items()})


def run(recording, station, first=0, last=None):
    """Integrity and events of a recording; ephemerides as received."""
    ready = GroundStation(station)
    state, queue = ready.initial_state(), ReceptionQueue()
    for ephemeris in recording.ephemerides():
        queue.add(epoch_key(ephemeris.gps_week, ephemeris.tow_s), ephemeris)
    integrity, events = [], []
    for recorded in recording.epochs(first=first, last=last):
        week, tow_s = from_epoch_key(recorded.key)
        epoch = GroundEpoch(
            gps_week=week, tow_s=tow_s, observations=recorded.ground, ephemerides=queue.take(recorded.key)
        )
        state, monitored, _ = ready.step(state, epoch)
        each, told = monitored.integrity, monitored.events
        integrity.append(each)
        events.extend(told)
    return integrity, events


def stacked(integrity, name):
    return np.array([getattr(each, name) for each in integrity])


@pytest.fixture(scope="module")
def upc(data_dir):
    chosen = SETS["upc12_garr"]
    recording = Recording.open(
        [data_dir / name for name in chosen["ground"]], None, [data_dir / name for name in chosen["navigation"]]
    )
    first = int(recording.keys[0])
    return run(recording, station_at(chosen["ground_xyz_m"]), last=first + 1_200_000)


def test_two_receivers_38_m_apart_agree(upc):
    """Differential corrections of two good receivers on one roof line differ by noise and multipath alone."""
    integrity, events = upc
    state = stacked(integrity, "state")
    usable = state == ChannelState.USABLE
    assert usable[231:].sum(axis=1).min() >= 7
    assert not usable[:230].any()  # filters settle for 230 s
    assert not [event for event in events if event.cause in ("b_value", "receiver_fault", "prc_limit", "rrc_limit")]

    b = stacked(integrity, "b_m")[:, L1_100]
    assert np.abs(np.nansum(b, axis=1)).max() < 1e-6  # of one satellite: zero but for rounding
    sigma = stacked(integrity, "sigma_pr_gnd_m")[:, L1_100]
    # Centred over satellites by the removal of the clocks (plain mean over the common set of all satellites used).
    assert np.abs(np.nanmean(np.where(np.isfinite(sigma), b[:, 0], np.nan)[250:], axis=1)).max() < 0.1
    # B / sigma_B stays well inside designator A, and is not suspiciously small: multipath of metres, smoothed.
    normalised = (b[:, 0] / sigma)[usable]
    assert 0.05 < normalised.std() < 1.0
    assert np.abs(normalised).max() < 5.5


def test_corrections_are_those_of_the_atmosphere(upc):
    integrity, _ = upc
    prc, elevation = stacked(integrity, "prc_m")[:, L1_100], stacked(integrity, "elevation_rad")
    usable = np.isfinite(prc)
    # Troposphere 2.4 m and a quiet ionosphere some metres at the zenith, ten times that at 5 degrees, less the mean.
    assert np.abs(prc[usable]).max() < 40.0
    # A lower satellite has the longer delay, so the more negative correction.
    order = [
        np.corrcoef(p[u], 1.0 / np.sin(e[u]))[0, 1] for p, e, u in zip(prc, elevation, usable, strict=True) if u.any()
    ]
    assert np.mean(order) < -0.8
    assert np.nanmax(np.abs(stacked(integrity, "rrc_mps")[:, L1_100])) < 0.1


def test_thirty_and_hundred_seconds_agree_on_a_quiet_day(upc):
    integrity, _ = upc
    difference = stacked(integrity, "prc_m")[:, L1_100] - stacked(integrity, "prc_m")[:, L1_30]
    assert 0.01 < np.nanstd(difference) < 1.0


@pytest.mark.parametrize("faulty", [True, False])
def test_faulty_ephemeris_of_g17_never_comes_into_use(data_dir, faulty):
    """One field of one ephemeris was changed: 2 km along the orbit. Received 18:00, it would be used from 18:02 on."""
    folder = data_dir / "static_pair_L1L2_1h_2010"
    recording = Recording.open(
        [folder / "GARR0770.10o.gz"], None, [folder / ("brdc0770.10nERR.gz" if faulty else "brdc0770.10n.gz")]
    )
    midnight = int(recording.keys[0])
    integrity, events = run(
        recording,
        watching(station_at((GARR_M,), smoothing__max_gap_s=45.0)),  # a file of 30 s: too slow for them
        first=midnight + 17 * 3_600_000,
        last=midnight + 20 * 3_600_000,
    )
    told = [event for event in events if event.cause == "ephemeris_change" and event.subject == "G17"]
    assert len(told) == int(faulty)
    assert all(event.value > 1000.0 for event in told)
    prc = stacked(integrity, "prc_m")[:, L1_100]
    assert np.isfinite(prc[:, SAT_INDEX["G17"]]).sum() > 60
    assert np.nanmax(np.abs(prc)) < 40.0


@pytest.mark.parametrize("name", ["mosaic_base_rover", "spirent_static"])
def test_gps_and_galileo(data_dir, name):
    chosen = SETS[name]
    recording = Recording.open(
        [data_dir / path for path in chosen["ground"]], None, [data_dir / path for path in chosen["navigation"]]
    )
    station = station_at(chosen["ground_xyz_m"], station__systems="GE", signal_power__require_cn0=True)
    integrity, _ = run(recording, station, last=int(recording.keys[0]) + 260_000)
    usable = stacked(integrity, "state") == ChannelState.USABLE
    assert usable[-1, :32].sum() >= 6
    assert usable[-1, 32:].sum() >= 6
    assert np.isnan(stacked(integrity, "b_m")).all()  # one receiver
    for constellation in (slice(0, 32), slice(32, 68)):
        prc = stacked(integrity, "prc_m")[-1, L1_100, constellation]
        assert np.nansum(prc) == pytest.approx(0.0, abs=1e-6)  # a plain mean was removed
        assert np.nanmax(np.abs(prc)) < 40.0


def test_second_band_of_a_recorded_pair(data_dir):
    """Two receivers 1 m apart as a station: L5 and E5a of what is usable on L1, clocks removed band by band."""
    chosen = SETS["mosaic_base_rover"]
    files = [data_dir / path for path in (*chosen["ground"], chosen["user"])]
    recording = Recording.open(files, None, [data_dir / path for path in chosen["navigation"]])
    positions_m = [*chosen["ground_xyz_m"], chosen["user_xyz_m"]]
    changes = {
        "station__systems": "GE", "vdb__slots": "ABCDEF", "second_band__products": ("l5_100", "l5_30"),
        "receivers__minimum": 1, "ccd_f__exclude": "none",
    }  # fmt: skip
    integrity, events = run(recording, station_at(positions_m, **changes))
    prc = stacked(integrity, "prc_m")
    there = np.isfinite(prc[:, L5_100])
    assert not (there & ~np.isfinite(prc[:, L1_100])).any()
    assert there[-1, :32].sum() >= 4
    assert there[-1, 32:].sum() >= 4
    for constellation in (slice(0, 32), slice(32, 68)):
        for product in (L5_100, L5_30):
            common = (integrity[-1].receiver_used[product, :2] == 1.0).all(axis=0)  # others have one receiver only
            own = prc[-1, product, constellation][common[constellation]]
            assert own.sum() == pytest.approx(0.0, abs=1e-6)
    # designator A: its surrogate bounds the pair, and is not suspiciously large
    normalised = stacked(integrity, "b_m")[:, L5_100, 0] / stacked(integrity, "sigma_pr_gnd_m")[:, L5_100]
    assert 0.05 < np.nanstd(normalised) < 1.0
    assert not [event for event in events if event.cause in ("b_value", "range_residual")]

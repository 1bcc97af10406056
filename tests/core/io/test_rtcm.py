"""RTCM 3 streams as arrays: against RTKLIB, the recorded files, what was encoded; and streams that are broken."""

from __future__ import annotations

import gzip
import inspect
import math
import random
from collections.abc import Iterable
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pyrtklib as rtk
import pytest
import sidereon

import rtklib_rtcm
from gbas_core.gnss.ephemeris import FIELDS
from gbas_core.gnss.gpstime import MILLISECONDS_PER_WEEK, calendar_text, gps_from_calendar
from gbas_core.io.rinex import ObservationFile, read_observations
from gbas_core.io.rtcm import RtcmError, is_rtcm, read_rtcm, read_rtcm_navigation
from gbas_core.io.rtcm.ephemeris_fields import _sisa_m, _ura_m
from gbas_core.satellites import SAT_IDS, SAT_INDEX
from gbas_core.signals import BAND_INDEX, L1, L2, L5, SPEED_OF_LIGHT_MPS, WAVELENGTH_M
from rtcm_writer import LOCKED, MS_M, cell, frames_of, msm

FW206 = "raw_streams/fw206mrtk_rtcm.rtcm3"
ROMA = "raw_streams/ROMAMSG.bin"
ROVR = "raw_streams/ROVRMSG.bin"
IMU = "raw_streams/imu_rtcm.rtcm3"
WEEK = 2300
"""A week for streams that do not say theirs; nothing tested depends on it."""
QUANTITIES = ("code_m", "carrier_m", "doppler_hz", "cn0_dbhz", "lli")


# -- streams made with the library's encoder --------------------------------------------------------------------------


def gps_ephemeris(week: int, toe_tow_s: int, satellite: int = 5) -> bytes:
    """Frame of message 1019; all but its times is zero."""
    fields = {"satellite_id": satellite, "week_number": week % 1024, "t_oe": toe_tow_s // 16, "t_oc": toe_tow_s // 16}
    return _ephemeris(sidereon.RtcmGpsEphemeris, sidereon.RtcmMessage.from_gps_ephemeris, fields)


def galileo_ephemeris(week: int, toe_tow_s: int, satellite: int = 3) -> bytes:
    """Frame of message 1046; all but its times is zero."""
    fields = {"satellite_id": satellite, "week_number": week - 1024, "t_oe": toe_tow_s // 60, "t_oc": toe_tow_s // 60}
    return _ephemeris(sidereon.RtcmGalileoInavEphemeris, sidereon.RtcmMessage.from_galileo_inav_ephemeris, fields)


def _ephemeris(body: Any, message: Any, fields: dict[str, int]) -> bytes:
    names = [name for name in inspect.signature(body).parameters if name != "trailing_bits"]
    flags = ("l2_p_data_flag", "fit_interval", "e5b_data_validity", "e1b_data_validity")
    return message(body(**({name: False if name in flags else 0 for name in names} | fields))).to_frame()


def coordinates(x_m: float, station: int = 7) -> bytes:
    """Frame of message 1005 (0.1 mm)."""
    values = (1005, station, 0, True, False, True, False, round(x_m * 1e4), 20000, 30000, False, False, 0)
    return sidereon.RtcmMessage.from_station_coordinates(sidereon.RtcmStationCoordinates(*values)).to_frame()


def read(folder: Path, frames: Iterable[bytes], **arguments: Any) -> ObservationFile:
    path = folder / "stream.bin"
    path.write_bytes(b"".join(frames))
    return read_rtcm(path, **({"gps_week": WEEK} | arguments))


def steady(times_s: Iterable[float], **changes: Any) -> list[bytes]:
    return [msm(round(1000 * time_s), [cell(**changes)]) for time_s in times_s]


@lru_cache(maxsize=4)
def rtklib_observations(path: Path, week: int, tow_s: float) -> dict[tuple[int, str, str], rtklib_rtcm.Observed]:
    return rtklib_rtcm.decode(path, week, tow_s)[0]


# -- recorded files ---------------------------------------------------------------------------------------------------


# RTKLIB gives an epoch only when a message says that it is the last one of its epoch. 41 epochs of FW206 (659 in the
# data's README are without them) and the last one of ROMA never have that message. After the damage at the beginning of
# ROMA it goes on two epochs later than we do.
@pytest.mark.parametrize(
    ("name", "n_epochs", "n_theirs"), [(FW206, 700, 659), (ROMA, 2700, 2697), (ROVR, 2635, 2635), (IMU, 134, 134)]
)
def test_observations_are_those_of_rtklib(data_dir: Path, name: str, n_epochs: int, n_theirs: int) -> None:
    ours = read_rtcm(data_dir / name, gps_week=None if name == IMU else WEEK)
    theirs = rtklib_observations(data_dir / name, *ours.first)
    keys = sorted({key for key, _, _ in theirs})
    assert (len(ours), len(keys)) == (n_epochs, n_theirs)
    assert np.isin(keys, ours.keys).all()
    index, expected, lost = _places(ours, theirs)
    values = np.stack([getattr(ours, quantity)[index] for quantity in QUANTITIES[:4]])
    expected[1] *= WAVELENGTH_M[index[1]]  # cycles
    missing = np.isnan(values)
    assert (expected[missing] == 0.0).all()  # RTKLIB's mark of a missing value
    off = np.where(missing, 0.0, np.abs(values - expected))
    # Doubles of 3e7 m: two roundings. The resolution is 0.02 m (code) and 0.6 mm (carrier).
    assert off[:2].max() < 2e-8
    # RTKLIB keeps Doppler as float32: 2^-13 Hz at 4 kHz.
    assert off[2].max() < 2**-12
    assert off[3].max() < 1e-9
    rows = np.isin(ours.keys, keys[1:])  # of its first one after the damage RTKLIB has only a part
    both = rows[index[0]]
    assert np.isfinite(ours.code_m[rows]).sum() == np.isfinite(values[0, both]).sum()
    assert np.isfinite(ours.carrier_m[rows]).sum() == np.isfinite(values[1, both]).sum()
    _check_loss_of_lock(ours, index, lost)


def _places(
    ours: ObservationFile, theirs: dict[tuple[int, str, str], rtklib_rtcm.Observed]
) -> tuple[tuple[np.ndarray, ...], np.ndarray, np.ndarray]:
    """Where the signals that both have are in our arrays, RTKLIB's four quantities of them, and its loss of lock."""
    row = {int(key): place for place, key in enumerate(ours.keys)}
    band = {(system, str(choice.code)[1:]): BAND_INDEX[band] for (system, band), choice in ours.signals.items()}
    both = [(key, name, code) for key, name, code in theirs if (name[0], code) in band and key in row]
    index = tuple(np.array([(row[k], band[n[0], c], SAT_INDEX[n]) for k, n, c in both]).T)
    found = [theirs[each] for each in both]
    expected = np.array([(each.code_m, each.carrier_cycles, each.doppler_hz, each.cn0_dbhz) for each in found]).T
    return index, expected, np.array([each.lli & 1 for each in found], dtype=bool)


def _check_loss_of_lock(ours: ObservationFile, index: tuple[np.ndarray, ...], lost: np.ndarray) -> None:
    """Whatever RTKLIB calls lost is so here, but for first sights; a carrier that is missing is told at the next."""
    flagged = np.zeros(ours.lli.shape, dtype=bool)
    flagged[index] = lost
    for epoch, band, satellite in np.argwhere(flagged):
        seen = np.flatnonzero(np.isfinite(ours.carrier_m[:, band, satellite]))
        later = seen[seen >= epoch]
        if later.size and later[0] > seen[0]:
            assert int(ours.lli[later[0], band, satellite]) & 1


def test_recorded_gaps_are_those_of_rtklib(data_dir: Path) -> None:
    """Data's README: 2625 common epochs, counted with RTKLIB, which lacks three of ROMA (see above)."""
    ours = [read_rtcm(data_dir / name, gps_week=WEEK) for name in (ROMA, ROVR)]
    theirs = [np.unique([key for key, _, _ in rtklib_observations(each.path, *each.first)]) for each in ours]
    assert np.intersect1d(*theirs).size == 2625
    assert np.intersect1d(*[each.keys for each in ours]).size == 2625 + 3
    for each, keys in zip(ours, theirs, strict=True):
        assert _gaps(each.keys) == _gaps(keys)
        assert _gaps(keys)
        assert each.interval_s == 1.0
    assert np.isnan(ours[1].code_m[:, L5, :32]).all()  # README: ROVR is without GPS L5


def _gaps(keys: np.ndarray) -> list[tuple[int, int]]:
    """Where more than a second is missing: the epoch before and the time to the next [ms]."""
    steps = np.diff(keys)
    return [(int(keys[place]), int(steps[place])) for place in np.flatnonzero(steps > 1000)]


def test_time_and_place_of_a_stream_with_ephemerides(data_dir: Path) -> None:
    """The week is from its messages 1019 (218 modulo 1024) and 1046 (1242): 218 + 2048 = 1242 + 1024."""
    stream = read_rtcm(data_dir / IMU)
    assert calendar_text(*stream.first) == "2023-06-14 14:41:53.000"
    assert stream.first == (2266, 312113.0)
    assert stream.last == (2266, 312246.0)
    assert np.isnan(stream.doppler_hz).all()  # MSM4 has none
    # Message 1006 of the file, as RTKLIB decodes it.
    state = rtk.rtcm_t()
    rtk.init_rtcm(state)
    for byte in (data_dir / IMU).read_bytes()[:20000]:
        rtk.input_rtcm3(state, byte)
    np.testing.assert_allclose(stream.approx_position_m, [state.sta.pos[axis] for axis in range(3)], atol=1e-9)


def test_ephemerides_are_those_of_rtklib(data_dir: Path) -> None:
    ours = read_rtcm_navigation(data_dir / IMU)
    _, theirs = rtklib_rtcm.decode(data_dir / IMU, 2266, 312113.0)
    assert sorted(SAT_IDS[place] for place in ours.satellite) == sorted(name for name, _ in theirs)
    assert len(theirs) == 15
    names = {
        "e_": "e", "m0_rad": "M0", "delta_n_radps": "deln", "omega0_rad": "OMG0", "i0_rad": "i0", "omega_rad": "omg",
        "omega_dot_radps": "OMGd", "idot_radps": "idot", "cuc_rad": "cuc", "cus_rad": "cus", "crc_m": "crc",
        "crs_m": "crs", "cic_rad": "cic", "cis_rad": "cis", "af0_s": "f0", "af1_sps": "f1", "af2_sps2": "f2",
        "iod": "iode", "toe_tow_s": "toes", "toe_week": "week", "health": "svh",
    }  # fmt: skip
    for place, values in zip(ours.satellite, ours.values, strict=True):
        fields = dict(zip(FIELDS, values, strict=True))
        eph = theirs[SAT_IDS[place], 0]
        for name, short in names.items():
            # The same integers with the same scales; RTKLIB multiplies the powers of two in another order.
            assert fields[name.rstrip("_")] == pytest.approx(getattr(eph, short), rel=1e-14, abs=0.0), name
        assert fields["sqrt_a"] ** 2 == pytest.approx(eph.A, rel=1e-14)
        assert fields["group_delay_s"] == pytest.approx(eph.tgd[0], rel=1e-14)
        week = rtk.Arr1Dint(1)
        assert (rtk.time2gpst(eph.toc, week), week[0]) == (fields["toc_tow_s"], fields["toc_week"])
    assert ours.valid_at(2266, 312113.0).sum() == 15
    # Each came in the course of the stream, and is received then.
    assert (ours.transmitted_s >= 2266 * 604800 + 312113.0).all()


# -- what was encoded -------------------------------------------------------------------------------------------------


# RTCM 10403.3: DF400 and DF401 of MSM4 and 5 (2^-24, 2^-29 ms), DF405 and DF406 of MSM6 and 7 (2^-29, 2^-31 ms), DF399
# and DF404 (1 and 0.0001 m/s), DF403 (1 dB-Hz) and DF408 (2^-4 dB-Hz).
@pytest.mark.parametrize(
    ("number", "code_bits", "phase_bits", "cn0_bits"),
    [(1074, 24, 29, 0), (1095, 24, 29, 0), (1076, 29, 31, 4), (1097, 29, 31, 4), (1077, 29, 31, 4)],
)
@pytest.mark.parametrize("seed", range(5))
def test_ranges_are_sums_of_their_parts(
    tmp_path: Path, number: int, code_bits: int, phase_bits: int, cn0_bits: int, seed: int
) -> None:
    rng = random.Random(seed)
    fine = code_bits == 29
    code, phase = rng.randrange(-(2**19 if fine else 2**14) + 1, 2**14), rng.randrange(-(2**21) + 1, 2**21)
    whole, part, cnr = rng.randrange(60, 90), rng.randrange(1024), rng.randrange(1, 64)
    rough_rate, rate = rng.randrange(-900, 900), rng.randrange(-9999, 9999)
    values = {"whole": whole, "part": part, "code": code, "phase": phase, "cnr": cnr}
    one = cell(11, 2, lock=600 if fine else LOCKED, rough_rate=rough_rate, rate=rate, **values)
    stream = read(tmp_path, [msm(1000, [one], number=number)])
    place = (0, L1, SAT_INDEX["E11" if number > 1090 else "G11"])
    rough_ms = whole + Fraction(part, 1024)
    # Doubles of 3e7 m.
    assert stream.code_m[place] == pytest.approx(float((rough_ms + Fraction(code, 2**code_bits)) * MS_M), abs=1e-8)
    assert stream.carrier_m[place] == pytest.approx(float((rough_ms + Fraction(phase, 2**phase_bits)) * MS_M), abs=1e-8)
    assert stream.cn0_dbhz[place] == cnr / 2**cn0_bits
    doppler_hz = -(rough_rate + rate * 1e-4) * 1575.42e6 / SPEED_OF_LIGHT_MPS
    expected = doppler_hz if number % 10 in (5, 7) else math.nan
    assert stream.doppler_hz[place] == pytest.approx(expected, rel=1e-12, nan_ok=True)


# Values that mark a missing part: DF397 255; DF400 -2^14, DF405 -2^19; DF401 -2^21, DF406 -2^23; DF403 and DF408 0; the
# encoder writes those of DF399 and DF404 for None.
@pytest.mark.parametrize(
    ("number", "changes", "gone"),
    [
        (1075, {"whole": 255}, {"code_m", "carrier_m"}),
        (1075, {"code": -(2**14)}, {"code_m"}),
        (1077, {"code": -(2**19)}, {"code_m"}),
        (1075, {"phase": -(2**21)}, {"carrier_m", "lli"}),
        (1077, {"phase": -(2**23)}, {"carrier_m", "lli"}),
        (1075, {"rough_rate": None}, {"doppler_hz"}),
        (1075, {"rate": None}, {"doppler_hz"}),
        (1075, {"cnr": 0}, {"cn0_dbhz"}),
        (1077, {"cnr": 0}, {"cn0_dbhz"}),
        (1077, {"code": -(2**14), "phase": -(2**21)}, set()),
    ],
)
def test_invalid_parts_are_missing(tmp_path: Path, number: int, changes: dict[str, int | None], gone: set[str]) -> None:
    stream = read(tmp_path, [msm(1000, [cell(5), cell(6, **changes)], number=number)])
    if "whole" in changes:
        gone = gone | {"lli"}
    for name in QUANTITIES:
        values = getattr(stream, name)[0, L1]
        assert np.isfinite(values[SAT_INDEX["G05"]])
        assert np.isnan(values[SAT_INDEX["G06"]]) == (name in gone), name


def test_messages_of_an_epoch_belong_together(tmp_path: Path) -> None:
    """GPS in two messages and Galileo in one; other systems are not ours."""
    frames = []
    for second in (1, 2, 3):
        tow_ms = 1000 * second
        frames += [msm(tow_ms, [cell(5), cell(5, 10)]), msm(tow_ms, [cell(7)]), msm(tow_ms + 5, [cell(9)], number=1084)]
        frames += [msm(tow_ms, [cell(3), cell(3, 23)], number=1094), msm(tow_ms, [cell(9)], number=1124)]
    stream = read(tmp_path, frames)
    assert stream.tow_s.tolist() == [1.0, 2.0, 3.0]
    found = {(SAT_IDS[sat], band) for band, sat in np.argwhere(np.isfinite(stream.code_m).all(axis=0))}
    assert found == {("G05", L1), ("G05", L2), ("G07", L1), ("E03", L1), ("E03", L5)}
    assert np.isfinite(stream.code_m).sum() == 15
    assert stream.notes == ()


def test_signals_are_chosen_as_asked(tmp_path: Path) -> None:
    frames = [msm(1000, [cell(5, 2, code=10), cell(5, 10, code=20), cell(5, 16, code=30)])]
    default = read(tmp_path, frames)
    other = read(tmp_path, frames, signals={("G", "L2"): ("2L", "2W")})
    assert (default.signals["G", "L2"].code, other.signals["G", "L2"].code) == ("C2W", "C2L")
    assert other.code_m[0, L2, 4] - default.code_m[0, L2, 4] == pytest.approx(10 * 2**-24 * float(MS_M), abs=1e-8)
    assert np.isnan(other.code_m[:, L1]).all()
    with pytest.raises(ValueError, match="signals"):
        read(tmp_path, frames, signals={("R", "L1"): ("1C",)})


# -- loss of lock -----------------------------------------------------------------------------------------------------


def lli_of(stream: ObservationFile, satellite: str = "G05") -> list[float]:
    return stream.lli[:, L1, SAT_INDEX[satellite]].tolist()


def test_a_lock_time_that_starts_again_is_a_loss_of_lock(tmp_path: Path) -> None:
    """DF402: indicator 8 is 4.096 s and more, 7 is 2.048 s, 0 is less than 0.032 s."""
    locks = [8, 8, 0, 7, 8, 7]
    frames = [msm(1000 * (second + 1), [cell(lock=lock)]) for second, lock in enumerate(locks)]
    assert lli_of(read(tmp_path, frames)) == [0, 0, 1, 0, 0, 1]


@pytest.mark.parametrize(("gap_s", "lock", "lost"), [(4, 8, 0), (5, 8, 1), (60, 12, 0), (70, 12, 1), (600, LOCKED, 1)])
def test_a_gap_is_bridged_only_by_a_lock_time_that_covers_it(tmp_path: Path, gap_s: int, lock: int, lost: int) -> None:
    """DF402: indicator 8 is 4.096 s and more, 12 is 65.536 s, 15 is 524.288 s."""
    assert lli_of(read(tmp_path, steady([1, 2, 2 + gap_s, 3 + gap_s], lock=lock))) == [0, 0, lost, 0]


def test_a_loss_of_lock_without_a_carrier_is_told_with_the_next_carrier(tmp_path: Path) -> None:
    changes = [{}, {"phase": -(2**21), "lock": 0}, {"phase": -(2**21), "lock": 7}, {"lock": 7}, {"lock": 8}]
    frames = [msm(1000 * (second + 1), [cell(**change)]) for second, change in enumerate(changes)]
    stream = read(tmp_path, frames)
    np.testing.assert_array_equal(lli_of(stream), [0, np.nan, np.nan, 1, 0])
    assert np.isfinite(stream.code_m[:, L1, 4]).all()


def test_half_cycles(tmp_path: Path) -> None:
    """Bit 1 while the ambiguity lasts; when it ends the carrier may have moved by half a cycle."""
    frames = [
        msm(1000 * (second + 1), [cell(half=half)]) for second, half in enumerate([False, True, True, False, False])
    ]
    assert lli_of(read(tmp_path, frames)) == [0, 2, 2, 1, 0]


def test_a_loss_of_lock_in_a_lost_message_is_seen_in_the_next(tmp_path: Path) -> None:
    frames = [msm(1000 * second, [cell(lock=lock)]) for second, lock in ((1, LOCKED), (2, 0), (3, 6), (4, 7))]
    assert lli_of(read(tmp_path, [frames[0], *frames[2:]])) == [0, 1, 0]


# -- time -------------------------------------------------------------------------------------------------------------


def test_a_week_ends_in_the_stream(tmp_path: Path) -> None:
    end = MILLISECONDS_PER_WEEK
    times = [end - 2000, end - 1000, 0, 1000]
    stream = read(tmp_path, [msm(time, [cell()]) for time in times])
    assert stream.gps_week.tolist() == [WEEK, WEEK, WEEK + 1, WEEK + 1]
    assert np.diff(stream.keys).tolist() == [1000, 1000, 1000]
    assert lli_of(stream) == [0, 0, 0, 0]


def test_the_week_is_needed(tmp_path: Path) -> None:
    with pytest.raises(RtcmError, match=r"stream\.bin: .*give the GPS week of its first epoch"):
        read(tmp_path, steady([1, 2]), gps_week=None)
    with pytest.raises(RtcmError, match="gps_week -1"):
        read(tmp_path, steady([1, 2]), gps_week=-1)


@pytest.mark.parametrize("message", [gps_ephemeris, galileo_ephemeris])
@pytest.mark.parametrize("week", [1800, 2047, 2048, 2300, 2747])
def test_the_week_is_that_of_an_ephemeris(tmp_path: Path, message: Any, week: int) -> None:
    """Wherever in the stream it comes; weeks 1725 (the first MSM) to 2748 are one GPS cycle of 1024."""
    frames = steady([300_000, 300_001])
    for place in range(3):
        stream = read(tmp_path, [*frames[:place], message(week, 302_400), *frames[place:]], gps_week=None)
        assert stream.first == (week, 300_000.0)
    assert read(tmp_path, [message(week, 302_400), *frames], gps_week=week).first == (week, 300_000.0)
    with pytest.raises(RtcmError, match=f"gps_week {week + 1}: its ephemerides say .* week {week}"):
        read(tmp_path, [message(week, 302_400), *frames], gps_week=week + 1)


def test_the_week_of_the_first_epoch_is_meant(tmp_path: Path) -> None:
    """An ephemeris that comes after the end of the week tells of the week before."""
    frames = [*steady([604_798, 604_799, 0, 1, 20_000]), galileo_ephemeris(2301, 18_000)]
    assert read(tmp_path, frames, gps_week=None).gps_week.tolist() == [2300, 2300, 2301, 2301, 2301]


def test_ephemerides_that_do_not_tell_the_week(tmp_path: Path) -> None:
    """Near the ends of a week theirs is that of transmission or of toe; an old one is of another day."""
    for frames in (
        [*steady([604_799]), gps_ephemeris(2301, 0)],
        [*steady([100]), gps_ephemeris(2300, 3600)],
        [*steady([300_000]), gps_ephemeris(2300, 200_000)],
    ):
        with pytest.raises(RtcmError, match="no ephemeris that says which week"):
            read(tmp_path, frames, gps_week=None)
        read(tmp_path, frames)
    frames = [*steady([300_000]), gps_ephemeris(2300, 302_400), gps_ephemeris(2299, 302_400, satellite=6)]
    with pytest.raises(RtcmError, match="different weeks .*2299, 2300"):
        read(tmp_path, frames, gps_week=None)
    read(tmp_path, frames)


def test_old_ephemerides_are_left_out(tmp_path: Path) -> None:
    path = tmp_path / "stream.bin"
    frames = [*steady([300_000, 300_001]), gps_ephemeris(2300, 302_400), gps_ephemeris(2299, 302_400, satellite=6)]
    path.write_bytes(b"".join([*frames, galileo_ephemeris(2300, 298_800), galileo_ephemeris(2300, 298_800)]))
    read_back = read_rtcm_navigation(path, gps_week=2300)
    assert [SAT_IDS[place] for place in read_back.satellite] == ["E03", "G05"]
    assert read_back.transmitted_s.tolist() == [2300 * 604_800 + 300_001.0] * 2
    assert any("1 ephemerides are of another week" in note for note in read_back.notes)
    path.write_bytes(b"".join(frames[:2]))
    with pytest.raises(RtcmError, match="no ephemeris"):
        read_rtcm_navigation(path, gps_week=2300)


@pytest.mark.parametrize(
    ("sent_s", "toe_s", "own_week", "toe_week"),
    [
        (604_000, 0, 2300, 2301),  # sent before the end of the week, week of transmission
        (604_000, 0, 2301, 2301),  # the same, week of toe
        (600, 603_600, 2300, 2299),  # Galileo: sent after toe
        (600, 603_600, 2299, 2299),
    ],
)
def test_toe_across_the_end_of_a_week(tmp_path: Path, sent_s: int, toe_s: int, own_week: int, toe_week: int) -> None:
    path = tmp_path / "stream.bin"
    path.write_bytes(b"".join([*steady([sent_s]), galileo_ephemeris(own_week, toe_s)]))
    read_back = read_rtcm_navigation(path, gps_week=2300)
    assert read_back.values[0, FIELDS.index("toe_week")] == toe_week
    assert read_back.values[0, FIELDS.index("toc_week")] == toe_week


def test_accuracies() -> None:
    """IS-GPS-200N 20.3.3.3.1.3 (URA) and Galileo OS SIS ICD 2.1, table 76 (SISA)."""
    assert [_ura_m(index) for index in (0, 1, 2, 3, 4, 5, 6, 7, 14)] == [2, 2.8, 4, 5.7, 8, 11.3, 16, 32, 4096]
    assert math.isnan(_ura_m(15))
    pairs = {1: 0.01, 49: 0.49, 50: 0.50, 74: 0.98, 75: 1.0, 99: 1.96, 100: 2.0, 107: 3.12, 125: 6.0}
    assert {index: round(_sisa_m(index), 6) for index in pairs} == pairs
    assert all(math.isnan(_sisa_m(index)) for index in (0, 126, 254, 255))


def test_epochs_before_the_latest_are_left_out(tmp_path: Path) -> None:
    stream = read(tmp_path, steady([10, 11, 9, 12]))
    assert stream.tow_s.tolist() == [10.0, 11.0, 12.0]
    assert any("1 messages are of an epoch before the latest" in note for note in stream.notes)


def test_a_repeated_message_changes_nothing(tmp_path: Path) -> None:
    """The loss of lock of the first stays, one that only the second tells is told at the next epoch."""
    frames = [
        msm(1000, [cell()]),
        msm(2000, [cell(lock=8)]),
        msm(2000, [cell(lock=8, code=99)]),
        msm(3000, [cell(lock=9)]),
    ]
    stream = read(tmp_path, frames)
    assert lli_of(stream) == [0, 1, 0]
    assert stream.code_m[1, L1, 4] == stream.code_m[0, L1, 4]
    assert any("1 observations are in their epoch twice" in note for note in stream.notes)
    frames = [msm(1000, [cell()]), msm(2000, [cell()]), msm(2000, [cell(lock=0)]), msm(3000, [cell(lock=7)])]
    assert lli_of(read(tmp_path, frames)) == [0, 0, 1]


def test_a_time_beyond_the_week_is_left_out(tmp_path: Path) -> None:
    stream = read(tmp_path, [msm(1000, [cell()]), msm(MILLISECONDS_PER_WEEK, [cell()]), msm(2000, [cell()])])
    assert stream.tow_s.tolist() == [1.0, 2.0]
    assert any("1 messages have a time beyond the week" in note for note in stream.notes)


# -- stations, and what else the stream says --------------------------------------------------------------------------


def test_stations(tmp_path: Path) -> None:
    frames = [msm(1000, [cell(5)], station=7), msm(1000, [cell(6)], station=8), msm(2000, [cell(5)], station=7)]
    with pytest.raises(RtcmError, match="stations 7, 8; say which"):
        read(tmp_path, frames)
    with pytest.raises(RtcmError, match="no observations of station 9; there are those of 7, 8"):
        read(tmp_path, frames, station=9)
    frames += [coordinates(1.5, station=8), coordinates(4.25)]
    stream = read(tmp_path, frames, station=7)
    assert (len(stream), stream.marker) == (2, "RTCM 0007")
    assert np.isnan(stream.code_m[:, :, SAT_INDEX["G06"]]).all()
    np.testing.assert_allclose(stream.approx_position_m, [4.25, 2.0, 3.0], atol=1e-9)
    np.testing.assert_array_equal(stream.antenna_delta_hen_m, [0.0, 0.0, 0.0])
    moved = read(tmp_path, [*frames, coordinates(4.75)], station=7)
    assert any("change by up to 0.500 m" in note for note in moved.notes)


def test_smoothed_codes_are_told(tmp_path: Path) -> None:
    stream = read(tmp_path, [msm(1000, [cell()], smoothing=3), msm(2000, [cell()])])
    assert stream.notes == ("1 messages have codes that the receiver smoothed",)


# -- broken streams ---------------------------------------------------------------------------------------------------


def test_a_damaged_frame_loses_what_it_held_and_no_more(tmp_path: Path) -> None:
    """Whichever byte is hit: nothing of its message comes through, and all the others do."""
    frames = [msm(1000 * second, [cell(5), cell(6)]) for second in range(1, 6)]
    whole = read(tmp_path, frames)
    for place in range(len(frames[2])):
        damaged = bytearray(frames[2])
        damaged[place] ^= 0x10
        stream = read(tmp_path, [*frames[:2], bytes(damaged), *frames[3:]])
        kept = [0, 1, 3, 4]
        np.testing.assert_array_equal(stream.keys, whole.keys[kept])
        np.testing.assert_array_equal(stream.code_m, whole.code_m[kept])
        assert any(f"{len(frames[2])} bytes are in no whole frame" in note for note in stream.notes), stream.notes


def test_a_damaged_stream_never_says_anything_new(tmp_path: Path, data_dir: Path) -> None:
    """Random damage to a recorded stream: bits turned, bytes lost and put in, the end cut off."""
    data = (data_dir / IMU).read_bytes()[:60_000]
    (tmp_path / "whole.bin").write_bytes(data)
    whole = read_rtcm(tmp_path / "whole.bin", gps_week=2266)
    rng = random.Random(3)
    for _ in range(20):
        damaged = bytearray(data[: rng.randrange(30_000, len(data))])
        for _ in range(rng.randrange(1, 40)):
            place = rng.randrange(len(damaged))
            damaged[place : place + rng.randrange(2)] = rng.randbytes(rng.randrange(3))
        (tmp_path / "damaged.bin").write_bytes(damaged)
        stream = read_rtcm(tmp_path / "damaged.bin", gps_week=2266)
        rows = np.searchsorted(whole.keys, stream.keys)
        np.testing.assert_array_equal(whole.keys[rows], stream.keys)
        for name in QUANTITIES[:4]:
            ours, theirs = getattr(stream, name), getattr(whole, name)[rows]
            assert (np.isnan(ours) | (ours == theirs)).all()
        assert stream.notes


def test_what_is_no_stream_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RtcmError, match=r"nothing\.rtcm3: cannot be read"):
        read_rtcm(tmp_path / "nothing.rtcm3", gps_week=WEEK)
    for frames in ([], [b"$GPGGA,not this\r\n" * 20], [bytes(range(256))]):
        with pytest.raises(RtcmError, match="no MSM of GPS or Galileo; .*found: none"):
            read(tmp_path, frames)
    with pytest.raises(RtcmError, match="found: 1005, 1084"):
        read(tmp_path, [coordinates(1.0), msm(1000, [cell()], number=1084)])


def test_ranges_without_whole_milliseconds_are_not_read(tmp_path: Path) -> None:
    """MSM1 to MSM3 leave the milliseconds to a receiver that knows where it is."""
    header = sidereon.RtcmMsmHeader(7, 1000, False, 0, 0, 0, 0, False, 0)
    body = sidereon.RtcmMsmMessage(
        1071, "G", "msm1", header, [sidereon.RtcmMsmSatellite(5, None, 512)],
        [sidereon.RtcmMsmSignal(5, 2, 100, None, None, None, None)],
    )  # fmt: skip
    compact = sidereon.RtcmMessage.from_msm(body).to_frame()
    with pytest.raises(RtcmError, match="no MSM4, 5, 6 or 7"):
        read(tmp_path, [compact])
    stream = read(tmp_path, [compact, *steady([1])])
    assert stream.notes == ("observations in other messages than MSM4 to MSM7 are not read: 1 of 1071",)


def test_streams_are_told_by_their_content(tmp_path: Path, data_dir: Path) -> None:
    for name in (FW206, ROMA, ROVR, IMU):
        assert is_rtcm(data_dir / name)
    packed = tmp_path / "packed.obs"
    packed.write_bytes(gzip.compress((data_dir / IMU).read_bytes()))
    assert is_rtcm(packed)
    np.testing.assert_array_equal(read_rtcm(packed).code_m, read_rtcm(data_dir / IMU).code_m)
    for name in ("static_pair_L1L5_2024/base.obs.gz", "raw_streams/F9T-L2-5min.ubx.gz", "raw_streams/x5_rawnav.sbf"):
        assert not is_rtcm(data_dir / name)
    assert not is_rtcm(tmp_path / "nothing")


def test_a_rinex_file_sent_as_rtcm_comes_back(tmp_path: Path, data_dir: Path) -> None:
    """A recorded RINEX file, encoded as MSM7: back within half a step of the message, with its time and its gaps."""
    source = read_observations(data_dir / "static_pair_L1L5_2024/base.obs.gz")
    frames = frames_of(source, range(20))
    stream = read(tmp_path, frames, gps_week=gps_from_calendar(2024, 6, 24)[0])
    np.testing.assert_array_equal(stream.keys, source.keys[:20])
    there = np.isfinite(source.code_m[:20, L1]) & np.isfinite(source.carrier_m[:20, L1])
    code_step_m, phase_step_m = float(MS_M) * 2**-29, float(MS_M) * 2**-31
    assert there.sum() > 200
    assert np.abs(stream.code_m - source.code_m[:20])[:, L1][there].max() <= 0.5 * code_step_m + 1e-8
    carrier = stream.carrier_m[:, L1] - source.carrier_m[:20, L1]
    # The sender takes off whole cycles at the start, so that the fine part has room: the same ones at every epoch.
    for satellite in np.flatnonzero(there.any(axis=0)):
        moved = carrier[:, satellite][there[:, satellite]]
        assert np.ptp(moved) <= phase_step_m + 2e-8
    assert np.abs(stream.cn0_dbhz - source.cn0_dbhz[:20])[:, L1][there].max() <= 2**-5 + 1e-9

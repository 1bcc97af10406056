"""RINEX files as arrays: against what is known of the recorded files, their text, RTKLIB; and files that are broken."""

from __future__ import annotations

import gzip
import random
import re
from pathlib import Path

import numpy as np
import pyrtklib as rtk
import pytest
import sidereon

import rtklib_orbits
from gbas_core.gnss.ephemeris import FIELDS, VALIDITY_S, NavigationMessage
from gbas_core.gnss.gpstime import calendar_text, epoch_key, gps_from_calendar, seconds_between
from gbas_core.io.rinex import DEFAULT_SIGNALS, ObservationFile, RinexError, read_navigation, read_observations
from gbas_core.satellites import IS_GALILEO, IS_GPS, SAT_IDS, SAT_INDEX
from gbas_core.signals import BAND_INDEX, L1, L2, L5, WAVELENGTH_M

UPC1 = "static_pair_L1L2_1h_2010/UPC10770.11o.gz"
MATA = "static_pair_L1L2_1h_2010/MATA0770.10o.gz"
MOSAIC = "static_pair_L1L5_2024/base.obs.gz"
MOSAIC_NAV = "static_pair_L1L5_2024/base.nav.gz"
SPIRENT = "spirent_L1L5_2023/iono-Klob_tropo-Saast_Base-static_MO_Spirent.obs.gz"
GRAS = "static_single_L1L5_2021/GRAS00FRA_R_20223151700_15M_01S_MO.crx.gz"
SEPT = "static_single_L1L5_2021/SEPT078M.21O.gz"
QUANTITIES = ("code_m", "carrier_m", "doppler_hz", "cn0_dbhz", "lli")


def text_of(path: Path) -> str:
    return gzip.decompress(path.read_bytes()).decode("latin-1")


def same(ours: ObservationFile, theirs: ObservationFile, n_epochs: int | None = None) -> None:
    """Both files say the same, the first at its first `n_epochs` epochs."""
    np.testing.assert_array_equal(ours.keys, theirs.keys[:n_epochs])
    for name in QUANTITIES:
        np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name)[:n_epochs], err_msg=name)


# -- what is known of the files ---------------------------------------------------------------------------------------


# Facts of the data's README: first and last epoch, interval, epochs.
@pytest.mark.parametrize(
    ("name", "first", "last", "interval_s", "n_epochs"),
    [
        (UPC1, (2010, 3, 18, 5, 0, 0), (2010, 3, 18, 5, 59, 59), 1.0, 3600),
        ("static_pair_L1L2_1h_2010/UPC20770.11o.gz", (2010, 3, 18, 5, 0, 0), (2010, 3, 18, 5, 59, 59), 1.0, 3600),
        (MOSAIC, (2024, 6, 24, 8, 20, 0), (2024, 6, 24, 8, 25, 0), 1.0, 301),
        ("static_pair_L1L5_2024/rover.obs.gz", (2024, 6, 24, 8, 20, 0), (2024, 6, 24, 8, 25, 0), 1.0, 301),
        (SPIRENT, (2023, 1, 8, 10, 0, 0), (2023, 1, 8, 10, 10, 0), 1.0, 601),
        (SEPT, (2021, 3, 19, 12, 0, 0), (2021, 3, 19, 12, 14, 59), 1.0, 900),
        (GRAS, (2022, 11, 11, 17, 0, 0), (2022, 11, 11, 17, 14, 59), 1.0, 900),
        ("storm_2003/garl3030.03o.gz", (2003, 10, 30, 0, 0, 30), (2003, 10, 30, 23, 59, 0), 30.0, 2878),
    ],
)
def test_epochs_of_the_recorded_files(
    data_dir: Path, name: str, first: tuple, last: tuple, interval_s: float, n_epochs: int
) -> None:
    read = read_observations(data_dir / name)
    assert (read.first, read.last) == (gps_from_calendar(*first), gps_from_calendar(*last))
    assert read.interval_s == interval_s
    assert len(read) == len(read.keys) == n_epochs
    assert (np.diff(read.keys) > 0).all()


def test_satellites_of_the_recorded_files(data_dir: Path) -> None:
    """README: about 5 GPS with L1+L5 and 7 Galileo with E1+E5a on both receivers; L1/L2 GPS alone in 2010."""
    both = [read_observations(data_dir / "static_pair_L1L5_2024" / f"{name}.obs.gz") for name in ("base", "rover")]
    dual = np.logical_and(*(np.isfinite(f.code_m[:, L1]) & np.isfinite(f.code_m[:, L5]) for f in both))
    assert dual[:, IS_GPS].sum(axis=1).mean() == pytest.approx(5.0, abs=1.0)
    assert dual[:, IS_GALILEO].sum(axis=1).mean() == pytest.approx(7.0, abs=1.0)
    upc1 = read_observations(data_dir / UPC1)
    assert np.isnan(upc1.code_m[:, :, IS_GALILEO]).all()
    assert np.isnan(upc1.code_m[:, L5]).all()
    assert np.isnan(upc1.cn0_dbhz).all()


@pytest.mark.parametrize(
    ("name", "choices"),
    [
        (UPC1, {("G", "L1"): "C1C L1C", ("G", "L2"): "C2W L2W"}),
        (
            MOSAIC,
            {
                ("G", "L1"): "C1C L1C D1C S1C",
                ("G", "L2"): "C2W L2W D2W S2W",
                ("G", "L5"): "C5Q L5Q D5Q S5Q",
                ("E", "L1"): "C1C L1C D1C S1C",
                ("E", "L5"): "C5Q L5Q D5Q S5Q",
            },
        ),
        (
            SPIRENT,
            {
                ("G", "L1"): "C1C L1C D1C S1C",
                ("G", "L2"): "C2X L2X D2X S2X",
                ("G", "L5"): "C5I L5I D5I S5I",
                ("E", "L1"): "C1C L1C D1C S1C",
                ("E", "L5"): "C5Q L5Q D5Q S5Q",
            },
        ),
    ],
)
def test_signals_are_chosen_by_preference_and_said(data_dir: Path, name: str, choices: dict) -> None:
    read = read_observations(data_dir / name)
    said = {
        key: " ".join(code for code in (choice.code, choice.carrier, choice.doppler, choice.cn0) if code)
        for key, choice in read.signals.items()
    }
    assert said == choices


def test_header_facts(data_dir: Path) -> None:
    upc1 = read_observations(data_dir / UPC1)
    assert upc1.marker == "UPC1"
    assert upc1.approx_position_m is not None
    np.testing.assert_array_equal(upc1.approx_position_m, [4789013.0077, 176610.1555, 4195034.8091])
    assert upc1.notes == ()
    creu = read_observations(data_dir / "static_pair_L1L2_1h_2010" / "CREU0770.10o.gz")
    assert creu.antenna_delta_hen_m is not None
    np.testing.assert_array_equal(creu.antenna_delta_hen_m, [0.054, 0.0, 0.0])
    assert read_observations(data_dir / SPIRENT).marker == Path(SPIRENT).name  # its header has a blank name
    assert "cover 2010-03-18 05:00:00.000 to 2010-03-18 05:59:59.000" in upc1.describe()


def test_an_epoch_is_a_row_of_the_arrays(data_dir: Path) -> None:
    read = read_observations(data_dir / MOSAIC, simulated=True)
    epoch = read.epoch(7)
    assert (epoch.gps_week, epoch.tow_s, epoch.simulated) == (2320, 116407.0, 1.0)
    for name in QUANTITIES:
        np.testing.assert_array_equal(getattr(epoch, name), getattr(read, name)[7])
    with pytest.raises(ValueError, match="read-only"):
        epoch.code_m[0, 0] = 0.0


# -- against the text, and against RTKLIB -----------------------------------------------------------------------------


@pytest.mark.parametrize(("sat", "row"), [("G05", 0), ("G30", 150), ("E04", 150), ("E09", 300)])
def test_values_are_those_of_the_text(data_dir: Path, sat: str, row: int) -> None:
    """The columns of RINEX 3 (A1,I2.2 then F14.3,I1,I1 each), read here by themselves."""
    text = text_of(data_dir / MOSAIC)
    trackings = {"G": ("1C", "2W", "2L", "5Q"), "E": ("1C", "5Q", "7Q")}[sat[0]]
    kinds = ["X1", *(letter + tracking for tracking in trackings for letter in "CLDS")]
    block = re.split(r"^>", text, flags=re.MULTILINE)[1 + row]
    line = next(line for line in block.splitlines() if line.startswith(sat)).ljust(3 + 16 * len(kinds))
    fields = {kind: line[3 + 16 * i : 19 + 16 * i] for i, kind in enumerate(kinds)}
    read = read_observations(data_dir / MOSAIC).epoch(row)
    index = SAT_INDEX[sat]
    for band, tracking in ((L1, "1C"), (L2, "2W"), (L5, "5Q")):
        for letter, array in (("C", read.code_m), ("D", read.doppler_hz), ("S", read.cn0_dbhz)):
            field = fields.get(letter + tracking, "")[:14].strip()
            assert np.array_equal(array[band, index], float(field) if field else np.nan, equal_nan=True)
        phase = fields.get("L" + tracking, " " * 16)
        carrier = float(phase[:14]) * WAVELENGTH_M[band] if phase[:14].strip() else np.nan
        assert np.array_equal(read.carrier_m[band, index], carrier, equal_nan=True)
        lli = float(phase[14].strip() or 0) if phase[:14].strip() else np.nan
        assert np.array_equal(read.lli[band, index], lli, equal_nan=True)


def rtklib_arrays(path: Path, folder: Path, read: ObservationFile) -> dict[str, np.ndarray]:
    """Code [m], carrier [cycles], Doppler [Hz] and LLI as RTKLIB reads them, in the places of our arrays."""
    rows = {int(key): row for row, key in enumerate(read.keys)}
    arrays = {name: np.full(read.code_m.shape, np.nan) for name in ("P", "L", "D", "LLI")}
    observations, _ = rtklib_orbits.read_rinex(path, folder)
    for number in range(observations.n):
        datum = observations.data[number]
        sat = rtklib_orbits.satellite_name(datum.sat)
        if sat not in SAT_INDEX:
            continue
        week = rtk.Arr1Dint(1)
        tow_s = rtk.time2gpst(datum.time, week)
        row = rows[epoch_key(week[0], tow_s)]
        for band in (L1, L5) if sat[0] == "E" else (L1, L2, L5):  # Galileo's second is E5b in RTKLIB
            for name, array in arrays.items():
                array[row, band, SAT_INDEX[sat]] = getattr(datum, name)[band]
    arrays["P"][arrays["P"] < 1e6] = np.nan  # zero is missing; 1 to 100 is a channel number (X1), which it misreads
    arrays["L"][arrays["L"] == 0.0] = np.nan
    return arrays


# RTKLIB's own choice of tracking is the same in these files.
@pytest.mark.parametrize("name", [UPC1, MOSAIC, SEPT, "storm_2003/amc23030.03o.gz"])
def test_the_whole_file_is_rtklibs(data_dir: Path, tmp_path: Path, name: str) -> None:
    read = read_observations(data_dir / name)
    theirs = rtklib_arrays(data_dir / name, tmp_path, read)
    np.testing.assert_array_equal(read.code_m, theirs["P"])
    # Metres to cycles and back: rounding of 1e8 cycles.
    cycles = read.carrier_m / WAVELENGTH_M[:, np.newaxis]
    np.testing.assert_allclose(cycles, theirs["L"], rtol=0.0, atol=1e-7)
    # RTKLIB keeps Doppler in single precision: 5000 Hz to 0.5 mHz. Zero is its missing.
    np.testing.assert_allclose(np.nan_to_num(read.doppler_hz), np.nan_to_num(theirs["D"]), rtol=0.0, atol=5e-4)
    tracked = np.isfinite(read.carrier_m)
    # RTKLIB keeps the file's bits 0 and 1 and makes further ones of its own.
    np.testing.assert_array_equal(read.lli[tracked].astype(int) & 3, theirs["LLI"][tracked].astype(int) & 3)
    assert np.isnan(read.lli[~tracked]).all()


def test_strengths_in_receivers_own_units_are_not_taken_for_cn0(data_dir: Path) -> None:
    """RINEX 2.10 S1 of the storm's Ashtech and of GARL's Trimble are amplitudes; 200 dB-Hz would be nonsense."""
    for name in ("storm_2003/amc23030.03o.gz", "storm_2003/garl3010.03o.gz", MATA):
        read = read_observations(data_dir / name)
        assert np.isnan(read.cn0_dbhz).all()
        assert any("signal strengths" in note for note in read.notes)
    cn0 = read_observations(data_dir / MOSAIC).cn0_dbhz
    assert np.nanmin(cn0) > 5.0
    assert np.nanmax(cn0) < 65.0


def test_carrier_grows_with_range_and_doppler_is_its_rate(data_dir: Path) -> None:
    """Signs: over a second code and carrier grow alike, and a positive Doppler is an approach (RINEX 3.05, 5.2.13)."""
    read = read_observations(data_dir / MOSAIC)
    for band in (L1, L5):
        code, carrier = np.diff(read.code_m[:, band], axis=0), np.diff(read.carrier_m[:, band], axis=0)
        rate = -read.doppler_hz[:, band] * WAVELENGTH_M[band]
        # Medians: code noise of a few decimetres; the clocks of both are one.
        assert np.nanmedian(np.abs(code - carrier)) < 0.5
        assert np.nanmedian(np.abs(carrier - (rate[1:] + rate[:-1]) / 2.0)) < 0.1


# -- forms of the same file -------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def mosaic_text(data_dir: Path) -> str:
    """The first twenty epochs of a RINEX 3 file."""
    return ">".join(text_of(data_dir / MOSAIC).split(">")[:21])


@pytest.fixture(scope="module")
def upc_text(data_dir: Path) -> str:
    """The first twenty epochs of a RINEX 2 file."""
    text = text_of(data_dir / UPC1)
    return text[: text.index("\n 10  3 18  5  0 20.0") + 1]


def written(folder: Path, text: str | bytes, name: str = "some.obs") -> Path:
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode("latin-1"))
    return path


def test_compact_plain_and_compressed_are_one(tmp_path: Path, mosaic_text: str, upc_text: str) -> None:
    for text in (mosaic_text, upc_text):
        plain = read_observations(written(tmp_path, text))
        assert len(plain) == 20
        for form in (
            sidereon.encode_crinex(text),
            gzip.compress(text.encode()),
            gzip.compress(sidereon.encode_crinex(text).encode()),
            text.replace("\n", "\r\n"),
            gzip.compress(text[:30000].encode()) + gzip.compress(text[30000:].encode()),
        ):
            same(read_observations(written(tmp_path, form)), plain)


def test_a_compact_recording_is_what_it_decodes_to(data_dir: Path, tmp_path: Path) -> None:
    decoded = sidereon.decode_crinex(text_of(data_dir / GRAS))
    same(read_observations(written(tmp_path, decoded)), read_observations(data_dir / GRAS))


@pytest.mark.parametrize("version", ["3.05", "4.00", "4.02"])
def test_later_versions(tmp_path: Path, mosaic_text: str, version: str) -> None:
    newer = mosaic_text.replace("     3.04", f"     {version}", 1)
    same(read_observations(written(tmp_path, newer, "n.obs")), read_observations(written(tmp_path, mosaic_text)))


@pytest.mark.parametrize("version", ["2", "2.0", "2.1", "2.11"])
def test_short_version_numbers(tmp_path: Path, upc_text: str, version: str) -> None:
    short = f"{'     ' + version:<20}" + upc_text[20:]
    same(read_observations(written(tmp_path, short, "n.obs")), read_observations(written(tmp_path, upc_text)))


def test_header_letters_that_are_not_ascii(tmp_path: Path, mosaic_text: str) -> None:
    named = mosaic_text.replace("SEPT  ", "ÖVÜ   ", 1)
    read = read_observations(written(tmp_path, named))
    assert read.marker == "?V?"
    same(read, read_observations(written(tmp_path, mosaic_text, "plain.obs")))


def test_galileo_time_is_gps_time_and_others_are_refused(tmp_path: Path, mosaic_text: str) -> None:
    def in_scale(scale: str) -> Path:
        return written(tmp_path, mosaic_text.replace("GPS         TIME OF FIRST", f"{scale}         TIME OF FIRST", 1))

    same(read_observations(in_scale("GAL")), read_observations(in_scale("GPS")))
    for scale in ("GLO", "BDT"):
        with pytest.raises(RinexError, match=r"some\.obs: TIME OF FIRST OBS: time scale .*; expected GPS or Galileo"):
            read_observations(in_scale(scale))


def test_other_preferences(data_dir: Path) -> None:
    preference = dict(DEFAULT_SIGNALS) | {("G", "L2"): ("2L",)}
    read = read_observations(data_dir / MOSAIC, signals=preference)
    assert read.signals["G", "L2"].code == "C2L"
    default = read_observations(data_dir / MOSAIC)
    assert 0 < np.isfinite(read.code_m[:, L2]).sum() < np.isfinite(default.code_m[:, L2]).sum()
    np.testing.assert_array_equal(read.code_m[:, L1], default.code_m[:, L1])
    with pytest.raises(ValueError, match=r"signals: \('R', 'L1'\) is not a system \(G, E\) and band"):
        read_observations(data_dir / MOSAIC, signals={("R", "L1"): ("1C",)})


def test_code_and_carrier_of_different_tracking_only_if_none_has_both(tmp_path: Path, mosaic_text: str) -> None:
    # C1C becomes C1W: then no tracking of L1 has code and carrier.
    lines = mosaic_text.split("\n")
    lines = [line.replace("C1C L1C", "C1W L1C", 1) if line.startswith("G   17") else line for line in lines]
    read = read_observations(written(tmp_path, "\n".join(lines)))
    choice = read.signals["G", "L1"]
    assert (choice.code, choice.carrier, choice.doppler, choice.cn0) == ("C1W", "L1C", "D1C", "S1C")


def test_a_seldom_tracked_signal_is_not_preferred(tmp_path: Path, mosaic_text: str) -> None:
    """2W blanked in all epochs but the first: 2L has more than twice as many observations."""
    head, *blocks = mosaic_text.split(">")
    first, *others = blocks
    hurt = [re.sub(r"^(G\d\d.{80}).{64}", lambda m: m.group(1) + " " * 64, b, flags=re.MULTILINE) for b in others]
    read = read_observations(written(tmp_path, ">".join([head, first, *hurt])))
    assert read.signals["G", "L2"].code == "C2L"


# -- events -----------------------------------------------------------------------------------------------------------


def test_events_are_skipped_and_losses_of_lock_are_kept(tmp_path: Path, mosaic_text: str) -> None:
    head, *blocks = mosaic_text.split(">")
    plain = read_observations(written(tmp_path, ">".join([head, *blocks[:5]])))
    g05 = next(line for line in blocks[3].splitlines() if line.startswith("G05"))
    blocks[1] = blocks[1][:30] + "1" + blocks[1][31:]  # power failure before the second epoch
    events = [
        f" 2024 06 24 08 20  1.5000000  4  1\n{'A LATER REMARK':<60}COMMENT\n",
        " 2024 06 24 08 20  1.6000000  2  0\n",
        f" 2024 06 24 08 20  1.7000000  3  1\n{'OTHER':<60}MARKER NAME\n",
        "                              5  0\n",
        f" 2024 06 24 08 20  3.0000000  6  1\n{g05}\n",  # a slip of G05 at the fourth epoch
        f" 2024 06 24 08 20  9.0000000  6  1\n{g05}\n",  # and one after the end, which concerns nothing
    ]
    read = read_observations(written(tmp_path, ">".join([head, *blocks[:2], *events[:5], *blocks[2:5], events[5]])))
    np.testing.assert_array_equal(read.keys, plain.keys)
    for name in QUANTITIES[:4]:
        np.testing.assert_array_equal(getattr(read, name), getattr(plain, name))
    expected = plain.lli.copy()
    slipped = (3, slice(None), SAT_INDEX["G05"])
    for place in (1, slipped):
        tracked = np.isfinite(plain.carrier_m[place])
        expected[place] = np.where(tracked, np.nan_to_num(plain.lli[place]).astype(int) | 1, np.nan)
    np.testing.assert_array_equal(read.lli, expected)
    assert (expected[1] >= 1.0).sum() > 40


def test_zero_is_missing(tmp_path: Path, mosaic_text: str) -> None:
    code = next(line for line in mosaic_text.split(">")[1].splitlines() if line.startswith("G05"))[19:33]
    read = read_observations(written(tmp_path, mosaic_text.replace(code, "         0.000", 1)))
    assert np.isnan(read.code_m[0, L1, SAT_INDEX["G05"]])
    assert np.isfinite(read.carrier_m[0, L1, SAT_INDEX["G05"]])


def test_epochs_that_go_back_are_left_out(tmp_path: Path, mosaic_text: str) -> None:
    head, *blocks = mosaic_text.split(">")
    read = read_observations(written(tmp_path, ">".join([head, *blocks[:5], *blocks[3:8]])))
    same(read, read_observations(written(tmp_path, mosaic_text)), 8)
    assert "2 epochs are not later than the one before and were left out" in read.notes


def test_the_interval_is_that_of_the_epochs(tmp_path: Path, mosaic_text: str) -> None:
    head, *blocks = mosaic_text.split(">")
    thinned = read_observations(written(tmp_path, ">".join([head, *blocks[::5]])))
    assert thinned.interval_s == 5.0
    assert "epochs are 5 s apart, though the header says 1 s" in thinned.notes
    single = read_observations(written(tmp_path, ">".join([head, blocks[0]])))
    assert (len(single), single.interval_s) == (1, 1.0)


def test_odd_time_tags_are_rounded_and_said(tmp_path: Path, mosaic_text: str) -> None:
    odd = mosaic_text.replace("2024 06 24 08 20  3.0000000", "2024 06 24 08 20  2.9998000", 1)
    read = read_observations(written(tmp_path, odd))
    assert read.tow_s[3] == 116403.0
    assert any("rounded to the millisecond, by up to 200 us" in note for note in read.notes)


# -- broken files -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("form", ["plain", "compact"])
@pytest.mark.parametrize("version", [2, 3])
def test_a_cut_file_gives_its_whole_epochs(
    tmp_path: Path, mosaic_text: str, upc_text: str, version: int, form: str
) -> None:
    text = mosaic_text if version == 3 else upc_text
    whole = read_observations(written(tmp_path, text))
    if form == "compact":
        text = sidereon.encode_crinex(text)
    generator = random.Random(version)
    start = len(text) // 2
    for cut in generator.sample(range(start, len(text) - 1), 25):
        read = read_observations(written(tmp_path, text[:cut]))
        assert 1 <= len(read) < len(whole)
        # Whatever is there is right, and at least all epochs that end before the cut but one are there.
        same(read, whole, len(read))
        assert read.notes


def test_a_cut_compressed_file_gives_its_whole_epochs(data_dir: Path, tmp_path: Path) -> None:
    data = (data_dir / UPC1).read_bytes()
    read = read_observations(written(tmp_path, data[: len(data) // 2]))
    same(read, read_observations(data_dir / UPC1), len(read))
    assert 1500 < len(read) < 2100  # half of 3600, more or less: the gzip data are even
    assert any("cut off" in note for note in read.notes)


def test_a_file_cut_between_epochs_is_found_out_by_its_header(data_dir: Path, tmp_path: Path) -> None:
    read = read_observations(written(tmp_path, ">".join(text_of(data_dir / MOSAIC).split(">")[:11])))
    assert len(read) == 10
    assert read.notes == ("ends at 2024-06-24 08:20:09.000, its header says 2024-06-24 08:25:00.000",)


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"", "is empty"),
        (b" \n\n", "is empty"),
        (b"hello\n", "line 1: 'hello' is no RINEX header; expected a RINEX"),
        (bytes(range(256)) * 40, "line 1: .* is no RINEX header"),
        (b"\x1f\x9d\x90junk", r"Unix compress \(.Z\); expected plain text or gzip"),
        (b"\x1f\x8b\x08" + bytes(7) + b"\xff" * 20, "damaged gzip"),
        (gzip.compress(b"", mtime=0), "is empty"),
        (
            b"     5.00           OBSERVATION DATA    M".ljust(60) + b"RINEX VERSION / TYPE\n",
            "version 5; expected 2, 3",
        ),
        (
            b"     x.yz           OBSERVATION DATA    M".ljust(60) + b"RINEX VERSION / TYPE\n",
            "version 'x.yz'; expected",
        ),
    ],
)
def test_files_that_are_not_rinex_are_refused(tmp_path: Path, content: bytes, problem: str) -> None:
    path = written(tmp_path, content)
    for read in (read_observations, read_navigation):
        with pytest.raises(RinexError, match=rf"some\.obs: .*{problem}|some\.obs: {problem}"):
            read(path)
    with pytest.raises(ValueError, match=r"absent\.obs: cannot be read: No such file"):
        read_observations(tmp_path / "absent.obs")


def test_the_wrong_kind_of_file_is_named(data_dir: Path) -> None:
    with pytest.raises(
        RinexError, match=r"base\.nav\.gz: line 1: file type .*NAV.*; expected a RINEX observation file"
    ):
        read_observations(data_dir / MOSAIC_NAV)
    with pytest.raises(RinexError, match=r"base\.obs\.gz: line 1: file type 'OBS.*; expected a RINEX navigation file"):
        read_navigation(data_dir / MOSAIC)


def test_damage_inside_names_line_and_value(tmp_path: Path, mosaic_text: str) -> None:
    lines = mosaic_text.split("\n")
    number = next(i for i, line in enumerate(lines) if line.startswith("G") and i > 200)
    lines[number] = lines[number][:22] + "XYZ" + lines[number][25:]
    with pytest.raises(RinexError, match=rf"some\.obs: line {number + 1}: .*observation.*XYZ"):
        read_observations(written(tmp_path, "\n".join(lines)))


def test_damaged_bits_in_gzip_are_found(data_dir: Path, tmp_path: Path) -> None:
    data = bytearray((data_dir / SPIRENT).read_bytes())
    data[len(data) // 2] ^= 0x10
    with pytest.raises(RinexError):
        read_observations(written(tmp_path, bytes(data)))


def test_a_header_without_end_or_epochs(tmp_path: Path, mosaic_text: str) -> None:
    end = mosaic_text.index(" " * 60 + "END OF HEADER")
    with pytest.raises(RinexError, match="END OF HEADER"):
        read_observations(written(tmp_path, mosaic_text[:end]))
    with pytest.raises(RinexError, match="no observation epoch"):
        read_observations(written(tmp_path, mosaic_text[: mosaic_text.index(">")]))


def test_random_damage_is_an_error_or_a_result(data_dir: Path, tmp_path: Path, mosaic_text: str, upc_text: str) -> None:
    """Nothing but RinexError comes out of damaged files, however they are damaged."""
    generator = random.Random(1)
    nav = text_of(data_dir / MOSAIC_NAV)[:8000]
    forms = [
        (read_observations, ">".join(mosaic_text.split(">")[:5])),
        (read_observations, upc_text[:6000]),
        (read_observations, sidereon.encode_crinex(mosaic_text)[:9000]),
        (read_navigation, nav),
    ]
    outcomes = {"read": 0, "refused": 0}
    for _ in range(400):
        reader, text = generator.choice(forms)
        data = bytearray(text.encode("latin-1"))
        for _ in range(generator.choice((1, 1, 3, 20))):
            place = generator.randrange(len(data))
            if generator.random() < 0.6:
                data[place] = generator.choice(b"0123456789 .-+DEGR>&\n\x00\xff")
            else:
                del data[place : place + generator.choice((1, 16, 80, 300))]
        try:
            read = reader(written(tmp_path, bytes(data)))
        except RinexError:
            outcomes["refused"] += 1
        else:
            outcomes["read"] += 1
            if reader is read_navigation:
                read.received(*read.first)
    assert min(outcomes.values()) > 20


# -- navigation -------------------------------------------------------------------------------------------------------


def test_counts_of_navigation_records(data_dir: Path) -> None:
    """Counted in the text: a GPS or Galileo record begins its line with the satellite; I/NAV by its data sources."""
    text = text_of(data_dir / MOSAIC_NAV)
    records = re.findall(
        r"^([GE]\d\d) .*\n(?:.*\n){4}.{4}.{19}(.{19})", text[text.index("END OF HEADER") :], re.MULTILINE
    )
    inav = sum(sat[0] == "E" and int(float(sources)) & 0b101 != 0 for sat, sources in records)
    fnav = sum(sat[0] == "E" and int(float(sources)) & 0b010 != 0 for sat, sources in records)
    gps = sum(sat[0] == "G" for sat, _ in records)
    assert (gps, inav, fnav) == (13, 39, 28)
    has_fnav = {sat for sat, sources in records if sat[0] == "E" and int(float(sources)) & 0b010}
    only_inav = sum(sat[0] == "E" and sat not in has_fnav for sat, _ in records)
    assert only_inav > 0
    for galileo, n_inav, n_fnav in (("inav", inav, 0), ("fnav", only_inav, fnav)):
        read = read_navigation(data_dir / MOSAIC_NAV, galileo=galileo)
        message = read.values[:, FIELDS.index("message")]
        assert np.bincount(message.astype(int), minlength=3).tolist() == [gps, n_inav, n_fnav]
    with pytest.raises(ValueError, match="galileo: 'cnav'; expected 'inav' or 'fnav'"):
        read_navigation(data_dir / MOSAIC_NAV, galileo="cnav")


def test_navigation_values_are_those_of_the_text(data_dir: Path) -> None:
    text = text_of(data_dir / MOSAIC_NAV)
    block = text[text.index("\nG07 2024 06 24 10 00 00") + 1 :].split("\n")[:8]
    numbers = [float(block[0][23 + 19 * i : 42 + 19 * i]) for i in range(3)]
    numbers += [float(line[4 + 19 * i : 23 + 19 * i]) for line in block[1:7] for i in range(4)]
    numbers.append(float(block[7][4:23]))
    # Order of RINEX 3.05 table A6.
    names = (
        *(
            "af0_s",
            "af1_sps",
            "af2_sps2",
            "iod",
            "crs_m",
            "delta_n_radps",
            "m0_rad",
            "cuc_rad",
            "e",
            "cus_rad",
            "sqrt_a",
        ),
        *(
            "toe_tow_s",
            "cic_rad",
            "omega0_rad",
            "cis_rad",
            "i0_rad",
            "crc_m",
            "omega_rad",
            "omega_dot_radps",
            "idot_radps",
        ),
        *("", "toe_week", "", "accuracy_m", "health", "group_delay_s", "iodc", "transmission"),
    )
    read = read_navigation(data_dir / MOSAIC_NAV)
    row = np.flatnonzero((read.satellite == SAT_INDEX["G07"]) & (read.toe_s == 2320 * 604800.0 + 122400.0))
    assert len(row) == 1
    for name, number in zip(names, numbers, strict=True):
        if name in FIELDS:
            assert read.values[row[0], FIELDS.index(name)] == number, name
    assert read.transmitted_s[row[0]] == 2320 * 604800.0 + numbers[-1]


def test_header_version_without_decimals(data_dir: Path) -> None:
    """Old archives have "2" where the parser wants "2.xx"."""
    path = data_dir / "static_pair_L1L2_1h_2010" / "brdc0770.10n.gz"
    assert text_of(path).startswith("     2              NAVIGATION")
    read = read_navigation(path)
    # Eight lines a record after the header.
    assert len(read.satellite) == (text_of(path).split("END OF HEADER")[1].count("\n") - 1) // 8 == 406
    hurt = read_navigation(path.with_name("brdc0770.10nERR.gz"))
    differs = ~np.all((read.values == hurt.values) | (np.isnan(read.values) & np.isnan(hurt.values)), axis=1)
    # README: one field of one record, G17's Cuc at 20:00.
    assert [SAT_IDS[sat] for sat in read.satellite[differs]] == ["G17"]
    row = np.flatnonzero(differs)[0]
    assert [
        FIELDS[i] for i in np.flatnonzero(read.values[row] != hurt.values[row]) if not np.isnan(hurt.values[row, i])
    ] == ["cuc_rad"]
    assert read.toe_s[row] == 1575 * 604800.0 + 4 * 86400.0 + 20 * 3600.0


def test_the_time_a_navigation_file_covers(data_dir: Path) -> None:
    read = read_navigation(data_dir / MOSAIC_NAV)
    assert "base.nav.gz covers 2024-06-24 00:20:00.000 to 2024-06-24 12:30:00.000" in read.describe()
    assert calendar_text(*read.first) == "2024-06-24 00:20:00.000"
    valid = read.valid_at(2320, 116400.0)
    assert valid.sum() == 27  # one of them, E18, unhealthy
    # The wrong day: nothing is valid, and the caller can say what is.
    other_day = gps_from_calendar(2024, 6, 25, 8, 20)
    assert not read.valid_at(*other_day).any()
    assert read.received(*other_day) == ()
    assert seconds_between(*read.last, *other_day) > 0.0


@pytest.mark.parametrize(
    ("name", "first", "n_early"),
    [
        (MOSAIC_NAV, (2320, 116400.0), 0),
        ("static_single_L1L5_2021/SEPT078M.21P.gz", (2149, 475200.0), None),
        ("storm_2003/brdc3030.03n.gz", (1242, 345630.0), None),
    ],
)
def test_reception_follows_transmission_and_settles_before_the_first_epoch(
    data_dir: Path, name: str, first: tuple[int, float], n_early: int | None
) -> None:
    read = read_navigation(data_dir / name)
    received = read.received(*first)
    keys = [epoch_key(r.gps_week, r.tow_s) for r in received]
    assert keys == sorted(keys)
    at_start = read.valid_at(*first)
    served = np.zeros_like(at_start)
    for item in received:
        for sat in np.flatnonzero(np.isfinite(item.message)):
            age_s = seconds_between(item.gps_week, item.tow_s, *first)
            valid = abs(seconds_between(item.toe_week[sat], item.toe_tow_s[sat], *first)) <= VALIDITY_S[sat]
            served[sat] |= age_s >= 120.0 and valid
            # Nothing that had expired.
            assert seconds_between(*first, item.toe_week[sat], item.toe_tow_s[sat]) >= -VALIDITY_S[sat]
    np.testing.assert_array_equal(served, at_start)
    # Each is received when it was transmitted, but for those that count as received before the start.
    sent = {}
    for row, sat in enumerate(read.satellite):
        sent.setdefault((sat, read.toe_s[row]), set()).add(read.transmitted_s[row])
    early = 0
    for item in received:
        for sat in np.flatnonzero(np.isfinite(item.message)):
            toe_s = item.toe_week[sat] * 604800.0 + item.toe_tow_s[sat]
            at_s = item.gps_week * 604800.0 + item.tow_s
            if at_s not in sent[sat, toe_s]:
                early += 1
                assert at_s == first[0] * 604800.0 + first[1] - 120.0
    assert early == n_early if n_early is not None else early > 0


def nav_text(*records: str) -> str:
    header = f"{'     3.04           N: GNSS NAV DATA    M: MIXED':<60}RINEX VERSION / TYPE\n{'':<60}END OF HEADER\n"
    return header + "".join(records)


def gps_record(sat: str = "G05", toe_h: float = 10.0, ttx: str = "", iode: int = 72, iodc: float | None = None) -> str:
    """A GPS record of 2024-06-24 with toe at an hour of that day; GPS week 2320, Monday."""
    toe = 86400.0 + 3600.0 * toe_h

    def row(*values: float) -> str:
        return "    " + "".join(f"{value:19.12E}" for value in values) + "\n"

    return (
        f"{sat} 2024 06 24 {int(toe_h):02d} {round(toe_h % 1 * 60):02d} 00{-1e-4:19.12E}{0.0:19.12E}{0.0:19.12E}\n"
        + row(iode, -98.0, 4e-9, 1.7)
        + row(-5e-6, 5e-3, 1.8e-6, 5153.6)
        + row(toe, 3e-8, 2.5, -5e-8)
        + row(0.97, 353.0, 1.27, -8e-9)
        + row(-2.6e-10, 1.0, 2320.0, 0.0)
        + row(2.0, 0.0, -1e-8, iode if iodc is None else iodc)
        + f"    {ttx:>19}{4.0:19.12E}\n"
    )


def receptions(path: Path, first_h: float = 9.5, **options: str) -> list[tuple[float, dict[str, float]]]:
    """Hour of the day of each reception, with the issue of data of each satellite."""
    found = read_navigation(path, **options).received(2320, 86400.0 + 3600.0 * first_h)
    return [
        ((r.tow_s - 86400.0) / 3600.0, {SAT_IDS[i]: r.iod[i] for i in np.flatnonzero(np.isfinite(r.iod))})
        for r in found
    ]


# Seconds of the week; 8:30 on Monday is 117000 s.
@pytest.mark.parametrize(
    ("ttx", "hour"),
    [
        (" 1.170000000000E+05", 8.5),  # as the file says
        ("", 8.0),  # not said: two hours before toe
        (" 9.999000000000E+08", 8.0),  # "unknown" in RINEX
        (" 1.000000000000E+03", 8.0),  # 33 h from toe: not believed
    ],
)
def test_time_of_reception(tmp_path: Path, ttx: str, hour: float) -> None:
    assert receptions(written(tmp_path, nav_text(gps_record(ttx=ttx)))) == [(hour, {"G05": 72.0})]


def test_a_transmission_in_the_week_before_toe(tmp_path: Path) -> None:
    record = (
        gps_record(toe_h=0.0).replace("2024 06 24 00", "2024 06 23 00").replace(f"{86400.0:19.12E}", f"{0.0:19.12E}")
    )
    record = record.replace(f"    {'':>19}{4.0:19.12E}", f"    {597618.0:19.12E}{4.0:19.12E}")
    read = read_navigation(written(tmp_path, nav_text(record)))
    assert read.toe_s[0] == 2320 * 604800.0
    assert read.transmitted_s[0] == 2319 * 604800.0 + 597618.0


def test_week_numbers_modulo_1024_do_no_harm(tmp_path: Path) -> None:
    rolled = gps_record().replace(f"{2320.0:19.12E}", f"{2320.0 - 2048.0:19.12E}")
    assert read_navigation(written(tmp_path, nav_text(rolled))).toe_s[0] == 2320 * 604800.0 + 122400.0


def test_receivers_are_switched_on_before_the_first_epoch(tmp_path: Path) -> None:
    path = written(tmp_path, nav_text(gps_record(toe_h=10.0), gps_record(toe_h=12.0, iode=73)))
    # At 7:59 none is valid. At 8:00 the first is, though it is only just being received: it counts as known.
    assert receptions(path, first_h=7.98) == [(8.0, {"G05": 72.0}), (10.0, {"G05": 73.0})]
    assert receptions(path, first_h=8.0) == [(8.0 - 120 / 3600, {"G05": 72.0}), (10.0, {"G05": 73.0})]
    # At 10:01 the second has been received for a minute; the first serves, as received.
    assert receptions(path, first_h=10.0 + 1 / 60) == [(8.0, {"G05": 72.0}), (10.0, {"G05": 73.0})]
    # At 12:01 the first has expired.
    assert receptions(path, first_h=12.0 + 1 / 60) == [(10.0, {"G05": 73.0})]


def test_satellites_received_at_once_share_a_record_but_not_two_of_one(tmp_path: Path) -> None:
    ttx = " 1.170000000000E+05"
    records = [
        gps_record("G05", 10.0, ttx, 72),
        gps_record("G07", 10.0, ttx, 5),
        gps_record("G05", 9.0, ttx, 71),
    ]
    assert receptions(written(tmp_path, nav_text(*records))) == [
        (8.5, {"G05": 71.0, "G07": 5.0}),
        (8.5, {"G05": 72.0}),
    ]


def test_files_are_merged_and_repetitions_dropped(tmp_path: Path) -> None:
    early, late = gps_record(ttx=" 1.170000000000E+05"), gps_record(ttx=" 1.180000000000E+05")
    paths = [written(tmp_path, nav_text(late), "a.nav"), written(tmp_path, nav_text(early, gps_record("G07")), "b.nav")]
    read = read_navigation(paths)
    assert [SAT_IDS[sat] for sat in read.satellite] == ["G05", "G07"]
    assert read.transmitted_s[0] == 2320 * 604800.0 + 117000.0  # the earliest
    assert "a.nav, " in read.describe()
    assert "b.nav covers" in read.describe()
    with pytest.raises(ValueError, match="no navigation file"):
        read_navigation([])


@pytest.mark.parametrize(
    ("iodc", "kept"), [(72.0, 72.0), (328.0, 328.0), (72.0 * 2048, 72.0), (71.0, np.nan), (2000.0, np.nan)]
)
def test_iodc_must_go_with_iode(tmp_path: Path, iodc: float, kept: float) -> None:
    """IS-GPS-200N 20.3.3.4.1: its low 8 bits are the IODE, else data sets are mixed. Old archives hold it shifted."""
    read = read_navigation(written(tmp_path, nav_text(gps_record(iodc=iodc))))
    np.testing.assert_equal(read.values[0, FIELDS.index("iodc")], kept)
    assert bool(read.notes) is bool(np.isnan(kept))


def test_archives_with_shifted_iodc_are_whole(data_dir: Path) -> None:
    read = read_navigation(data_dir / "storm_2003" / "brdc3030.03n.gz")
    assert np.isfinite(read.values[:, FIELDS.index("iodc")]).all()
    assert read.notes == ()


def test_what_a_message_does_not_carry_is_missing(data_dir: Path) -> None:
    fnav = read_navigation(data_dir / MOSAIC_NAV, galileo="fnav")
    message = fnav.values[:, FIELDS.index("message")]
    e5b, iodc = fnav.values[:, FIELDS.index("group_delay_e5b_s")], fnav.values[:, FIELDS.index("iodc")]
    np.testing.assert_array_equal(np.isfinite(e5b), message == NavigationMessage.GALILEO_INAV)
    np.testing.assert_array_equal(np.isfinite(iodc), message == NavigationMessage.GPS_LNAV)
    # E14 and E18 are out of service by their own messages; that is passed on.
    assert (fnav.values[:, FIELDS.index("health")] != 0.0).any()


def test_a_satellite_with_only_the_other_galileo_message_gets_that(data_dir: Path) -> None:
    """The simulator's Galileo file is F/NAV by its data sources (bit 8: clock of E1 and E5a)."""
    read = read_navigation(data_dir / "spirent_L1L5_2023" / "RINEX_EN_Spirent.23L", galileo="inav", simulated=True)
    assert set(read.values[:, FIELDS.index("message")]) == {NavigationMessage.GALILEO_FNAV}
    assert all(item.simulated == 1.0 for item in read.received(2244, 36000.0))


def test_files_without_gps_or_galileo_are_refused(tmp_path: Path) -> None:
    with pytest.raises(RinexError, match=r"some\.obs: has no GPS LNAV or Galileo record"):
        read_navigation(written(tmp_path, nav_text()))


def test_rinex_4_navigation(data_dir: Path, tmp_path: Path) -> None:
    """A merged file with four kinds of messages: LNAV, I/NAV and F/NAV as many as the text announces."""
    path = data_dir / "nav_rinex4_2026" / "BRD400DLR_S_20260680000_01D_MN.rnx.gz"
    announced = re.findall(r"^> EPH ([GE]\d\d) (LNAV|INAV|FNAV)", text_of(path), re.MULTILINE)
    for galileo in ("inav", "fnav"):
        read = read_navigation(path, galileo=galileo)
        expected = {sat for sat, message in announced if message == galileo.upper() or message == "LNAV"}
        assert {SAT_IDS[sat] for sat in read.satellite} == expected
        # Repetitions (the file merges stations) are dropped, so there are fewer records than announced, not more.
        assert len(read.satellite) <= sum(message in ("LNAV", galileo.upper()) for _, message in announced)


def test_bands_of_the_preference_table_exist() -> None:
    assert all(band in BAND_INDEX and system in "GE" for system, band in DEFAULT_SIGNALS)

"""Damaged bursts: no crash, no wrong block accepted. The long form is a campaign of 100,000."""

from __future__ import annotations

import math
from collections import Counter
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from gbas_vdb.coding import radio
from gbas_vdb.coding.fec import encode_fec
from gbas_vdb.errors import VdbError
from gbas_vdb.messages import types as m
from gbas_vdb.messages.block import MessageBlock, decode_block, decode_blocks, encode_block
from gbas_vdb.transmission.receive import decode_burst
from vdb_fields import same

STATION = "EDVE"
NAN = math.nan


def correction(number: int) -> m.Correction100:
    return m.Correction100(
        ranging_source_id=number,
        iod=3 * number,
        prc_m=-1.23 * number,
        rrc_mps=0.01 * number,
        sigma_pr_gnd_m=0.02 * number,
        b_values_m=(0.05 * number, -0.05 * number, 0.1, NAN),
    )


STATION_DATA = m.Type2(
    n_reference_receivers=4,
    ground_accuracy_designator="C",
    gcid=2,
    magnetic_variation_rad=math.radians(3.5),
    sigma_vert_iono_gradient=4e-6,
    refractivity_index=379,
    scale_height_m=7900,
    refractivity_uncertainty=20,
    latitude_rad=0.91,
    longitude_rad=0.18,
    ellipsoid_height_m=87.5,
    adb1=m.AdditionalBlock1(k_md_e_pos_gps=5.0, k_md_e_c_gps=5.0),
    adb3=m.AdditionalBlock3(k_md_e_d_gps=5.0, sigma_vert_iono_gradient_d=4e-6, y_eig_m=1.0, m_eig=3e-4),
)
FAS = m.FasBlock(
    airport_id="EDVE",
    runway_number=26,
    approach_performance_designator=2,
    reference_path_data_selector=3,
    reference_path_identifier="G26A",
    ltp_latitude_rad=0.912,
    ltp_longitude_rad=0.184,
    ltp_height_m=130.0,
    delta_fpap_latitude_rad=-1e-5,
    delta_fpap_longitude_rad=-4e-4,
    tch_m=15.0,
    gpa_rad=math.radians(3.0),
    course_width_m=105.0,
)


def bursts() -> list[tuple[bytes, tuple[MessageBlock, ...]]]:
    """Payloads of several kinds of burst, with what they say."""
    measurements = tuple(correction(number) for number in range(1, 19))
    type1 = m.Type1(
        modified_z_count_s=17.5, ephemeris_decorrelation=1e-4, ephemeris_crc=4711, measurements=measurements
    )
    type11 = m.Type11(
        modified_z_count_s=17.5,
        ephemeris_decorrelation_d=1e-4,
        measurements=tuple(
            m.Correction30(
                ranging_source_id=number, prc_30_m=1.0, rrc_30_mps=0.0, sigma_pr_gnd_d_m=0.1, sigma_pr_gnd_30_m=NAN
            )
            for number in range(1, 13)
        ),
    )
    approach = m.Type4(data_sets=(m.FasDataSet(fas=FAS, fasval_m=10.0, faslal_m=40.0),))
    prediction = m.Type5(
        modified_z_count_s=17.5,
        sources=(m.PredictedSource(ranging_source_id=4, becomes_available=False, duration_s=300.0),),
    )
    contents: list[list[m.Message]] = [
        [type1],
        [replace(type1, measurements=measurements[:6]), STATION_DATA, approach],
        [type11, STATION_DATA],
        [STATION_DATA],
        [prediction, m.Type3(n_fill_bytes=100)],
    ]
    result = []
    for messages in contents:
        data = b"".join(encode_block(message, STATION) for message in messages)
        result.append((data + encode_fec(data), decode_burst(data + encode_fec(data)).blocks))
    return result


def damaged_bytes(random: np.random.Generator, payload: bytes) -> bytes:
    """A payload damaged in one of several ways."""
    data = np.frombuffer(payload, dtype=np.uint8).copy()
    kind = random.integers(0, 6)
    if kind == 0:  # a few wrong bytes
        places = random.choice(len(data), size=int(random.integers(1, 9)), replace=False)
        data[places] ^= random.integers(1, 256, size=len(places), dtype=np.uint8)
    elif kind == 1:  # scattered wrong bits
        rate = 10.0 ** random.uniform(-3.5, -0.5)
        data ^= np.packbits(random.random(8 * len(data)) < rate)
    elif kind == 2:  # a fade: a run of noise
        start = int(random.integers(0, len(data)))
        end = min(len(data), start + int(random.integers(1, 40)))
        data[start:end] = random.integers(0, 256, size=end - start, dtype=np.uint8)
    elif kind == 3:  # cut short or made longer
        length = int(random.integers(0, 260))
        data = np.resize(data, length) if length else data[:0]
    elif kind == 4:  # a run repeated elsewhere
        size = int(random.integers(1, 30))
        source, target = random.integers(0, len(data) - size + 1, size=2)
        data[target : target + size] = data[source : source + size].copy()
    else:  # nothing but noise
        data = random.integers(0, 256, size=len(data), dtype=np.uint8)
    return data.tobytes()


def run_campaign(n_bursts: int, seed: int) -> Counter[str]:
    """Damage bursts and judge what comes out: a block accepted must be one that was sent."""
    random = np.random.default_rng(seed)
    sent = bursts()
    counts: Counter[str] = Counter()
    for number in range(n_bursts):
        payload, blocks = sent[number % len(sent)]
        if number % 4 == 3:  # through the radio: damaged scrambled bits, training sequence included
            bits = radio.burst_bits(payload, number % 8)
            wrong = random.random(len(bits)) < 10.0 ** random.uniform(-4.0, -1.0)
            try:
                received = radio.decode_burst_bits(bits ^ wrong.astype(np.uint8)).payload
            except VdbError:
                counts["training refused"] += 1
                continue
        else:
            received = damaged_bytes(random, payload)
        decoded = decode_burst(received)
        counts["accepted blocks"] += len(decoded.blocks)
        counts["wrong blocks"] += sum(not any(same(block, good) for good in blocks) for block in decoded.blocks)
        counts["corrected bursts"] += decoded.corrected_bytes > 0
        counts["whole bursts"] += len(decoded.blocks) == len(blocks)
        counts["bursts with errors"] += bool(decoded.errors)
    counts["bursts"] = n_bursts
    return counts


def judge(counts: Counter[str]) -> None:
    assert counts["wrong blocks"] == 0
    # Every way of damage was met: some bursts repaired, some lost, some blocks read.
    assert counts["corrected bursts"] > 0.02 * counts["bursts"]
    assert counts["bursts with errors"] > 0.2 * counts["bursts"]
    assert counts["whole bursts"] > 0.05 * counts["bursts"]


def test_damaged_bursts_short() -> None:
    judge(run_campaign(3_000, seed=20240624))


@pytest.mark.campaign
def test_damaged_bursts_campaign() -> None:
    counts = run_campaign(100_000, seed=1)
    print(dict(counts))
    judge(counts)


def test_four_or_more_wrong_bytes_never_give_a_wrong_block() -> None:
    random = np.random.default_rng(5)
    sent = bursts()
    for number in range(1_500):
        payload, blocks = sent[number % len(sent)]
        data = bytearray(payload)
        for place in random.choice(len(data), size=int(random.integers(4, 13)), replace=False):
            data[place] ^= int(random.integers(1, 256))
        for block in decode_burst(bytes(data)).blocks:
            assert any(same(block, good) for good in blocks)


@given(data=st.binary(max_size=400))
@example(data=b"\xaa" * 228)
@example(data=bytes(228))
@settings(max_examples=500, deadline=None)
def test_any_bytes_as_a_burst_never_raise(data: bytes) -> None:
    decoded = decode_burst(data)
    # Arbitrary bytes have a valid CRC once in 2^32.
    assert decoded.blocks == ()


@given(data=st.binary(max_size=300))
@settings(max_examples=500, deadline=None)
def test_any_bytes_as_application_data_never_raise(data: bytes) -> None:
    decode_blocks(data)


def with_header_and_crc(message_type: int, body: bytes) -> bytes:
    """A block of an arbitrary body with the right CRC, which lets it through to the decoders behind."""
    return encode_block(m.UnknownMessage(message_type=message_type, body=body), STATION)


@given(message_type=st.sampled_from([1, 2, 3, 4, 5, 11, 101]), body=st.binary(max_size=212))
@settings(max_examples=1_000, deadline=None)
def test_any_body_with_a_right_crc_decodes_or_is_named(message_type: int, body: bytes) -> None:
    blocks, errors = decode_blocks(with_header_and_crc(message_type, body))
    if errors:
        assert blocks == ()
        assert f"message type {message_type}" in errors[0].reason
        return
    # What was accepted can be sent again, and says the same.
    (decoded,) = blocks
    again = decode_block(encode_block(decoded.message, decoded.station_id))
    assert same(again.message, decoded.message)


@given(start=st.binary(max_size=30), count=st.integers(0, 31), data=st.data())
@settings(max_examples=300, deadline=None)
def test_bodies_near_a_type1_message(start: bytes, count: int, data: st.DataObject) -> None:
    body = bytearray(start.ljust(7, b"\0")[:7])
    body[2] = body[2] & 0xE0 | count
    body += data.draw(st.binary(min_size=11 * min(count, 18), max_size=11 * min(count, 18)))
    with suppress(VdbError):
        decode_block(with_header_and_crc(1, bytes(body)))

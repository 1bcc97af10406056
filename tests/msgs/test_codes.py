"""Enumerations, products and modes: numbers that stand in bags must never get another meaning."""

from __future__ import annotations

import pytest

from gbas_msgs_py.codes import (
    ENUMERATIONS,
    FIRST_LATCHED,
    ApproachState,
    ChannelState,
    EventKind,
    ExclusionCause,
    MonitorState,
    Rejection,
    ServiceType,
    Signal,
    enumerations,
)
from gbas_msgs_py.modes import MODES, Mode, mode_of
from gbas_msgs_py.products import PRODUCT_INDEX, PRODUCTS

# As they stood in the first bags (contract 1), and signals since contract 2.
NUMBERS = {
    ChannelState: "not_tracked settling usable excluded recovering",
    MonitorState: "not_due not_monitored passed failed",
    ServiceType: "none c d",
    ApproachState: "no_signal vdb_acquired data_valid differential approach loss",
    Rejection: "none not_tracked no_station system no_correction correction_invalid correction_age b_values "
    "ephemeris_iod ephemeris_crc_missing ephemeris_crc_mismatch not_settled distance elevation sigma range_test",
}
CAUSES = {
    0: "none not_tracked settling below_mask no_ephemeris too_few_receivers too_few_common_satellites sigma_too_large "
    "no_rate unmonitored ionosphere_unprotected",
    FIRST_LATCHED: "b_value receiver_fault prc_limit rrc_limit range_residual signal_power code_carrier_divergence "
    "two_frequency_divergence ionosphere_gradient carrier_acceleration carrier_rate carrier_step expected_power "
    "ephemeris_residual sigma_mean sigma_spread common_slip receiver_baselines",
}


@pytest.mark.parametrize("kind", NUMBERS)
def test_numbers_are_those_of_old_bags(kind):
    for number, word in enumerate(NUMBERS[kind].split()):
        assert kind(number).word == word
        assert float(kind(number)) == number


def test_causes_are_those_of_old_bags():
    for first, words in CAUSES.items():
        for number, word in enumerate(words.split(), start=first):
            assert ExclusionCause(number).word == word


def test_signals_are_those_of_the_contract():
    assert {signal.name: int(signal) for signal in Signal} == {
        "NONE": 0, "L1": 1, "L2": 2, "L5": 5, "L1_L2": 12, "L1_L5": 15
    }  # fmt: skip


def test_kinds_of_events_are_their_words():
    assert EventKind("alert") is EventKind.ALERT
    assert " ".join(EventKind) == "exclusion readmission alert service station input finished"


def test_every_member_is_explained():
    named = enumerations()
    assert set(named) == {kind.__name__ for kind in ENUMERATIONS}
    for name, members in named.items():
        assert len({member["value"] for member in members}) == len(members) == len({m["name"] for m in members})
        if name != "NavigationMessage":
            assert all(member["doc"].endswith(".") for member in members)


def test_products_and_modes_are_unique():
    assert len(PRODUCT_INDEX) == len(PRODUCTS)
    assert len({(product.message_type, product.measurement_type) for product in PRODUCTS}) == len(PRODUCTS)
    assert len({mode.number for mode in MODES}) == len({mode.name for mode in MODES}) == len(MODES)
    assert mode_of(1.0).name == "l1_100"
    with pytest.raises(ValueError, match=r"mode 7 is none of 1 \(l1_100\), 2 \(l1_30\)"):
        mode_of(7.0)


def test_a_mode_needs_a_product_that_is_broadcast():
    values = {"name": "toy", "signal": Signal.L2, "smoothing_s": 100.0, "service": ServiceType.NONE, "doc": "toy"}
    with pytest.raises(ValueError, match="product 'l2_100' is not one of l1_100, l1_30, l5_100, l5_30"):
        Mode(number=99, products=("l2_100",), **values)
    with pytest.raises(ValueError, match="number is 0"):
        Mode(number=0, products=("l1_100",), **values)

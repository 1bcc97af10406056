"""Node parameters from dataclasses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pytest

from gbas_core.parameters import ParameterError, parameters_from, require


@dataclass(frozen=True, kw_only=True)
class Example:
    flag: bool = False
    count: int = 3
    rate: float = 1.5
    name: str = "x"
    files: tuple[str, ...] = ()
    numbers: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        require("rate", self.rate, 0.0 <= self.rate < 10.0, "0 to 10")


def test_defaults_are_those_of_the_dataclass() -> None:
    assert parameters_from(Example, {}) == Example()


def test_values_come_over_defaults_with_their_types() -> None:
    made = parameters_from(Example, {"rate": 2, "files": ["a", "b"], "numbers": [1, 2.5], "flag": True})
    assert made == Example(rate=2.0, files=("a", "b"), numbers=(1.0, 2.5), flag=True)
    assert isinstance(made.rate, float)
    assert isinstance(made.numbers[0], float)


@pytest.mark.parametrize("empty", [None, [], [""]])
def test_an_empty_list_has_several_spellings_in_ros(empty: Any) -> None:
    assert parameters_from(Example, {"files": empty}).files == ()


@pytest.mark.parametrize(
    ("values", "complaint"),
    [
        ({"raet": 1.0}, "parameter 'raet' is unknown; did you mean 'rate'?"),
        ({"zzz": 1.0}, "parameter 'zzz' is unknown; known are count, files, flag"),
        ({"rate": -1.0}, "parameter 'rate' is -1.0, expected 0 to 10"),
        ({"rate": float("nan")}, "parameter 'rate' is nan"),
        ({"rate": "fast"}, "parameter 'rate' is 'fast', expected a number"),
        ({"rate": True}, "parameter 'rate' is True, expected a number"),
        ({"count": 3.0}, "parameter 'count' is 3.0, expected a whole number"),
        ({"count": True}, "parameter 'count' is True"),
        ({"flag": 1}, "parameter 'flag' is 1, expected true or false"),
        ({"name": 5}, "parameter 'name' is 5, expected a text"),
        ({"files": "a"}, "parameter 'files' is 'a', expected a list"),
        ({"files": [1]}, "parameter 'files' is 1, expected a text"),
        ({"numbers": ["a"]}, "parameter 'numbers' is 'a', expected a number"),
    ],
)
def test_refusals_name_parameter_value_and_bound(values: dict[str, Any], complaint: str) -> None:
    with pytest.raises(ParameterError) as told:
        parameters_from(Example, values)
    assert str(told.value).startswith(complaint)

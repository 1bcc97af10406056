"""One reproduced item and its verdict; sections of items; the whole of a study."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal, InvalidOperation
from enum import Enum
from typing import Any, Literal, get_args

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

_LEAST_DIGITS = 5

Kind = Literal["result", "coefficient", "input"]
"""What an item is of: what the paper finds, a number inside its equations, or what it starts from."""


class Verdict(Enum):
    """What became of an item; the value is the mark a person sees."""

    REPRODUCED = "✓"
    CLOSE = "≈"
    POINT = "●"
    DIFFERS = "✗"
    OTHER = "○"
    NEW = "+"
    LEFT_OUT = "–"

    @property
    def words(self) -> str:
        """The verdict in words."""
        return _WORDS[self]


_WORDS = {
    Verdict.REPRODUCED: "reproduced to the printed digits",
    Verdict.CLOSE: "close, within a stated tolerance",
    Verdict.POINT: "printed value is that of one point, not of the extremum it is given for",
    Verdict.DIFFERS: "differs or does not hold, for the reason given",
    Verdict.OTHER: "measured on other data than the paper's: not comparable digit by digit",
    Verdict.NEW: "not in the paper",
    Verdict.LEFT_OUT: "left out, for the reason given",
}


def agrees(printed: str, value: float) -> bool:
    """Whether a value rounds to what is printed: it lies within half a unit of the last digit.

    Parameters
    ----------
    printed : str
        A number as the paper prints it, such as ``"0.1763"`` or ``"7.153e-6"``.
    value : float

    Raises
    ------
    ValueError
        When `printed` is not a number.
    """
    number = _decimal(printed)
    exponent = number.as_tuple().exponent
    half = 0.5 * 10.0 ** int(exponent)
    # Rounding of binary fractions: a value on the edge may be either side of it.
    return bool(np.isfinite(value)) and abs(value - float(number)) <= half * (1.0 + 1e-9)


def _decimal(printed: str) -> Decimal:
    try:
        number = Decimal(printed)
    except InvalidOperation:
        raise ValueError(f"{printed!r} is not a number as a paper prints it") from None
    if not number.is_finite():
        raise ValueError(f"{printed!r} is not a number as a paper prints it")
    return number


@dataclass(frozen=True, kw_only=True)
class Value:
    """A number: the paper's, ours, and how ours is defined.

    Attributes
    ----------
    name : str
        What it is, such as ``"Table 3, Code, variant"``.
    ours : float or None
        What we compute [`unit`]; None when it was not computed, and then `why` says the reason.
    unit : str
        Such as ``"m"``; empty for a pure number.
    definition : str
        The definition under which `ours` was computed, complete enough to compute it again.
    paper : str or None
        The paper's number, exactly as printed (its digits decide the verdict); None for what the paper has not.
    point : float or None
        Value at the one point of the grid (named in `why`) at which the paper's number is met although it is not the
        extremum.
    tolerance : float or None
        Distance [`unit`] within which a value that misses the printed digits still counts as close, such as for a
        paper that truncates. `why` says where it comes from.
    comparable : bool
        False: ours comes from other data than the paper's, and `why` says from which.
    why : str
        Why the value differs, is a point value, is only close, is not comparable, or was left out. Needed for all of
        these.
    kind : {"result", "coefficient", "input"}
        A coefficient or an input that is met says less than a result that is: they are counted apart.
    """

    name: str
    ours: float | None
    unit: str
    definition: str
    paper: str | None = None
    point: float | None = None
    tolerance: float | None = None
    comparable: bool = True
    why: str = ""
    kind: Kind = "result"

    def __post_init__(self) -> None:
        _check_kind(self)
        if self.paper is not None:
            _decimal(self.paper)
        if not self.definition:
            raise ValueError(f"{self.name}: a value needs a definition")
        if self.verdict not in (Verdict.REPRODUCED, Verdict.NEW) and not self.why:
            raise ValueError(f"{self.name}: ours {self.ours} is not the paper's {self.paper}: why must say the reason")

    @property
    def verdict(self) -> Verdict:
        """Follows from the numbers."""
        if self.ours is None:
            return Verdict.LEFT_OUT
        if self.paper is None:
            return Verdict.NEW
        if not self.comparable:
            return Verdict.OTHER
        if agrees(self.paper, self.ours):
            return Verdict.REPRODUCED
        if self.point is not None and agrees(self.paper, self.point):
            return Verdict.POINT
        if self.tolerance is not None and abs(self.ours - float(self.paper)) <= self.tolerance:
            return Verdict.CLOSE
        return Verdict.DIFFERS

    @property
    def paper_text(self) -> str:
        """The paper's side for people."""
        return "–" if self.paper is None else self.paper

    @property
    def ours_text(self) -> str:
        """Our side for people: as many digits as the paper has, and five at least."""
        printed = 0 if self.paper is None else len(_decimal(self.paper).as_tuple().digits)
        return "–" if self.ours is None else f"{self.ours:.{max(_LEAST_DIGITS, printed)}g}"

    def as_json(self) -> dict[str, Any]:
        """The item as JSON-able data."""
        return {
            "name": self.name,
            "kind": "value",
            "paper": None if self.paper is None else float(self.paper),
            "paper_printed": self.paper,
            "ours": _number(self.ours),
            "unit": self.unit,
            "point": _number(self.point),
            "tolerance": self.tolerance,
            **_common(self),
        }


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A statement of the paper that holds or does not.

    Attributes
    ----------
    name : str
    holds : bool or None
        Computed, never declared; None when it was not looked at, and then `why` says the reason.
    paper_text, ours_text : str
        What the paper says, and what we find.
    definition : str
        How it was looked at.
    why : str
        Needed when the claim does not hold or was left out.
    new : bool
        The statement is ours, not the paper's.
    kind : {"result", "coefficient", "input"}
        As of a :class:`Value`.
    """

    name: str
    holds: bool | None
    paper_text: str
    ours_text: str
    definition: str
    why: str = ""
    new: bool = False
    unit: str = ""
    kind: Kind = "result"

    def __post_init__(self) -> None:
        _check_kind(self)
        if not self.definition:
            raise ValueError(f"{self.name}: a claim needs a definition")
        if not self.holds and not self.why:
            raise ValueError(f"{self.name}: the claim does not hold: why must say the reason")

    @property
    def verdict(self) -> Verdict:
        """Follows from `holds`."""
        if self.holds is None:
            return Verdict.LEFT_OUT
        if not self.holds:
            return Verdict.DIFFERS
        return Verdict.NEW if self.new else Verdict.REPRODUCED

    def as_json(self) -> dict[str, Any]:
        """The item as JSON-able data."""
        return {
            "name": self.name,
            "kind": "claim",
            "paper": self.paper_text,
            "ours": self.ours_text,
            "holds": None if self.holds is None else bool(self.holds),
            **_common(self),
        }


Item = Value | Claim


def reason(item: Item) -> str:
    """Why, where a reader has to know: nothing for what is reproduced."""
    return "" if item.verdict is Verdict.REPRODUCED else item.why


def _check_kind(item: Item) -> None:
    if item.kind not in get_args(Kind):
        raise ValueError(f"{item.name}: kind is {item.kind!r}: must be one of {', '.join(get_args(Kind))}")


def _common(item: Item) -> dict[str, Any]:
    return {
        "of": item.kind,
        "definition": item.definition,
        "verdict": item.verdict.name.lower(),
        "mark": item.verdict.value,
        "why": reason(item),
    }


def _number(value: float | None) -> float | None:
    return None if value is None or not np.isfinite(value) else float(value)


@dataclass(frozen=True, kw_only=True, eq=False)
class Picture:
    """One figure of the paper, or one of ours.

    Attributes
    ----------
    name : str
        File name without suffix, unique in the study: ``"fig-5"``.
    title, caption : str
        The caption says what to see, and whether data are recorded or simulated.
    figure : matplotlib.figure.Figure
        From :func:`gbas_studies.reproduction.drawing.new_figure`.
    data : mapping of str to (n,) array
        What is drawn, as columns (names carry the unit); written beside the picture as CSV.
    """

    name: str
    title: str
    caption: str
    figure: Figure
    data: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True, eq=False)
class Section:
    """A table or figure of the paper with its items.

    Attributes
    ----------
    title, text : str
    items : sequence of Item
    pictures : sequence of Picture
    """

    title: str
    text: str = ""
    items: Sequence[Item] = ()
    pictures: Sequence[Picture] = ()

    def as_json(self) -> dict[str, Any]:
        """The section as JSON-able data."""
        return {
            "title": self.title,
            "text": self.text,
            "items": [item.as_json() for item in self.items],
            "pictures": [
                {"name": picture.name, "title": picture.title, "caption": picture.caption} for picture in self.pictures
            ],
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class Reproduction:
    """All of one study.

    Attributes
    ----------
    study : str
        Its name on the command line.
    title : str
    source : str
        The publication, complete.
    about : str
        What was done and what not, in a few sentences.
    sections : sequence of Section
    """

    study: str
    title: str
    source: str
    about: str
    sections: Sequence[Section]

    def __post_init__(self) -> None:
        names = [picture.name for section in self.sections for picture in section.pictures]
        twice = [name for name, count in Counter(names).items() if count > 1]
        if twice:
            raise ValueError(f"{self.study}: two pictures are named {twice[0]}")

    @property
    def items(self) -> list[Item]:
        """Of all sections."""
        return [item for section in self.sections for item in section.items]

    def item(self, name: str) -> Item:
        """The item of a name.

        Raises
        ------
        KeyError
            When there is none.
        """
        for item in self.items:
            if item.name == name:
                return item
        raise KeyError(f"{self.study} has no item {name!r}")

    def counts(self) -> dict[Verdict, int]:
        """How many items have each verdict."""
        found = Counter(item.verdict for item in self.items)
        return {verdict: found.get(verdict, 0) for verdict in Verdict}

    def ticks(self) -> dict[str, int]:
        """What the reproduced items are: result values, statements, coefficients and inputs."""
        names = {"result": "result value", "coefficient": "coefficient", "input": "input"}
        found = Counter(
            "statement" if isinstance(item, Claim) and item.kind == "result" else names[item.kind]
            for item in self.items
            if item.verdict is Verdict.REPRODUCED
        )
        return {name: found.get(name, 0) for name in ("result value", "statement", "coefficient", "input")}

    def headline(self, verdict: Verdict) -> str:
        """A verdict in words; of what is reproduced, also what it is."""
        parts = [f"{count} {name}{'s' * (count != 1)}" for name, count in self.ticks().items() if count]
        return f"{verdict.words}: {', '.join(parts)}" if verdict is Verdict.REPRODUCED and parts else verdict.words

    def as_json(self) -> dict[str, Any]:
        """The study as JSON-able data."""
        return {
            "study": self.study,
            "title": self.title,
            "source": self.source,
            "about": self.about,
            "verdicts": {verdict.name.lower(): count for verdict, count in self.counts().items()},
            "reproduced": {f"{name.replace(' ', '_')}s": count for name, count in self.ticks().items()},
            "sections": [section.as_json() for section in self.sections],
        }

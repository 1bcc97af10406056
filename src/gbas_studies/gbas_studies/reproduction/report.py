"""What a reproduction leaves behind: ``results.json``, ``report.html``, the pictures and their data."""

from __future__ import annotations

import base64
import csv
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from itertools import zip_longest
from pathlib import Path
from typing import Any, Final

import jinja2
import numpy as np
from numpy.typing import NDArray

from gbas_studies.reproduction.items import Picture, Reproduction, Verdict, reason

SCHEMA: Final = "gbas/reproduction/1"
_DPI: Final = 150
_PACKAGE: Final = "gbas_studies"


@dataclass(frozen=True, kw_only=True)
class Written:
    """Files of a report."""

    report: Path
    results: Path
    pictures: tuple[Path, ...]


def write_report(
    reproductions: Sequence[Reproduction], out: Path, *, command: str = "", notes: Sequence[str] = ()
) -> Written:
    """Write everything a reproduction leaves behind.

    Parameters
    ----------
    reproductions : sequence of Reproduction
        One or several studies; they share a page.
    out : Path
        Folder; made when it is not there. ``figures/STUDY-NAME.png`` and ``.csv`` go below it.
    command : str
        What was typed, for the page.
    notes : sequence of str
        What a reader has to know about this run, such as that it was a quick one.
    """
    folder = out / "figures"
    folder.mkdir(parents=True, exist_ok=True)
    paths, images = [], {}
    for reproduction in reproductions:
        for section in reproduction.sections:
            for picture in section.pictures:
                stem = f"{reproduction.study}-{picture.name}"
                content = png(picture)
                paths.append(folder / f"{stem}.png")
                paths[-1].write_bytes(content)
                write_columns(picture.data, folder / f"{stem}.csv")
                images[stem] = f"data:image/png;base64,{base64.b64encode(content).decode('ascii')}"
    results, report = out / "results.json", out / "report.html"
    document = as_json(reproductions, command=command, notes=notes)
    results.write_text(json.dumps(document, indent=2, allow_nan=False, ensure_ascii=False) + "\n", encoding="utf-8")
    report.write_text(_page(reproductions, images, command, notes), encoding="utf-8")
    return Written(report=report, results=results, pictures=tuple(paths))


def as_json(reproductions: Sequence[Reproduction], *, command: str = "", notes: Sequence[str] = ()) -> dict[str, Any]:
    """The document of ``results.json``."""
    return {
        "schema": SCHEMA,
        "suite_version": version(_PACKAGE),
        "command": command,
        "notes": list(notes),
        "studies": [reproduction.as_json() for reproduction in reproductions],
    }


def png(picture: Picture) -> bytes:
    """The picture as a PNG file, the same bits for the same figure."""
    stream = io.BytesIO()
    picture.figure.savefig(stream, format="png", dpi=_DPI, metadata={"Software": None})
    return stream.getvalue()


def write_columns(columns: Mapping[str, NDArray[np.float64]], path: Path) -> None:
    """Write columns, which may differ in length, as CSV; nothing is written when there are none."""
    if not columns:
        return
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(columns)
        for row in zip_longest(*(np.asarray(column).tolist() for column in columns.values()), fillvalue=""):
            writer.writerow(["" if value != value else value for value in row])


def _page(reproductions: Sequence[Reproduction], images: Mapping[str, str], command: str, notes: Sequence[str]) -> str:
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("gbas_studies.reproduction", "templates"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("report.html.j2").render(
        reproductions=reproductions,
        images=images,
        command=command,
        notes=notes,
        version=version(_PACKAGE),
        verdicts=list(Verdict),
        reason=reason,
    )

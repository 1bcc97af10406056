"""Bags: finding their files, reading them in order, and the configuration stored in them.

A bag is a rosbag2 folder or a single ``.mcap`` file; every command takes either.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
import yaml

from gbas_bags import epochs
from gbas_bags.mcap_log import METADATA_FILE
from gbas_bags.mcap_scan import Damage, McapScan, Message
from gbas_core.errors import BagError

SUITE_METADATA: Final = "gbas"
CONFIGURATION_METADATA: Final = "gbas.configuration"
MAIN_CONFIGURATION: Final = "configuration"
"""Key of the suite's metadata: which of the configuration files starts the nodes."""
VECTOR_METADATA: Final = "vector_instructions"
"""Key of the suite's metadata: the processor's vector instructions, which last bits of sines depend on."""
END_METADATA: Final = "gbas.end"


def bag_files(path: Path) -> tuple[Path, ...]:
    """The MCAP files of a bag in their order.

    Raises
    ------
    BagError
        When there is no such bag, or it holds no MCAP file.
    """
    if path.is_file():
        if path.suffix != ".mcap":
            raise BagError(path, f"is a {path.suffix or 'nameless'} file; a bag is a folder or a .mcap file")
        return (path,)
    if not path.exists():
        raise BagError(path, "there is no such bag")
    found = sorted(path.glob("*.mcap"), key=_natural)
    listed = _listed_files(path)
    missing = [name for name in listed if not (path / name).is_file()]
    if missing:
        raise BagError(path, f"{METADATA_FILE} names {missing[0]}, which is not there")
    if listed:
        return tuple(path / name for name in listed)
    if not found:
        others = ", ".join(sorted(item.name for item in path.iterdir())[:3])
        raise BagError(path, f"no .mcap file in it, only {others}" if others else "the folder is empty")
    return tuple(found)


def _natural(path: Path) -> list[Any]:
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", path.name)]


def _listed_files(folder: Path) -> list[str]:
    """File names in the order ``metadata.yaml`` gives; none when it is absent or unreadable."""
    try:
        document = yaml.safe_load((folder / METADATA_FILE).read_text(encoding="utf-8"))
        names = document["rosbag2_bagfile_information"]["relative_file_paths"]
        return [Path(name).name for name in names if str(name).endswith(".mcap")]
    except (OSError, yaml.YAMLError, KeyError, TypeError, UnicodeDecodeError):
        return []


@dataclass
class BagReader:
    """Messages of a bag in file order, with what was found on the way.

    Parameters
    ----------
    path : Path
        Folder or file.
    strict : bool
        Raise at the first damage instead of going on behind it.
    """

    path: Path
    strict: bool = True
    scans: list[McapScan] = field(default_factory=list)

    def messages(self) -> Iterator[Message]:
        """All messages.

        Raises
        ------
        BagError
            When there is no such bag; if strict, when a part of it cannot be read.
        """
        self.scans = []
        for file in bag_files(self.path):
            scan = McapScan(file)
            self.scans.append(scan)
            for message in scan.messages():
                if self.strict and scan.damages:
                    break
                yield message
            if self.strict and (scan.damages or not scan.closed):
                damage = scan.damages[0] if scan.damages else Damage(0, "the file was never closed")
                raise BagError(file, f"at byte {damage.offset}: {damage.what}; try: gbas bag recover {self.path}")

    @property
    def damages(self) -> tuple[tuple[Path, Damage], ...]:
        """What could not be read, by file."""
        return tuple((scan.path, damage) for scan in self.scans for damage in scan.damages)

    @property
    def closed(self) -> bool:
        """Whether every file was ended by its writer."""
        return bool(self.scans) and all(scan.closed for scan in self.scans)

    @property
    def metadata(self) -> dict[str, dict[str, str]]:
        """Metadata records by name; of records with one name the last one."""
        return {name: values for scan in self.scans for name, values in scan.metadata}


def configuration_of(path: Path, metadata: Mapping[str, Mapping[str, str]]) -> dict[str, str]:
    """The configuration files stored in a bag, by name.

    Raises
    ------
    BagError
        When the bag holds none.
    """
    stored = metadata.get(CONFIGURATION_METADATA)
    if not stored:
        raise BagError(path, "no configuration is stored in it, so the nodes cannot be started as they were")
    return dict(stored)


def simulated_column(data: bytes) -> bool | None:
    """Whether an observation table says that a simulator made it; None when it does not say."""
    labels = [label for label, _ in epochs.dimensions(data)[0] if label.startswith("gbas/")]
    columns = labels[0].partition(": ")[2].split(",") if labels else []
    if "simulated" not in columns:
        return None
    value = epochs.table_head(data, columns.index("simulated") + 1)[-1]
    return None if math.isnan(value) else value != 0.0


def origin_of(origins: set[bool | None]) -> str:
    """What observation tables say they are, all of them: simulated, recorded, both or unknown."""
    known = origins - {None}
    if not known:
        return "unknown"
    if len(known) > 1:
        return "simulated and recorded"
    return "simulated" if known == {True} else "recorded"


def vector_instructions() -> str:
    """Vector instructions numpy computes with here; the last bits of sines depend on them."""
    found = np.show_config(mode="dicts")["SIMD Extensions"]  # type: ignore[index]  # a dictionary in this mode
    return ",".join([*found.get("baseline", ()), *found.get("found", ())])

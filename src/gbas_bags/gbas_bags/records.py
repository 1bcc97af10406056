"""The records in a bag: what was published, as the dataclasses of the contract."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np

from gbas_bags import epochs
from gbas_bags.bags import BagReader
from gbas_bags.definitions import typestore
from gbas_core.errors import BagError
from gbas_core.record import Record
from gbas_msgs_py import tables
from gbas_msgs_py.schema import SchemaError


def read_records(bag: Path, topics: Collection[str]) -> dict[str, list[Record]]:
    """All tables of some topics.

    Parameters
    ----------
    bag : Path
        Folder or file.
    topics : collection of str
        Full topic names.

    Returns
    -------
    dict
        Records by topic, in the order of the bag; a topic that is not in it has none.

    Raises
    ------
    BagError
        When the bag is damaged, or a payload is not what its label says.
    """
    records: dict[str, list[Record]] = {topic: [] for topic in topics}
    for message in BagReader(bag).messages():
        topic = message.channel.topic
        if topic not in records:
            continue
        try:
            decoded: Any = typestore().deserialize_cdr(message.data, epochs.TABLE_TYPE)
            label = decoded.layout.dim[-1].label
            shape = [dimension.size for dimension in decoded.layout.dim]
            records[topic].append(tables.decode_table(label, np.reshape(decoded.data, shape)))
        except (SchemaError, ValueError, IndexError) as error:
            raise BagError(bag, f"{topic}, message {len(records[topic]) + 1}: {error}") from error
    return records

"""FAS data blocks of ARINC 424 path point records, and the CRC that is printed in them.

These records are of satellite based augmentation (SBAS): the first 272 bits are those of a GBAS FAS block, then follow
horizontal and vertical alert limit (8 bits each, 0.2 m), and the CRC is over all 288.

Source: ICAO Annex 10 vol. I, App. D, table D-1 (FAS data block); records with their CRC in tests/tables.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from gbas_core.positioning.arinc424 import PathPoint, is_path_point, path_point
from gbas_vdb.coding.bits import BitWriter
from gbas_vdb.coding.crc import crc32q
from gbas_vdb.errors import VdbError
from gbas_vdb.messages.approach_tables import FAS_BLOCK
from gbas_vdb.messages.layout import encode
from gbas_vdb.messages.types import FasBlock

_LIMIT_STEPS_PER_M: Final = 5
_LARGEST_LIMIT: Final = 0xFF


class PathPointError(VdbError):
    """A path point record that cannot be used."""


@dataclass(frozen=True, kw_only=True)
class CheckedPathPoint:
    """A path point record and its block.

    Attributes
    ----------
    point : PathPoint
    block : bytes
        The SBAS FAS data block, 40 bytes, first bit on the air least significant, with the CRC that belongs to it.
    """

    point: PathPoint
    block: bytes

    @property
    def crc(self) -> str:
        """CRC of the block as records print it."""
        return self.block[-4:].hex().upper()

    @property
    def crc_ok(self) -> bool:
        """Whether the record prints that CRC."""
        return self.crc == self.point.crc


def fas_block_of(point: PathPoint) -> FasBlock:
    """The fields of a record as a FAS block."""
    match = re.fullmatch(r"(\d\d)([LCR]?)", point.runway)
    assert match is not None  # the record's columns have been checked
    longitude = math.remainder(point.fpap_lon_rad - point.ltp_lon_rad, 2.0 * math.pi)
    return FasBlock(
        operation_type=point.operation_type,
        sbas_provider=point.sbas_provider,
        airport_id=point.airport,
        runway_number=int(match.group(1)),
        runway_letter=match.group(2),
        approach_performance_designator=point.apd,
        route_indicator=point.route,
        reference_path_data_selector=point.rpds,
        reference_path_identifier=point.rpi,
        ltp_latitude_rad=point.ltp_lat_rad,
        ltp_longitude_rad=point.ltp_lon_rad,
        ltp_height_m=point.ltp_height_m,
        delta_fpap_latitude_rad=point.fpap_lat_rad - point.ltp_lat_rad,
        delta_fpap_longitude_rad=longitude,
        tch_m=point.tch_m,
        tch_in_feet=True,
        gpa_rad=point.gpa_rad,
        course_width_m=point.course_width_m,
        delta_length_offset_m=point.delta_length_offset_m,
    )


def checked_path_point(record: str) -> CheckedPathPoint:
    """Read a record and make its block; whether the CRC agrees is in the result.

    Raises
    ------
    PathPointError
        Naming columns or field, and what is wrong there.
    """
    try:
        point = path_point(record)
        writer = BitWriter()
        encode(FAS_BLOCK, fas_block_of(point), writer)
        for name, limit_m in (("hal", point.hal_m), ("val", point.val_m)):
            steps = round(limit_m * _LIMIT_STEPS_PER_M)
            if steps > _LARGEST_LIMIT:
                raise ValueError(f"{name} = {limit_m} m, at most {_LARGEST_LIMIT / _LIMIT_STEPS_PER_M} m fit")
            writer.put(steps, 8)
    except ValueError as error:
        raise PathPointError(str(error)) from None
    data = writer.to_bytes()
    return CheckedPathPoint(point=point, block=data + crc32q(data).to_bytes(4, "little"))


def trusted_path_point(record: str) -> PathPoint:
    """Read a record whose CRC must agree.

    Raises
    ------
    PathPointError
        As :func:`checked_path_point`, and for another CRC.
    """
    checked = checked_path_point(record)
    if not checked.crc_ok:
        raise PathPointError(
            f"columns 116 to 123 (crc) are {checked.point.crc!r}, the CRC of the record is {checked.crc!r}"
        )
    return checked.point


def path_points_of(text: str) -> Iterator[tuple[int, str]]:
    """Path point records in a text, each with the number of its line; other records are passed over."""
    for number, line in enumerate(text.splitlines(), start=1):
        if is_path_point(line):
            yield number, line

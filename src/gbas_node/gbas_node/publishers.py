"""Senders of a node: records of a schema, and numbers that are encoded only when there is a reader."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, ParamSpec, TypeVar

from rclpy.duration import Duration
from rclpy.publisher import Publisher

from gbas_core.record import Record
from gbas_msgs_py.cdr import TableCodec
from gbas_msgs_py.schema import TableSchema

A = ParamSpec("A")
R = TypeVar("R", bound=Record)


class TablePublisher(Generic[R]):
    """Publishes records of one schema."""

    def __init__(self, publisher: Publisher, schema: TableSchema[R]) -> None:
        self._publisher = publisher
        self._codec = TableCodec(schema)

    def settled(self, timeout_s: float) -> bool:
        """Wait until all readers have what was sent; False when that takes longer than the time-out."""
        return bool(self._publisher.wait_for_all_acked(Duration(seconds=timeout_s)))

    def publish(self, record: R) -> None:
        """Encode and send a record."""
        self._publisher.publish(self._codec.encode(record))


def when_heard(publisher: Publisher, encode: Callable[A, bytes]) -> Callable[A, None]:
    """Function that encodes and sends when there is a reader."""

    def publish(*args: A.args, **kwargs: A.kwargs) -> None:
        if publisher.get_subscription_count():
            publisher.publish(encode(*args, **kwargs))

    return publish

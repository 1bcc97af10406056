"""Node: position solutions in, protection levels, alert limits and the service out."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

from sensor_msgs.msg import NavSatFix

from gbas_airborne.modes import guiding_modes
from gbas_airborne.nodes.configuration import receiver_params
from gbas_airborne.receiver import AirborneReceiver
from gbas_airborne.service import ServiceState
from gbas_msgs_py import tables, topics
from gbas_msgs_py.codes import EventKind, ServiceType
from gbas_msgs_py.events import Event
from gbas_msgs_py.records import ProtectionEpoch, SolutionEpoch
from gbas_msgs_py.ros import fix_from_solution
from gbas_node.node import GbasNode
from gbas_node.params import ConfiguredParams
from gbas_node.serving import run


class ProtectionLevel(GbasNode):
    """Runs :meth:`AirborneReceiver.protect`; says that there is no service when solutions cease."""

    params_type = ConfiguredParams

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("protection_level", **kwargs)
        self.receiver = receiver_params(self, self.params.config)
        self.modes = tuple(mode.number for mode in guiding_modes(self.receiver))
        self.state = ServiceState()
        self.service_told = int(ServiceType.NONE)
        self.protection = self.table_publisher(topics.AIRBORNE_PROTECTION, tables.PROTECTION)
        self.service = self.uint8_publisher(topics.AIRBORNE_SERVICE)
        self.fix = self.message_publisher(NavSatFix, topics.AIRBORNE_FIX)
        self.scalars = {
            "vpl_m": self.float_publisher(topics.AIRBORNE_VPL),
            "lpl_m": self.float_publisher(topics.AIRBORNE_LPL),
            "val_m": self.float_publisher(topics.AIRBORNE_VAL),
            "lal_m": self.float_publisher(topics.AIRBORNE_LAL),
        }
        self.table_subscription(topics.AIRBORNE_SOLUTION, tables.SOLUTION, self.on_solution)

    def on_solution(self, solution: SolutionEpoch) -> None:
        self.when_ready(partial(self.step, solution))

    def step(self, solution: SolutionEpoch) -> None:
        """One solution: its protection levels and the service."""
        if solution.mode not in self.modes:
            self.problem("solution of a mode that is not configured")
            return
        self.state, protection, events = AirborneReceiver.protect(self.state, solution, self.receiver)
        self.protection.publish(protection)
        self.guide(solution, protection)
        self.publish_events(events)
        self.finished_epoch(solution.gps_week, solution.tow_s)

    def guide(self, solution: SolutionEpoch, protection: ProtectionEpoch) -> None:
        """Tell the service, and what is plotted beside it."""
        for name, publish in self.scalars.items():
            publish(getattr(protection, name))
        self.service_told = int(protection.service)
        self.service(self.service_told)
        if self.fix.get_subscription_count():
            protected = math.isfinite(protection.vpl_m + protection.lpl_m)
            self.fix.publish(fix_from_solution(solution, protected=protected))

    def due(self, now_s: float) -> float:
        if self.service_told != ServiceType.NONE and self.silent_s(now_s) > self.params.silence_s:
            self.withdraw()
        return super().due(now_s)

    def withdraw(self) -> None:
        """Without solutions there is nothing to decide on, so nobody else will say that the service has ended."""
        assert self.last_epoch is not None
        week, tow_s = self.last_epoch
        self.service_told = int(ServiceType.NONE)
        self.service(self.service_told)
        self.publish_events([
            Event(gps_week=week, tow_s=tow_s, kind=EventKind.SERVICE, subject="approach", cause="no_solution",
                  value=float(ServiceType.NONE), threshold=self.params.silence_s, source=self.get_name())
        ])  # fmt: skip


def main() -> None:
    """Console script."""
    run(ProtectionLevel)


if __name__ == "__main__":
    main()

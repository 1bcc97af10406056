"""Several nodes in one process: ``python -m gbas_bringup.single_process /gbas/positioning ... --ros-args ...``."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Sequence
from functools import partial

from gbas_bringup.node_kinds import NODE_KINDS
from gbas_core.errors import GbasError
from gbas_node.serving import Factory, run


def factory_of(full_name: str) -> Factory:
    """What makes the node of that name, in its namespace.

    Raises
    ------
    GbasError
        For a name that is no node of the suite.
    """
    namespace, _, name = full_name.rpartition("/")
    if name not in NODE_KINDS:
        raise GbasError(f"{full_name} is no node of the suite; known are {', '.join(NODE_KINDS)}")
    kind = NODE_KINDS[name]
    return partial(getattr(importlib.import_module(kind.module), kind.class_name), namespace=namespace)


def split_arguments(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """Names of nodes, and ROS arguments."""
    at = arguments.index("--ros-args") if "--ros-args" in arguments else len(arguments)
    return list(arguments[:at]), list(arguments[at:])


def main() -> None:
    """Run the nodes named on the command line until the first one ends."""
    names, ros_arguments = split_arguments(sys.argv[1:])
    try:
        factories = [factory_of(name) for name in names]
    except GbasError as error:
        print(f"single_process: {error}", file=sys.stderr)
        sys.exit(error.exit_code)
    run(factories, ros_arguments)


if __name__ == "__main__":
    main()

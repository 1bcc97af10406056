"""What ``ros2 param describe`` shows: descriptors of ROS parameters, made from their declarations."""

from __future__ import annotations

import typing
from typing import Any, Literal

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor

from gbas_core.parameters import Declared, Parameter


def descriptor_of(item: Declared) -> ParameterDescriptor:
    """Descriptor of a declared parameter: description with unit, range, and in words what ROS has no range for."""
    parameter = item.parameter
    kinds = _kinds(item.kind)
    descriptor = ParameterDescriptor(description=described(parameter), read_only=True, dynamic_typing=True)
    low, high = parameter.low, parameter.high
    if kinds == {float} and low is not None and high is not None:
        descriptor.floating_point_range = [FloatingPointRange(from_value=float(low), to_value=float(high), step=0.0)]
    elif kinds == {int} and low is not None and high is not None:
        descriptor.integer_range = [IntegerRange(from_value=int(low), to_value=int(high), step=1)]
    else:
        descriptor.additional_constraints = _in_words(parameter, item.kind)
    return descriptor


def described(parameter: Parameter) -> str:
    """What a parameter means, with its unit."""
    return parameter.doc if parameter.unit == "-" else f"{parameter.doc} [{parameter.unit}]"


def _in_words(parameter: Parameter, kind: Any) -> str:
    """Bounds and choices for which ROS has no field: of lists, to one side, of texts, of what may be left out."""
    words = []
    if choices := _choices(kind):
        words.append(f"one of {', '.join(map(repr, choices))}")
    if parameter.choices:
        words.append(f"one of {parameter.known()}")
    if parameter.low is not None or parameter.high is not None:
        each = "each " if _is_list(kind) else ""
        words.append(f"{each}{parameter.bounds()}")
    if type(None) in typing.get_args(kind):
        words.append("may be left out")
    return "; ".join(words)


def _choices(kind: Any) -> tuple[Any, ...]:
    if typing.get_origin(kind) is Literal:
        return typing.get_args(kind)
    return tuple(choice for inner in typing.get_args(kind) for choice in _choices(inner))


def _is_list(kind: Any) -> bool:
    return typing.get_origin(kind) is tuple or any(_is_list(inner) for inner in typing.get_args(kind))


def _kinds(kind: Any) -> set[Any]:
    """Kinds of value a parameter may have; a list is one of its own."""
    if typing.get_origin(kind) in (tuple, Literal):
        return {typing.get_origin(kind)}
    inner = typing.get_args(kind)
    return {each for one in inner for each in _kinds(one)} if inner else {kind}

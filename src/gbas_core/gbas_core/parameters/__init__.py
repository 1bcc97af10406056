"""Parameters: declared once, as fields of frozen dataclasses, for files, ROS, errors and documentation.

A set of parameters is a class under :func:`parameters`; each field is annotated with a :class:`Parameter`, which says
what it means, its unit and its bounds. Sets may hold others as fields: these are the sections of a file::

    @parameters
    class CcdParams:
        tau_s: Annotated[float, Parameter("time constant of both filters", "s", 1.0, 1000.0)] = 30.0
        mask_rad: Annotated[float, Parameter("lowest elevation", "deg", 0.0, 90.0)] = 0.1

Conventions: a field has the key of its name in a file, and SI units. Only angles differ: they are radians in the field
``mask_rad`` and degrees under the key ``mask_deg``; unit and bounds of their declaration are those of the file.

A section may be one of several kinds, told by one of its keys (``kind: Annotated[Literal["front"], Parameter(...)]`` in
each, ``discriminator="kind"`` in a ``pydantic.Field`` of the union), a mapping of names to sections (``dict[str,
Threat]``), or sections in order (:class:`Numbered`).

Values are checked when a set is made, from Python or from a file, by pydantic: the kind exactly (a whole number will do
for a float), bounds, no NaN, no infinity, no unknown key. What is wrong is told by a :class:`ParameterError` that names
key, value and bound in the file's unit.

What lives where: :mod:`declaration` (what is said of a parameter), :mod:`sets` (sets, made and checked),
:mod:`structure` (their types), :mod:`mappings` (sections of keys), :mod:`messages` (what is wrong), :mod:`listing`
(every parameter of a set), :mod:`schema` (for editors). The names below are what other packages use.
"""

from gbas_core.parameters.declaration import Derived, Numbered, Parameter
from gbas_core.parameters.listing import Declared, declared
from gbas_core.parameters.mappings import merged, nested
from gbas_core.parameters.messages import ParameterError, unknown_parameters
from gbas_core.parameters.schema import json_schema
from gbas_core.parameters.sets import from_mapping, made_of, parameters, replaced, to_mapping
from gbas_core.parameters.structure import file_key

__all__ = [
    "Parameter",
    "Derived",
    "Numbered",
    "parameters",
    "ParameterError",
    "from_mapping",
    "to_mapping",
    "made_of",
    "replaced",
    "file_key",
    "nested",
    "merged",
    "Declared",
    "declared",
    "unknown_parameters",
    "json_schema",
]

"""The fifteen fault modes of a divergence on two bands: which of the four measurements it acts on.

The order of the four is (code, code of the other band, carrier, carrier of the other band), as in the rows of
:func:`gbas_core.ranging.combinations.combination_matrix`; the names say L1 and L5 whatever the two bands are.

Source: Jiang, Milner, Macabiau, ENC 2015, 2.2 and figures 5 and 7: the code diverges by +d, the carrier by -d.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from gbas_core.record import FloatArray

FAULT_MODES: Final[dict[str, tuple[bool, bool, bool, bool]]] = {
    "Code L1": (True, False, False, False),
    "Code L5": (False, True, False, False),
    "Carrier L1": (False, False, True, False),
    "Carrier L5": (False, False, False, True),
    "Code L1+L5": (True, True, False, False),
    "Carrier L1+L5": (False, False, True, True),
    "Code+Carrier L1": (True, False, True, False),
    "Code+Carrier L5": (False, True, False, True),
    "Code L1, Carrier L5": (True, False, False, True),
    "Code L5, Carrier L1": (False, True, True, False),
    "Code L1+L5, Carrier L1": (True, True, True, False),
    "Code L1+L5, Carrier L5": (True, True, False, True),
    "Code L1, Carrier L1+L5": (True, False, True, True),
    "Code L5, Carrier L1+L5": (False, True, True, True),
    "Code+Carrier L1+L5": (True, True, True, True),
}
"""Where a divergence acts, by the paper's names in the paper's order."""

FAULT_SIGNS: Final = (1.0, 1.0, -1.0, -1.0)


def fault_direction(mode: str) -> FloatArray:
    """Rates of the four measurements for a divergence of 1 m/s.

    Parameters
    ----------
    mode : str
        One of :data:`FAULT_MODES`.

    Returns
    -------
    (4,) array
        +1 on the codes and -1 on the carriers of the mode [-].

    Raises
    ------
    ValueError
        For another name.
    """
    if mode not in FAULT_MODES:
        raise ValueError(f"mode {mode!r} is not one of: {'; '.join(FAULT_MODES)}")
    return np.where(FAULT_MODES[mode], FAULT_SIGNS, 0.0)

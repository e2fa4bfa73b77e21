"""What the bits of `quality(time)` mean."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

LOST, CLIPPED, CRC_REPAIRED, OUT_OF_ORDER, STUCK = 1, 2, 4, 8, 16
"""Bits of `quality(time)`."""

_QUALITY_MEANINGS: Final = {
    LOST: "lost",
    CLIPPED: "clipped",
    CRC_REPAIRED: "crc_repaired",
    OUT_OF_ORDER: "out_of_order",
    STUCK: "stuck",
}


def quality_attributes() -> dict[str, Any]:
    """Attributes of `quality(time)` that say what its bits mean, in CF's words.

    Returns
    -------
    dict
        ``flag_masks`` (ndarray of uint8) and ``flag_meanings`` (str), in the same order.

    Examples
    --------
    >>> quality_attributes()["flag_masks"].tolist(), quality_attributes()["flag_meanings"]
    ([1, 2, 4, 8, 16], 'lost clipped crc_repaired out_of_order stuck')
    """
    masks = np.array(list(_QUALITY_MEANINGS), dtype=np.uint8)
    return {"flag_masks": masks, "flag_meanings": " ".join(_QUALITY_MEANINGS.values())}

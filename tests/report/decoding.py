"""What the page decodes, in Python: 16-bit arrays, and the angle of a hinge from two rotations."""

import base64
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation


def decoded(packed: dict[str, Any]) -> NDArray[Any]:
    """The numbers of ``encoding.quantised``, ``(rows, columns)``."""
    low, span = np.array(packed["low"]), np.array(packed["span"])
    levels = np.frombuffer(base64.b64decode(packed["data"]), "<u2").reshape(-1, len(low))
    return low + span * levels / 65535


def angle(hinge: dict[str, Any], parent: NDArray[Any], body: NDArray[Any]) -> float:
    """The angle of a hinge, rad, of the quaternions w x y z of its two bodies."""
    rest, above, below = (
        Rotation.from_quat(one, scalar_first=True) for one in (hinge["rest"], parent, body)
    )
    turned = (rest.inv() * above.inv() * below).as_rotvec()
    return hinge["reference"] + float(turned @ np.array(hinge["axis"]))

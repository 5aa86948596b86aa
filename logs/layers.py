"""Layer files: the numbers of a compensating layer by name, for the software of a robot.

The comments of a file have the formula. The key ``layer`` of a policy file names one.
"""

import json
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np
from msgspec import Meta, Struct

from selfmodel.controllers.compensation import Compensated, Layer
from selfmodel.controllers.controller import Controller
from selfmodel.errors import InputError
from selfmodel.files import load_toml, read_file

HEADER = """\
# A compensating layer, as selfmodel evolved it around
# {within}.
#
#   command = clip(own + (own - neutral) * (gain - 1) + offset + response . felt, low, high)
#
# own: the command of the controller within for this motor, in the unit of the motor.
# felt: the direction of gravity in the frame of the base, its x (forward) and y (to the left),
#   0 if upright; and the angular velocity of the base about x, y and z of that frame, rad/s.
# velocity_shift is added to the velocity that the controller within is commanded: m/s forward and
#   to the left, and rad/s to the left.
"""

Number = Annotated[float, Meta(gt=-1e9, lt=1e9)]


class Motor(Struct, forbid_unknown_fields=True, frozen=True):
    """Numbers of a motor; see ``HEADER``."""

    gain: Annotated[float, Meta(gt=0, lt=1e9)]
    offset: Number
    neutral: Number
    low: Number
    high: Number
    response: tuple[Number, ...] = ()


class LayerFile(Struct, forbid_unknown_fields=True, frozen=True):
    """The file."""

    velocity_shift: tuple[Number, ...]
    motors: dict[str, Motor]


def layer_text(controller: Controller) -> str:
    """Returns the numbers of a controller's layer as TOML, to the last bit."""
    design = controller.design
    if not isinstance(design, Compensated):
        raise TypeError(f"expected a controller with a layer, got {design!r}")
    layer, within = design.decode(controller.genome[np.newaxis]), design.base
    text = HEADER.format(within=" ".join(within.design.summary(within.genome).split()))
    text += f"\nvelocity_shift = {layer.shift[0].tolist()}\n\n[motors]\n"
    for k, (motor, (centre, half)) in enumerate(zip(design.motors, design.ranges, strict=True)):
        numbers = {
            "gain": layer.gain[0, k].tolist(),
            "offset": layer.offset[0, k].tolist(),
            "neutral": float(design.neutral[k]),
            "low": float(centre - half),
            "high": float(centre + half),
            **({"response": layer.response[0, k].tolist()} if design.feedback else {}),
        }
        values = ", ".join(f"{key} = {value!r}" for key, value in numbers.items())
        text += f"{json.dumps(motor)} = {{ {values} }}\n"
    return text


def read_layer(path: Path, base: Controller) -> Controller:
    """Returns a controller with the layer of a file around it.

    Raises:
        InputError: The file is invalid, or of other motors, or a number is larger than a layer's.
    """
    data = read_file(path, "a layer file", 2**20)
    try:
        file = msgspec.convert(load_toml(data.decode()), LayerFile)
        rows = [file.motors[name] for name in base.design.motors]
        responses = [one.response for one in rows if one.response]
        design = Compensated.around(base, feedback=bool(responses))
        layer = Layer(
            offset=np.array([[one.offset for one in rows]]),
            gain=np.array([[one.gain for one in rows]]),
            shift=np.array([file.velocity_shift], dtype=np.float64),
            response=np.array([responses], dtype=np.float64),
        )
        return Controller(design, design.encode(layer))
    # No ValueError in msgspec 0.19.
    except (ValueError, KeyError, msgspec.ValidationError) as failure:
        what = f"the layer of {base.design.description}"
        raise InputError(f"{path}: expected {what}: {failure}") from failure

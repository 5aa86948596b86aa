"""Layer files: the numbers of a compensating layer by name, for the software of a robot.

``--controller`` takes one as the key ``layer`` of a policy file. Its own comments have the formula.
"""

import json
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np
from msgspec import Meta, Struct

from selfmodel.controllers.compensation import RESPONSES, Compensated, Layer
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
#   Without a response, 0.
# velocity_shift is added to the velocity that the controller within is commanded: m/s forward and
#   to the left, and rad/s to the left.
"""
"""Comments at the beginning of a file."""

Number = Annotated[float, Meta(gt=-1e9, lt=1e9)]
Responses = tuple[Number, Number, Number, Number, Number]


class Motor(Struct, forbid_unknown_fields=True, frozen=True):
    """Numbers of a motor; see ``HEADER``."""

    neutral: Number
    gain: Annotated[float, Meta(gt=0, lt=1e9)]
    offset: Number
    low: Number
    high: Number
    response: Responses | None = None


class LayerFile(Struct, forbid_unknown_fields=True, frozen=True):
    """The file."""

    velocity_shift: tuple[Number, ...]
    motors: dict[str, Motor]


def layer_text(controller: Controller) -> str:
    """Returns the numbers of a controller with a layer as TOML, to the last bit.

    Raises:
        InputError: The controller has no layer.
    """
    design = controller.design
    if not isinstance(design, Compensated):
        raise InputError(f"expected a compensating layer, got {design.description}")
    layer = design.decode(controller.genome[np.newaxis])
    within = design.base.design.summary(design.base.genome)
    lines = [HEADER.format(within=" ".join(within.split()))]
    lines.append(f"velocity_shift = {layer.shift[0].tolist()}")
    for k, (motor, (centre, half)) in enumerate(zip(design.motors, design.ranges, strict=True)):
        numbers = {
            "neutral": float(design.neutral[k]),
            "gain": float(layer.gain[0, k]),
            "offset": float(layer.offset[0, k]),
            "low": float(centre - half),
            "high": float(centre + half),
            **({"response": layer.response[0, k].tolist()} if design.feedback else {}),
        }
        lines.append(f"\n[motors.{json.dumps(motor)}]")
        lines += [f"{key} = {value!r}" for key, value in numbers.items()]
    return "\n".join(lines) + "\n"


def read_layer(path: Path, base: Controller) -> Controller:
    """Returns a controller with the layer of a file around it.

    Raises:
        InputError: The file is invalid, or of other motors, or a number is larger than a layer's.
    """
    what, motors = f"the layer of {base.design.description}", base.design.motors
    data = read_file(path, "a layer file", 2**20)
    try:
        file = msgspec.convert(load_toml(data.decode()), LayerFile)
    # No ValueError in msgspec 0.19.
    except (ValueError, msgspec.ValidationError) as failure:
        raise InputError(f"{path}: expected {what}: {failure}") from failure
    rows = [file.motors[name] for name in motors if name in file.motors]
    responses = [one.response for one in rows if one.response is not None]
    design = Compensated.around(base, feedback=bool(responses))
    shift = len(design.velocity or ())
    counts = (len(file.motors), len(rows), len(responses) or len(motors), len(file.velocity_shift))
    if counts != (len(motors), len(motors), len(motors), shift):
        raise InputError(
            f"{path}: expected {what}: the motors {', '.join(motors)}, a response of all or none, "
            f"and {shift} numbers of a velocity_shift"
        )
    layer = Layer(
        offset=np.array([[one.offset for one in rows]]),
        gain=np.array([[one.gain for one in rows]]),
        shift=np.array([file.velocity_shift], dtype=np.float64),
        response=np.array([responses], dtype=np.float64).reshape(1, -1, RESPONSES),
    )
    genome = design.encode(layer)[0]
    if (size := float(np.abs(genome).max())) > 1:
        raise InputError(f"{path}: expected {what}: a number is {size:.3g} times the largest")
    return Controller(design, genome)

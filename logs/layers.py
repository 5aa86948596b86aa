"""Layer files: the numbers of a compensating layer by name, for the software of a robot."""

import json

import numpy as np

from selfmodel.controllers.compensation import Compensated
from selfmodel.controllers.controller import Controller

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

"""Which kinds of fault and of environment a diagnosis of a robot considers."""

from collections.abc import Sequence

from selfmodel.anatomy import Anatomy
from selfmodel.errors import InputError
from selfmodel.faults import Kind


def considered(kinds: Sequence[Kind], anatomy: Anatomy) -> tuple[Kind, ...]:
    """Returns those that can strike a robot, and what they are at some degree.

    Who considers joints jammed at an angle considers those jammed at 0, and who considers the
    gain of a sensor considers one of 0: these are kinds of their own.

    Args:
        kinds: What was asked for; these come first, in their order.
        anatomy: The robot's parts.

    Raises:
        InputError: None of them can strike it, or one is not for diagnoses.
    """
    hidden = [kind.name for kind in kinds if not kind.hypothesised]
    if hidden:
        raise InputError(f"no diagnosis may propose {', '.join(hidden)}: leave it out")
    others = [other for kind in kinds for other in kind.others]
    able = tuple(kind for kind in dict.fromkeys((*kinds, *others)) if kind.candidates(anatomy))
    if not able:
        raise InputError(
            f"the robot has no part that {', '.join(kind.name for kind in kinds)} can strike, so "
            f"there is nothing to diagnose: consider other kinds, or name its limbs and sensors"
        )
    return able

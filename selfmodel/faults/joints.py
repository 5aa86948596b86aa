"""The parts that kinds of fault of a joint strike."""

from selfmodel.anatomy import Anatomy


def joints(anatomy: Anatomy) -> tuple[str, ...]:
    """Returns the names of the joints that can fail."""
    return tuple(joint.name for joint in anatomy.joints)

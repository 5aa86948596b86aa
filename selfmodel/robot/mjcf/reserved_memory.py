"""Numbers of contacts and constraints for which an MJCF reserves memory."""

from selfmodel.robot.mjcf.document.document import Document

_RESERVATIONS = ("njmax", "nconmax")
"""Attributes of ``<size>`` that MuJoCo 2.3 replaced by ``memory``."""

_LARGE = 2000
"""Largest number that stays. Memory grows with its square: 8000 constraints reserve 3 GB."""


def drop_large_reservations(document: Document) -> None:
    """Removes large numbers of contacts and constraints: MuJoCo then chooses the memory itself.

    Each thread of a simulation has this memory; the rodent of dm_control reserves 3 GB.

    Args:
        document: The MJCF, edited in place.
    """
    dropped = [
        f"{attribute}={size.attrib.pop(attribute)}"
        for size in document.root.findall("size")
        for attribute in _RESERVATIONS
        if _is_large(size.get(attribute, ""))
    ]
    if dropped:
        document.notes.append(f"MuJoCo chooses its memory itself, without {', '.join(dropped)}")


def _is_large(text: str) -> bool:
    try:
        return int(text) > _LARGE
    except ValueError:  # MuJoCo reports what is no number
        return False

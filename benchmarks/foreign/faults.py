"""Faults as data, and their notation in selfmodel."""

from dataclasses import dataclass

NOTATION = {
    "lost": "break:{part}",
    "jam": "jam:{part}={value:.4f}",
    "motor": "motor:{part}={value:.3f}",
    "dead-sensor": "sensor:{part}",
    "friction": "friction={value:.3f}",
    "slope": "slope={value:.3f}",
    "wind": "wind={value:.2f}",
    "crosswind": "crosswind={value:.2f}",
    "payload": "payload:{part}={value:.3f}",
    "damping": "damping:{part}={value:.2f}",
    "joint-friction": "joint-friction:{part}={value:.3f}",
    "delay": "delay={value:.2f}",
    "encoder-offset": "encoder-offset:{part}={value:.3f}",
    "encoder-slip": "encoder-offset:{part}=slip{value:.3f}",
    "grip": "grip:{part}={value:.3f}",
    "backlash": "backlash:{part}={value:.3f}",
}
"""Notation of each kind of fault that selfmodel has, or is to have. With ``encoder-slip``, the
servo uses the encoder with the offset; with ``encoder-offset``, it has another one. The notations
differ in the prefix of the number."""

UNKNOWN = ("crossed", "tether", "heavy-limb", "soft-ground", "side-slope", "short-range")
"""Kinds of faults that no kind of selfmodel expresses."""

SILENT = ("encoder",)
"""Kinds that change the record and not the robot: no diagnosis has to name them."""

ENCODERS = ("freezes", "follows", "nan", "none")
"""Behaviour of the encoders of a detached limb: constant, the commanded angle, NaN, and not in the
messages."""


@dataclass(frozen=True)
class Fault:
    """A fault of a robot, of its environment, or of its recorder.

    Attributes:
        kind: A key of ``NOTATION``, or one of ``UNKNOWN`` or ``SILENT``.
        part: Name of a part, hinge, sensor or body; empty for the environment.
        value: Severity in the unit of its notation; for the kinds of ``UNKNOWN`` as in ``damage``.
        encoders: With ``lost`` and ``encoder``, the behaviour of the encoders; of ``ENCODERS``.
        place: With ``payload``, position on the root body, m.
        debris: With ``lost``, whether the limb stays on the ground.
    """

    kind: str
    part: str = ""
    value: float = 0.0
    encoders: str = "freezes"
    place: tuple[float, float, float] = (0.0, 0.0, 0.0)
    debris: bool = False

    @property
    def notation(self) -> str:
        """The fault in selfmodel's notation; a kind that it does not have as ``outside:kind``."""
        if self.kind in UNKNOWN:
            return f"outside:{self.kind}"
        text = NOTATION[self.kind].format(part=self.part, value=self.value)
        return text.removesuffix("=0.0000").replace(":=", "=")


def notation(faults: tuple[Fault, ...]) -> list[str]:
    """Returns the truth of a case: the notation of each fault that a diagnosis has to name."""
    return [fault.notation for fault in faults if fault.kind not in SILENT]

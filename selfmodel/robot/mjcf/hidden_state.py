"""Removes hidden state: each physics step of a robot depends on the logged state alone."""

from xml.etree import ElementTree as ET  # of checked texts

import mujoco

from selfmodel.robot.mjcf.document.document import Document

MIN_ITERATIONS = {"iterations": 100, "ls_iterations": 50}
"""Least iterations of a solver without warm start, MuJoCo's defaults, by option. A Unitree Go1 with
one iteration, as MJX's models have, stands 9 mm lower without warm start, and 0.1 mm higher with 3;
Newton's method converges after 4 and stops."""

_WARM_START = int(mujoco.mjtDisableBit.mjDSBL_WARMSTART)
_SLEEP = int(mujoco.mjtEnableBit.mjENBL_SLEEP)


def remove_hidden_state(document: Document, model: mujoco.MjModel) -> None:
    """Turns off what makes a physics step depend on more than the state that a log contains.

    MuJoCo's solver starts at the acceleration of the step before (``qacc_warmstart``), which no log
    contains. A solver that stops before convergence, for example after one iteration, then computes
    another acceleration from a logged state than in the trial. Without the warm start, the
    acceleration is the same to the bit, and the solver needs more iterations for it.

    Args:
        document: The MJCF, edited in place.
        model: The compiled document.
    """
    if not model.opt.disableflags & _WARM_START:
        _disable(document, "warmstart")
        document.notes.append(
            "the solver's warm start is off: each physics step depends on the logged state alone"
        )
        _raise_iterations(document, model)
    if model.opt.enableflags & _SLEEP:
        _disable(document, "sleep")
        document.notes.append("sleep is off: no log contains which bodies are asleep")


def _raise_iterations(document: Document, model: mujoco.MjModel) -> None:
    raised = []
    for name, least in MIN_ITERATIONS.items():
        own = int(getattr(model.opt, name))
        if own < least:
            _set_option(document, name, str(least))
            raised.append(f"{name} from {own} to {least}")
    if raised:
        document.notes.append(
            f"a solver without warm start needs more iterations: {', '.join(raised)}"
        )


def _set_option(document: Document, name: str, value: str) -> None:
    # Of several <option> elements, the last with the attribute determines it.
    for option in document.root.findall("option"):
        option.attrib.pop(name, None)
    document.section("option").set(name, value)


def _disable(document: Document, flag: str) -> None:
    # MuJoCo accepts one <flag> in all <option> elements together.
    flags = document.root.find("option/flag")
    if flags is None:
        flags = ET.SubElement(document.section("option"), "flag")
    flags.set(flag, "disable")

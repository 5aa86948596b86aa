"""Which of the libraries that draw without a screen this machine has."""

import os
import subprocess
import sys

from selfmodel.errors import WorkError

VARIABLE = "MUJOCO_GL"
"""The environment variable by which MuJoCo chooses, when it is first imported."""

NOTHING = "disable"
"""Its value where nothing is to be drawn: MuJoCo then looks for no library."""

WITHOUT_SCREEN = ("egl", "osmesa") if sys.platform == "linux" else ("",)
"""What is tried, in this order; elsewhere than on Linux, MuJoCo's own choice."""

PATIENCE = 60
"""Seconds that a library may take for one picture."""

TRIAL = (
    "import mujoco\n"
    "model = mujoco.MjModel.from_xml_string('<mujoco><worldbody><light/></worldbody></mujoco>')\n"
    "with mujoco.Renderer(model, 8, 8) as renderer:\n"
    "    renderer.update_scene(mujoco.MjData(model))\n"
    "    renderer.render()\n"
)


def choose_gl() -> str:
    """Makes MuJoCo draw with a library that works; to be called before it is imported.

    Where ``MUJOCO_GL`` is set, it is that one or none. Each is tried in a process of its own: one
    that fails cannot always be undone.

    Returns:
        The value of ``MUJOCO_GL``.

    Raises:
        WorkError: None works.
    """
    wanted = os.environ.get(VARIABLE, "")
    tried = (wanted,) if wanted else WITHOUT_SCREEN
    for name in tried:
        if works(name):
            os.environ[VARIABLE] = name
            return name
    if wanted:
        raise WorkError(
            f"MuJoCo cannot draw with {VARIABLE}={wanted}: unset it, so that EGL and OSMesa are "
            f"tried, or draw stick figures, with --stick or -o NAME.png"
        )
    raise WorkError(
        "MuJoCo found no library to draw with, neither EGL nor OSMesa: install one (on Debian and "
        "Ubuntu: apt-get install libegl1 libgl1-mesa-dri, or libosmesa6), or draw stick figures, "
        "with --stick or -o NAME.png"
    )


def choose_nothing() -> None:
    """Makes MuJoCo look for no library, of which none may work; before it is imported."""
    os.environ[VARIABLE] = NOTHING


def works(name: str) -> bool:
    """Whether a picture can be drawn with a library, by its value of ``MUJOCO_GL``."""
    try:
        done = subprocess.run(  # noqa: S603  # this Python, and a text from above
            [sys.executable, "-c", TRIAL],
            env={**os.environ, VARIABLE: name},
            capture_output=True,
            check=False,
            timeout=PATIENCE,
        )
    except subprocess.TimeoutExpired:
        return False
    return done.returncode == 0

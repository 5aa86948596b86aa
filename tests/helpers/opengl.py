"""Which library there is to draw with; what needs one is skipped where there is none."""

import pytest

from selfmodel.cli.rendering.gl import WITHOUT_SCREEN, works

WORKS = next(filter(works, WITHOUT_SCREEN), None)
"""The value of ``MUJOCO_GL`` with which MuJoCo draws."""

draws = pytest.mark.skipif(
    WORKS is None, reason="neither EGL nor OSMesa is there: apt-get install libosmesa6"
)

"""Command sources of a robot: controllers (network, CPG) and playbacks of recorded commands.

A controller is a design with a genome (`controller.py`). Each design is one file: `network.py`,
`cpg.py`. A further design needs three changes: its file here with a `Design` and a
`ControllerBatch`, its row in `selfmodel.robot.designs.DESIGNS` (the names on the command line), and
its row in `selfmodel.logs.controllers.KINDS` (the arrays of its `.npz` file).
"""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from selfmodel.controllers.command_source import CommandSource as CommandSource
    from selfmodel.controllers.controller import (
        Controller as Controller,
        Design as Design,
        draw_genomes as draw_genomes,
    )
    from selfmodel.controllers.cpg import Cpg as Cpg
    from selfmodel.controllers.network import Network as Network
    from selfmodel.controllers.playback import Playback as Playback
else:
    __getattr__, __dir__, __all__ = lazy_loader.attach(
        __name__,
        submod_attrs={
            "command_source": ["CommandSource"],
            "controller": ["Controller", "Design", "draw_genomes"],
            "cpg": ["Cpg"],
            "network": ["Network"],
            "playback": ["Playback"],
        },
    )

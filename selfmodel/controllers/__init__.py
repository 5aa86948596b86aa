"""Command sources of a robot: controllers (network, CPG) and playbacks of recorded commands.

A controller is a design with a genome (`controller.py`). Each design is one file: `network.py`,
`cpg.py`. A further design needs three changes: its file here with a `Design` and a
`ControllerBatch`, its row in `selfmodel.robot.designs.DESIGNS` (the names on the command line), and
its row in `selfmodel.logs.controllers.KINDS` (the arrays of its `.npz` file).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

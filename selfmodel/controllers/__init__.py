"""Command sources of a robot: controllers (network, CPG) and playbacks of recorded commands."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

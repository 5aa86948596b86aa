"""Contract checks of plug-ins: each simulates what it needs, and names the broken rule."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

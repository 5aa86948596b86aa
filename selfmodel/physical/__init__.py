"""Physical robots: the interface, a simulated one with a reality gap, any dm_env environment."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

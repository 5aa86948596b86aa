"""Damage diagnosis and recovery of legged robots from a few logged trials.

An implementation of Bongard & Lipson, *Automated Damage Diagnosis and Recovery for Remote
Robotics* (ICRA 2004), on MuJoCo and dm_control. "The paper" in every docstring is that article.

The names of this package are the public interface; each loads on first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

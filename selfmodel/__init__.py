"""Find out what changed in a legged robot from a few logged trials, and get it walking again.

An implementation of Bongard & Lipson, *Automated Damage Diagnosis and Recovery for Remote
Robotics* (ICRA 2004), on MuJoCo and dm_control. "The paper" in every docstring is that one.
"""

from importlib.metadata import version

__version__ = version("selfmodel")

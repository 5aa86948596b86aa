"""The quadruped and the hexapod in PyBullet, as physical robots of an engine other than MuJoCo.

Recovery drives them through ``EnvironmentRobot``, as it drives hardware. Contacts, motors, noise
and delay are those of this package: they are draws of no reality gap of selfmodel. A fault is a
link that is absent, a joint that is fixed, or a sensor that reads 0.
"""

"""A hexapod of 18 position servos from a URDF of our own, in PyBullet with Bullet's own motors."""

"""Motors of an MJCF: position servos, their reach, and command ranges."""

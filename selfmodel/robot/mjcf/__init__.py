"""Any MJCF file, made into a robot."""

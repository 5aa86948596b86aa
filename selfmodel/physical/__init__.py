"""Physical robots: the interface, a simulated one with a reality gap, any dm_env environment."""

"""Pictures of a trial: the logged motion beside the simulated one."""

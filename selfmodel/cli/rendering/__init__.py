"""Pictures of a trial: the logged motion beside that of a model."""

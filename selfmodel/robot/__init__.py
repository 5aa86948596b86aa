"""A robot's MuJoCo model: its parts by name, its state by signal, its editable copy."""

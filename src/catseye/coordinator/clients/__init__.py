"""Who asks the coordinator: its port, the board of what is known, samplers, parameters."""

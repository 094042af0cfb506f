"""Clients of the coordinator: port, commands, samplers, parameters."""

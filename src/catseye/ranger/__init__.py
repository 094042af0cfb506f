"""The ranger's own language: what it is told, what it answers, and the integers of its motion chips."""

"""ZY protocol: ranger state, server, client, integers of its motion chips."""

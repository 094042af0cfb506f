"""Electronics that drift: reference shots, noise, random walks."""

"""Six-degree-of-freedom pose and pointing, from points or stars."""

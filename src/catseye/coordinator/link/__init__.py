"""One ranger behind its ports: connected, prepared, watched, asked for shots."""

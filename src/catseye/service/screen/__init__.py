"""The full-screen view of a running site: terminal, keys, what is shown."""

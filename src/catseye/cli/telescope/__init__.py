"""Commands for the telescope's people."""

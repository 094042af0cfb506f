"""The command line: it calls, it never computes."""

"""The commands of scans and searches."""

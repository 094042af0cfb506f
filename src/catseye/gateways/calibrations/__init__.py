"""Certificates and field reports of calibrations."""

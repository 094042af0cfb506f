"""Certificates of calibration: one document, written as a page or as PDF."""

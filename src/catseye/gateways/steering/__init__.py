"""Mirrors, servos, tracks and the sky on the way out."""

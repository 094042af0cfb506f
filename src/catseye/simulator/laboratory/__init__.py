"""Simulated laboratory instruments: refractometer, sound, triplet stand, panel tool."""

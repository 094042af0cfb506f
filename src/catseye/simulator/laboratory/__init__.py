"""Simulated laboratory instruments: sound, triplet stand, panel tool."""

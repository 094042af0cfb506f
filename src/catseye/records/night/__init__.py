"""Campaigns with shots and weather; records of a live night."""

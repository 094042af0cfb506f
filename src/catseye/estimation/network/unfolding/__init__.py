"""Figures from lengths alone: stations and targets both unknown."""

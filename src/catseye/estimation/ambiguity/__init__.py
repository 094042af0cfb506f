"""Whole numbers from real estimates: search trees for whole cycles."""

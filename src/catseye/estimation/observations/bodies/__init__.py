"""Conditions on bodies: rigid bodies, planes, lines, spheres, moving frames."""

"""What to shoot next: candidates, their value, a raster."""

"""Round planning: candidates, their value, the dish raster."""

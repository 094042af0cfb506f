"""What is in the way: boxes, solids, who sees what."""

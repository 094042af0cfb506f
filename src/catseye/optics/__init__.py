"""What the light meets: glass, cube-corner prisms, the cat's-eye ball."""

"""Pages of the documentation, as they come with the package."""

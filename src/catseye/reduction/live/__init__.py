"""The night's recipe, applied shot by shot with a filter state."""

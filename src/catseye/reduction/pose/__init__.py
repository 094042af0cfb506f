"""Six degrees of freedom and pointing: from a pose or from stars."""

"""The same recipe as shots come: states carried from epoch to epoch."""

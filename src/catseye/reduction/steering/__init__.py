"""Where a mirror may look and what it finds: guard, way round, tracking, search, visibility."""

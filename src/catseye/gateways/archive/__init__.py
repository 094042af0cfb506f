"""Writing of an archive: tables, samples, inputs, index."""

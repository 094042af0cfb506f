"""Archive of nights: layout, index, tables, codec of samples, verification."""

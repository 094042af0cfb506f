"""What a record is, how files are read, and how a bad one is refused."""

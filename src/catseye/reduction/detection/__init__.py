"""Detection of single buffers, frequency plans, whole cycles from several frequencies."""

"""Panel setting instrument: sheet, readings, panels and actuators."""

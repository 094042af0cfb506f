"""The panel setting instrument: its sheet, readings, the dish's panels and actuators."""

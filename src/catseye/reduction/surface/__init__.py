"""Shape of a dish from its prisms, its change, and actuator corrections."""

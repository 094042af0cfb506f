"""From the converter's samples to a phasor, a phase and whole cycles."""

"""Signal processing: converter samples to phasor, phase and whole cycles."""

"""What a ranger measures beside the range: zero, leakage, linearity, oscillator, glass."""

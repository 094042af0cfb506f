"""Output of mirrors, servos, tracks and the sky."""

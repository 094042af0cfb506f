"""Commands of detection: one buffer, the frequency plan, whole cycles."""

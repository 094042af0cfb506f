"""One buffer, the frequency plan and whole cycles: functions of detection."""

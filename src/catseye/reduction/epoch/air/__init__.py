"""Air of a campaign: stations, sounded lines, process in time, field."""

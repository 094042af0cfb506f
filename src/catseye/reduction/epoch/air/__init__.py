"""The air of a campaign: stations, sounded lines, a process in time, the field of all."""

"""What runs a living site: processes, the loop, the screen, the logs. It starts what other layers compute."""

"""Motion of the telescope during a campaign: its expansion, and bodies that sway."""

"""Frozen records read from files.

`night.campaign.read_campaign` reads a directory, `files.reading.read_record` one file.
"""

"""Lies of a night: records that are wrong, and nature that the model of the reduction does not have."""

"""`import catseye`: the structural model, frames, moving rangers."""

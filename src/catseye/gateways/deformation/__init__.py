"""Text, tables and figures of movements from changes of ranges."""

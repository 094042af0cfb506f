"""The ZIY: what to measure next, what must never be done, the links to the rangers, and the journal of it all."""

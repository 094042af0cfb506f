"""An EDM baseline as an adjustment, and the tests of ISO 17123-4."""

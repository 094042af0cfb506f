"""Design studies: number and place of rangers and targets."""

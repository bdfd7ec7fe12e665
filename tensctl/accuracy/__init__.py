"""How far to trust it: error against run time for the user's own scene."""

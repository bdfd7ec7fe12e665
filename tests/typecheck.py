"""The run-time check of shapes and types that `conftest.py` puts on some rooms; only tests have it."""

from beartype import BeartypeConf, beartype

checked = beartype(conf=BeartypeConf(is_pep484_tower=True))
"""A whole number passes for a float, as Python's own typing rules have it."""

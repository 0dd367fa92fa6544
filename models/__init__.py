"""Building files and trained surrogates, as data."""

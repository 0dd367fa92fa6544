"""Kinds of elements, one a file."""

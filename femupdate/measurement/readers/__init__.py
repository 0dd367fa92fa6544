"""Readers of measured files: one module a format, found by `femupdate.measurement.reader`."""

"""The command line: reads arguments, calls the library, shows progress; no engineering in it."""

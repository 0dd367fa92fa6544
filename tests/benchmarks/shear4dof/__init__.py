"""The four-story posterior with four modes, beside the exact one."""

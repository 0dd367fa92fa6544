"""Reduced models and what is computed with them: modes, FRFs, histories, story forces."""

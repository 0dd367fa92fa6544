"""Errors that femupdate raises on purpose: each says what is wrong, where, and what to do."""


class FemupdateError(Exception):
    """Base of every error whose message is meant to be read by the user as it stands."""


class UnitError(FemupdateError):
    """A quantity has no unit, an unknown unit or a unit of another kind."""


class BuildingError(FemupdateError):
    """A building file is missing, malformed or describes something that cannot stand."""


class ModelError(FemupdateError):
    """The finite-element model cannot be solved (mechanism, flat element, no support...)."""


class MeasurementError(FemupdateError):
    """A record or observation file cannot be used."""


class SurrogateError(FemupdateError):
    """A trained surrogate is missing, stale or does not fit the building."""


class InferenceError(FemupdateError):
    """The posterior cannot be drawn (no particle with a finite likelihood, for instance)."""


class StudyError(FemupdateError):
    """The study folder lacks an artefact, holds a stale one or cannot be written."""


class ReportError(FemupdateError):
    """A figure or a picture cannot be made from what was given, or cannot be written."""

"""Where simulation and measurement disagree, what is missing, and whether it closes the gap."""

from femupdate.lazy import public

__all__, __getattr__ = public(
    __name__,
    {
        "evidence": "missed_in_turn",
        "findings": "Diagnosis Finding",
        "fit": "likelihood_about parameters_at",
        "mesh_error": "corrected judged_by_mesh learn_mesh_error left_open MeshError",
        "search": "FinderModel plain_structure prepared refined sought",
        "thresholds": "DiagnosisSettings",
    },
)

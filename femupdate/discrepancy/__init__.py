"""Where simulation and measurement disagree, what is missing, and whether it closes the gap."""

from femupdate.lazy import lazily

_PUBLIC = {
    "corrected": "mesh_error",
    "Diagnosis": "findings",
    "DiagnosisSettings": "thresholds",
    "FinderModel": "search",
    "Finding": "findings",
    "learn_mesh_error": "mesh_error",
    "left_open": "mesh_error",
    "likelihood_about": "fit",
    "MeshError": "mesh_error",
    "missed_in_turn": "evidence",
    "parameters_at": "fit",
    "plain_structure": "search",
    "prepared": "search",
    "refined": "search",
    "screen_channels": "screen",
    "sought": "search",
}
__all__ = list(_PUBLIC)
__getattr__ = lazily(__name__, _PUBLIC)

"""Reduced structures with effects on them: modes, frequency responses and histories."""

from femupdate.lazy import public

__all__, __getattr__ = public(
    __name__,
    {
        "damping": "ConstantDamping damping_law DampingLaw RayleighDamping",
        "equations": "driven_system equations_at SensorRows",
        "excitation": "Excitation",
        "finer_mesh": "on_finer_mesh on_nodes_of",
        "force_response": "rest_flexibility",
        "history": "floor_histories history_batches ResponseHistories transformed_sensors",
        "level": "motion_level",
        "local_basis": "local_structure",
        "members": ("choose_members CutMember member_forces MemberForces write_member_forces"),
        "modes": "modal_sum ModalData Modes response",
        "reduced": "BaseRotation lumped reduced_on ReducedModel ReducedStructure",
        "reduction": "reduce_structure",
        "snapshots": "ReductionTarget",
        "spectra": "response_spectrum",
        "summary": "compare Statistics statistics story_stiffness summarise",
        "system": "Responses Rows System",
        "tracking": "driven_modes mesh_modes reduced_modes ReducedModes track_mode",
    },
)

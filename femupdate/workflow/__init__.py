"""What the commands do with a study, one file a command."""

from femupdate.lazy import public

__all__, __getattr__ = public(
    __name__,
    {
        "amplitude": "level_between record_levels",
        "build": "build_model",
        "calibrate": "calibrate_study check_calibration",
        "calibration_report": "kept_posterior",
        "compare": "compare_states find_state open_state",
        "conclusion": "draw_zeta",
        "diagnose": "diagnose_study",
        "effects": "kept_mesh_error open_structure open_system with_finer_mesh",
        "kinds": "measured_of",
        "likelihoods": "CalibrationSettings settled_likelihood",
        "model": ("CertifiedModel choose_building open_study reduce_building REDUCED StudyModel"),
        "observed": "ObservationSource readable",
        "page": "write_report",
        "predict": "predict_study PredictionSettings RecordSource",
        "render": "render_study",
        "repair": "repair_study",
        "status": "study_status",
        "train": "check_training train_study",
    },
)

"""Measured files of any format as observations of a building, and what looks wrong in them."""

from femupdate.lazy import public

__all__, __getattr__ = public(
    __name__,
    {
        "ambient": "identify_modes",
        "checks": "channel_findings pair_findings response_findings shape_findings",
        "estimated": "effective_averages mean_estimator noise_of_lines Segments",
        "frf": "estimate_frf LEAST_NOISE observation_for on_grid",
        "frf_table": "in_band",
        "inspection": "inspect_file",
        "modes": "identified_modes IdentifiedModes mode_findings",
        "names": "channel_name floor_height FloorChannel floors_of force_unit parse_channel",
        "observation": "Histories independent_share Observation resolved_share rotation_of"
        " select_floors",
        "reader": "kind_in read_measured read_observation_file",
        "record": "GroundMotion read_record without_offset",
        "recording": "azimuth_of RecordedChannel RecordedMode",
        "runs": "agreement differences pooled",
        "text": "TextFile",
        "write": "write_modes write_observation_histories",
    },
)

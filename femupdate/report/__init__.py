"""Report: figures of the results and pictures of the mode shapes."""

from femupdate.lazy import public

__all__, __getattr__ = public(
    __name__,
    {
        "figure": "draw save_figure",
        "geometry": "drawn Geometry Glyphs",
        "page": "Section items_of kept_items page_html scene_content thinned_geometry",
        "plot_building": "stick_mode_shapes",
        "plot_curves": "frf_fit",
        "plot_posterior": "posterior_pairs theta_intervals",
        "scale": "plus_minus",
    },
)

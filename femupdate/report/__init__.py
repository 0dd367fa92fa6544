"""Report: figures of the results and pictures of the mode shapes."""

from femupdate.lazy import lazily

_PUBLIC = {
    "draw": "figure",
    "drawn": "glyphs",
    "ElementField": "page_scene",
    "frf_fit": "plot_curves",
    "Geometry": "geometry",
    "Glyphs": "glyphs",
    "Page": "page",
    "plus_minus": "scale",
    "posterior_pairs": "plot_posterior",
    "SampleSet": "plot_posterior",
    "save_figure": "figure",
    "scene_content": "page_scene",
    "Section": "page",
    "stick_mode_shapes": "plot_sticks",
    "theta_intervals": "plot_posterior",
    "thinned_geometry": "page_scene",
}
__all__ = list(_PUBLIC)
__getattr__ = lazily(__name__, _PUBLIC)

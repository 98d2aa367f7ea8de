"""All figures, and the one door to matplotlib and corner: drawn without pyplot, saved with their data."""

from sma_bayes.report.figures.averages import average_figure, model_average_figure
from sma_bayes.report.figures.campaign import (
    correlation_figure,
    diagnostics_figure,
    parameter_figure,
    printed_figure,
)
from sma_bayes.report.figures.condition import loop_figure, overview_figure
from sma_bayes.report.figures.conditions import (
    effects_figure,
    held_out_figure,
    measured_figure,
    predicted_figure,
)
from sma_bayes.report.figures.crowd import correlation_of_many, diagnostics_of_many, parameters_of_many
from sma_bayes.report.figures.disagreement import disagreement_loops, residual_maps
from sma_bayes.report.figures.discrepancy import discrepancy_figure
from sma_bayes.report.figures.marginals import corner_figure
from sma_bayes.report.figures.missing import effect_figure, effect_parameter_figure, ladder_figure
from sma_bayes.report.figures.models import curves_figure, differences_figure, pages
from sma_bayes.report.figures.paper import (
    Curve,
    Nearest,
    Plugged,
    Profile,
    extremes_figure,
    nearest_figure,
    plugged_figure,
    profile_figure,
    rival_figure,
)
from sma_bayes.report.figures.record import predictive_figure, residual_figure, trace_figure
from sma_bayes.report.figures.sheet import BranchData, Drawing, FigureFiles, save, save_picture

__all__ = [
    "BranchData",
    "Curve",
    "Drawing",
    "FigureFiles",
    "Nearest",
    "Plugged",
    "Profile",
    "average_figure",
    "corner_figure",
    "correlation_figure",
    "correlation_of_many",
    "curves_figure",
    "diagnostics_figure",
    "diagnostics_of_many",
    "differences_figure",
    "disagreement_loops",
    "discrepancy_figure",
    "effect_figure",
    "effect_parameter_figure",
    "effects_figure",
    "extremes_figure",
    "held_out_figure",
    "ladder_figure",
    "loop_figure",
    "measured_figure",
    "model_average_figure",
    "nearest_figure",
    "overview_figure",
    "pages",
    "parameter_figure",
    "parameters_of_many",
    "plugged_figure",
    "predicted_figure",
    "predictive_figure",
    "printed_figure",
    "profile_figure",
    "residual_figure",
    "residual_maps",
    "rival_figure",
    "save",
    "save_picture",
    "trace_figure",
]

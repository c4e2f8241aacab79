"""Does the model hold? What the residuals of a fit must not contain, and what it costs if they do.

Causes are tested without a new fit (`score_tests`), the most telling first, the others beside it.
What is significant is stated three ways: its size in the readings, how uncertain it leaves the
heading, and by how much the covariance of the calibration has to grow so that the stated error
covers it: by δθ δθᵀ for the move of the estimate, and by the error itself where a calibration
cannot take it out.
"""

from agonic.health.adequacy.examine import describe_model_errors, examine_model, widen
from agonic.health.adequacy.fitted import Fitted, ModelError, Residuals, View, Views

__all__ = [
    "Fitted",
    "ModelError",
    "Residuals",
    "View",
    "Views",
    "describe_model_errors",
    "examine_model",
    "widen",
]

"""Running an algorithm that is written over scalars. Here it is interpreted: a float or a numpy array for each scalar."""

from articulated.compiler.interpreter import as_scalars, evaluate

__all__ = ["as_scalars", "evaluate"]

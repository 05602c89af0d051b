"""The experiment that settles a diagnosis: the motion that separates the explanations that stand."""

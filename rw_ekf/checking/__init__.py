"""Files that a person writes, held against models: strict YAML with positions, plain words for mistakes.

Knows nothing of wheels and filters, and needs no numpy: drivers use it as the estimator does.
"""

"""A log as filters run over it: times, pieces of current, conditions; and the model running free along it."""

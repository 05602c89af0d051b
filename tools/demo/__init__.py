"""The demonstration: a simulated wheel behind a tty, its log, what the model lacks, and the proof."""

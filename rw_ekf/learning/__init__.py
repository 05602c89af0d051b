"""What a wheel's runs have learned, from one run to the next: what is kept, whose it is, and what it is worth later."""

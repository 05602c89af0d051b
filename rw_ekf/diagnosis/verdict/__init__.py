"""What is said of a record: probabilities, words, the document."""
